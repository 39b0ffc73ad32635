"""Cells are halved where points differ, by a second account of what that means."""

import itertools

import numpy as np
import pytest

from stickslip.sweep._cells import Cells, most_levels


def refined(function, axes, levels, tolerance=0.0):
    """Halve until nothing is left to do; the cells, results at their points, and the steps."""
    cells = Cells([np.asarray(axis, float) for axis in axes], levels, {"x": tolerance})
    new, steps = cells.points(cells.places), []
    values = []
    while True:
        values.append(np.asarray(function(*new)))
        cells.know({"x": values[-1]})
        step = cells.step()
        if step is None:
            return cells, np.concatenate(values), steps
        new = cells.points(step.places)
        cells.take(step)
        steps.append(step)


def leaves(places, shape, levels):
    """Cells by recursion, halved where the middle is a point: low corner, depth and points on it."""
    there = {tuple(place): i for i, place in enumerate(places.tolist())}
    side = 2**levels

    def below(low, depth):
        width = side >> depth
        middle = tuple(a + width // 2 for a in low)
        if width > 1 and middle in there:
            for corner in itertools.product((0, width // 2), repeat=len(low)):
                yield from below(tuple(a + c for a, c in zip(low, corner, strict=True)), depth + 1)
            return
        inside = np.all((places >= low) & (places <= np.add(low, width)), axis=1)
        yield low, depth, np.flatnonzero(inside)

    for low in itertools.product(*(range(0, (n - 1) * side, side) for n in shape)):
        yield from below(low, 0)


def circle(a, b):
    """Inside a circle or not."""
    return (a * a + b * b < 0.5).astype(int)


def finger(a, b):
    """A strip that grows out of a half plane and ends between two points of the grid."""
    return ((a < 0.1) | ((np.abs(b - 0.4) < 0.11) & (a < 1.6))).astype(int)


def hair(a, b):
    """A strip so narrow that its root shows at the second level alone."""
    return ((a < 0.1) | ((np.abs(b - 0.3) < 0.06) & (a < 1.6))).astype(int)


def waves(a, b):
    """A real number without a jump."""
    return np.sin(3.0 * a) * np.cos(2.0 * b)


@pytest.mark.parametrize(
    ("function", "tolerance"), [(circle, 0.0), (finger, 0.0), (hair, 0.0), (waves, 0.2)]
)
def test_no_cell_whose_points_differ_is_left_coarse(function, tolerance):
    axes, levels = (np.linspace(-1.0, 2.0, 6), np.linspace(1.0, -1.0, 6)), 4
    cells, values, _ = refined(function, axes, levels, tolerance)
    halved = 0
    for _, depth, on in leaves(cells.places, (6, 6), levels):
        assert np.ptp(values[on]) <= tolerance or depth == levels
        halved += depth > 0
    assert halved
    # And none was halved for nothing: a point of a level lies by points that differ.
    assert len(values) < 0.3 * (5 * 2**levels + 1) ** 2


def test_a_neighbour_that_was_whole_is_halved_for_a_point_on_its_edge():
    """The finger leaves the half plane between two rows of the grid, whose points do not see it."""
    axes = np.linspace(-1.0, 2.0, 6), np.linspace(-1.0, 1.0, 6)
    cells, values, steps = refined(finger, axes, 4)
    # From the column of cells that holds the end of the half plane, one to the right each time.
    assert [step.level for step in steps] == [1, 1, 1, 1, 2, 3, 4]
    a = cells.points(cells.places)[0]
    assert a[values.astype(bool)].max() == pytest.approx(1.6, abs=0.6 / 2**4)


def test_the_number_of_points_grows_as_the_length_of_the_boundary():
    cells, _, steps = refined(circle, [np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 7)], 7)
    counts = np.bincount(cells.level)
    assert [step.level for step in steps] == sorted(step.level for step in steps)
    np.testing.assert_allclose(counts[3:] / counts[2:-1], 2.0, atol=0.1)
    # A halved cell has its middle, two new points on edges that the circle does not cross, and two that
    # it shares; there are as many as crossings of lines of the grid, twice each line in the diameter.
    for level in range(3, 8):
        crossed = 4 * np.sqrt(0.5) * 2 ** (level - 1) * (8 / 2.0 + 6 / 2.0)
        assert counts[level] == pytest.approx(4 * crossed, rel=0.05)


@pytest.mark.parametrize("direction", [1, -1])
def test_one_parameter_is_bisected(direction):
    axis = np.linspace(-2.0, 3.0, 21)[::direction]
    cells, values, steps = refined(lambda a: a > np.sqrt(2.0), [axis], 20)
    a = cells.points(cells.places)[0]
    assert len(a) == 21 + 20
    assert len(steps) == 20
    low, high = a[~values].max(), a[values].min()
    assert low <= np.sqrt(2.0) < high
    assert high - low == pytest.approx(0.25 / 2**20, rel=1e-8)


def test_all_that_differs_is_the_whole_lattice():
    chance = np.random.default_rng(18)
    shape, levels = (3, 4), 3
    cells, _, _ = refined(
        lambda a, b: chance.permutation(10_000)[: a.size], [np.arange(3.0), np.arange(4.0)], levels
    )
    assert len(cells.places) == np.prod([(n - 1) * 2**levels + 1 for n in shape])
    assert len(np.unique(cells.places, axis=0)) == len(cells.places)


@pytest.mark.parametrize("levels", [0, 3])
def test_what_does_not_differ_is_not_halved(levels):
    cells, _, steps = refined(lambda a, b: 0 * a, [np.arange(3.0), np.arange(2.0)], levels)
    assert not steps
    assert len(cells.places) == 6


def test_the_first_levels_are_those_of_fewer():
    axes = np.linspace(-1.0, 2.0, 6), np.linspace(-1.0, 1.0, 6)
    few, _, some = refined(finger, axes, 2)
    many, _, more = refined(finger, axes, 5)
    for a, b in zip(few.points(few.places), many.points(many.places), strict=True):
        np.testing.assert_array_equal(a, b[: a.size])
    assert [len(step.places) for step in some] == [len(step.places) for step in more[: len(some)]]
    assert more[len(some)].level == 3


def test_there_is_an_end_where_no_number_lies_between():
    one = 1.0
    axis = [one, np.nextafter(np.nextafter(np.nextafter(one, 2), 2), 2)]
    cells, _, _ = refined(lambda a: np.arange(a.size) + 10.0 * np.sum(a), [axis], 40)
    assert cells.points(cells.places)[0].size == 4
    huge = np.array([-1.7e308, 1.7e308])
    cells, values, _ = refined(lambda a: a > 1e300, [huge], 3)
    assert np.isfinite(cells.points(cells.places)[0]).all()
    assert len(values) == 5


NAN, INF = np.nan, np.inf


@pytest.mark.parametrize(
    ("pair", "tolerance", "differ"),
    [
        ([1.0, 1.5], 0.5, False), ([1.0, 1.5], 0.499, True), ([NAN, NAN], 0.0, False),
        ([NAN, 1.0], 1e300, True), ([INF, INF], 0.0, False), ([-INF, INF], 1e300, True),
        ([INF, 1.0], 1e300, True), ([INF, NAN], 1.0, True), ([1e308, -1e308], 1e308, True),
        (np.array([3, 4]), 0.0, True), (np.array([3, 4]), 1.0, False), (np.array([-1, 1]), 1.0, True),
        (np.array([2**63 - 1, 2**63 - 2]), 0.0, True),
        (np.array([2**63 - 1, -(2**63)]), 1e18, True),
        (np.array([0, 2**64 - 1], np.uint64), 1e18, True), (np.array([0, 255], np.uint8), 254.0, True),
        (np.array([True, False]), 0.0, True), (np.array([True, True]), 0.0, False),
        (np.array([-128, 127], np.int8), 254.0, True), (np.array([1.0, 1.5], np.float32), 0.5, False),
        ([[1.0, 2.0], [1.0, 3.0]], 0.5, True), ([[NAN, 2.0], [NAN, 2.0]], 0.0, False),
        ([[NAN, 2.0], [2.0, NAN]], 9.0, True), (np.zeros((2, 3, 0)), 0.0, False),
    ],
)  # fmt: skip
def test_what_differs(pair, tolerance, differ):
    _, _, steps = refined(
        lambda a: np.asarray(pair) if a.size == 2 else np.zeros_like(np.asarray(pair)[:1]),
        [[0.0, 1.0]], 1, tolerance,
    )  # fmt: skip
    assert bool(steps) == differ


def test_places_have_numbers_up_to_the_most_levels():
    for sizes in ([2], [2, 2], [1000, 1000], [2**40]):
        levels = most_levels(sizes)
        places = 1
        for n in sizes:
            places *= (n - 1) * 2**levels + 1
        assert places < 2**62
        assert levels == 52 or places * 2 ** len(sizes) > 2**61
