"""Motions along lines: closed forms, limits, order of the path."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from corexy_jax.elastic import AxisShapers, contour_errors, trajectory
from stickslip.control import InputShaper

A, CORNER = 3.0, 0.1


def test_one_line_is_a_trapezoid_or_a_triangle():
    path = trajectory([[0.0, 0.0], [0.3, 0.4]], 0.6, acceleration=A, corner_speed=CORNER, begin=1.0)
    assert float(path.duration) == pytest.approx(0.5 / 0.6 + 0.6 / A, rel=1e-14)
    (x, y), (vx, vy) = path(jnp.asarray(1.0 + 0.1), None)
    np.testing.assert_allclose([x, y], 0.5 * A * 0.01 * np.array([0.6, 0.8]), rtol=1e-12)
    np.testing.assert_allclose([vx, vy], A * 0.1 * np.array([0.6, 0.8]), rtol=1e-12)
    for t, place in ((0.0, 0.0), (1.0, 0.0), (1.0 + float(path.duration), 0.5), (9.0, 0.5)):
        (x, y), v = path(jnp.asarray(t), None)
        np.testing.assert_allclose([x, y], place * np.array([0.6, 0.8]), atol=1e-15)
        np.testing.assert_allclose(v, 0.0, atol=1e-14)
    short = trajectory([[0.0, 0.0], [0.03, 0.0]], 0.6, acceleration=A, corner_speed=CORNER)
    assert float(short.duration) == pytest.approx(2.0 * np.sqrt(0.03 / A), rel=1e-14)


@pytest.mark.parametrize(
    ("turn", "speed"),
    [
        (0.0, 0.6),
        (90.0, CORNER),
        (180.0, 0.0),
        (60.0, CORNER * np.sqrt((2**0.5 - 1) / (2 / 3**0.5 - 1))),
    ],
)
def test_speed_at_a_corner(turn, speed):
    """Straight on, a right angle, back, and a turn of 60°."""
    to = np.deg2rad(turn)
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0 + np.cos(to), np.sin(to)]])
    path = trajectory(points, 0.6, acceleration=A, corner_speed=CORNER)
    at = int(np.argmin(np.hypot(*(np.asarray(path.positions) - points[1]).T)))
    assert np.hypot(*path.velocities[at]) == pytest.approx(speed, rel=1e-9, abs=1e-9)
    stop = (0.6**2 - speed**2) / A
    # At full speed but for what each end and the corner take.
    expected = 2.0 * 0.6 / A + 2.0 * (0.6 - speed) / A + (2.0 - 0.6**2 / A - stop) / 0.6
    assert float(path.duration) == pytest.approx(expected, rel=1e-12)


def test_random_paths_keep_their_limits_and_are_continuous():
    rng = np.random.default_rng(0)
    points = np.cumsum(rng.normal(size=(400, 2)) * rng.choice([1e-4, 1e-2, 0.1], (400, 1)), axis=0)
    points[7] = points[6]
    limits = rng.uniform(0.05, 0.5, 399)
    path = trajectory(points, limits, acceleration=A, corner_speed=CORNER)
    times = np.asarray(path.times)
    assert np.all(np.diff(times) > 0.0)
    ends = [
        np.asarray(p) + dt * (np.asarray(v) + 0.5 * dt * np.asarray(a))
        for p, v, a, dt in zip(
            path.positions, path.velocities, path.accelerations, np.diff(times), strict=True
        )
    ]
    np.testing.assert_allclose(ends[:-1], path.positions[1:], atol=1e-13)
    np.testing.assert_allclose(ends[-1], points[-1], atol=1e-13)
    assert np.max(np.hypot(*np.asarray(path.accelerations).T)) <= A * (1 + 1e-12)
    after = np.asarray(path.velocities) + np.diff(times)[:, None] * np.asarray(path.accelerations)
    jumps = np.hypot(*(np.asarray(path.velocities)[1:] - after[:-1]).T)
    assert np.max(jumps) < 2.0 * CORNER  # of a path that turns back at less than the corner speed
    for point in points:
        assert np.min(np.hypot(*(np.vstack([path.positions, points[-1:]]) - point).T)) < 1e-13
    slope = jax.jit(jax.vmap(jax.jacfwd(lambda t: jnp.stack(path(t, None)[0]))))
    middle = jnp.asarray(0.5 * (times[1:] + times[:-1]))
    speeds = np.stack(jax.vmap(lambda t: path(t, None)[1])(middle), axis=1)
    np.testing.assert_allclose(slope(middle), speeds, atol=1e-12)


def test_a_shaped_path_has_a_break_for_each_part():
    path = trajectory([[0.0, 0.0], [0.3, 0.4]], 0.6, acceleration=A, corner_speed=CORNER)
    shaped = InputShaper(path, "EI", 300.0, 0.05)
    assert path.breaks(shaped).shape == (12,)
    (x, y), _ = shaped(jnp.asarray(float(path.breaks(shaped)[-1])), None)
    np.testing.assert_allclose([x, y], [0.3, 0.4], rtol=1e-14)


def test_each_axis_has_its_shaper_and_equal_breaks_are_allowed():
    """Half a period is the time of a piece: parts of the one meet parts of the other."""
    path = trajectory([[0.0, 0.0], [0.03, 0.0]], 0.6, acceleration=A, corner_speed=CORNER)
    omega = np.pi / float(path.times[1])
    x, y = InputShaper(path, "ZV", omega), InputShaper(path, "MZV", 2.0 * omega)
    both, t = AxisShapers(x, y), jnp.asarray(0.013)
    place, speed = both(t, None)
    np.testing.assert_allclose(place, [x(t, None)[0][0], y(t, None)[0][1]], rtol=0)
    np.testing.assert_allclose(speed, [x(t, None)[1][0], y(t, None)[1][1]], rtol=0)
    breaks = path.breaks(both)
    assert breaks.shape == (15,)
    assert np.min(np.diff(breaks)) == 0.0
    slope = jax.vmap(jax.jacfwd(lambda t: jnp.stack(both(t, None)[1])))
    inside = jnp.linspace(0.0, float(breaks[-1]), 4001)[1:-1]
    rates = np.asarray(jax.jit(slope)(inside))
    # Accelerations change at breaks only.
    piece = np.searchsorted(np.asarray(breaks), np.asarray(inside), side="right")
    same = piece[1:] == piece[:-1]
    jumps = np.abs(np.diff(rates, axis=0))
    assert np.max(jumps[same]) < 1e-12 < np.max(jumps)


def test_wrong_arguments_are_named():
    rules = {"acceleration": A, "corner_speed": CORNER}
    for given, words in (
        (([[0.0, 0.0]], 1.0), r"points = .*at least two"),
        (([[0.0, 0.0], [0.0, 0.0]], 1.0), r"points = .*different"),
        (([[0.0, 0.0], [0.0, 1.0]], [1.0, 2.0]), r"speeds = "),
        (([[0.0, 0.0], [0.0, 1.0]], -1.0), r"speeds = -1"),
    ):
        with pytest.raises(ValueError, match=words):
            trajectory(*given, **rules)


def test_contour_errors_are_distances_from_the_lines():
    """Beside a line, beyond its end, in a corner; being late is none."""
    points = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
    x, y = np.array([0.5, -0.3, 0.9, 1.3, 0.25]), np.array([0.2, 0.4, 0.3, 1.4, 0.0])
    np.testing.assert_allclose(contour_errors(points, x, y), [0.2, 0.5, 0.1, 0.5, 0.0], atol=1e-15)
    path = trajectory(points, 0.6, acceleration=A, corner_speed=CORNER)
    times = jnp.linspace(0.0, float(path.duration), 3001)
    (x, y), _ = jax.jit(jax.vmap(lambda t: path(t, None)))(times)
    assert np.max(contour_errors(points, x, y)) < 1e-15
    with pytest.raises(ValueError, match=r"y = .*as x"):
        contour_errors(points, x, y[:-1])


def test_lines_of_another_time_do_not_count():
    """A zigzag whose lines lie closer than the head is off."""
    points = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.1], [0.0, 0.1], [0.0, 0.2], [1.0, 0.2]]
    x, y, lines = [0.5, 0.5], [0.14, 0.14], [4, 0]
    np.testing.assert_allclose(contour_errors(points, x, y), 0.04, atol=1e-15)
    np.testing.assert_allclose(contour_errors(points, x, y, lines, 1), [0.06, 0.14], atol=1e-15)
    for wrong in ([0, 5], [-1, 0], [0.5, 0]):
        with pytest.raises(ValueError, match=r"lines = .*from 0 to 4"):
            contour_errors(points, x, y, wrong)


def test_the_way_is_the_integral_of_the_speed():
    points = np.array([[0.0, 0.0], [0.2, 0.1], [0.1, 0.1], [0.1, 0.3]])
    path = trajectory(points, 0.4, acceleration=A, corner_speed=CORNER, begin=0.5)
    times = jnp.linspace(0.4, 0.6 + float(path.duration), 20_001)
    speed = np.hypot(*jax.jit(jax.vmap(lambda t: jnp.stack(path(t, None)[1])))(times).T)
    steps = np.diff(times) * 0.5 * (speed[1:] + speed[:-1])
    way = np.asarray(jax.jit(lambda t: path.travelled(t))(times))
    # At a corner the speed jumps within a step of this sum.
    np.testing.assert_allclose(way[1:], np.cumsum(steps), atol=3.0 * 0.4 * float(times[1] - times[0]))
    ends = np.sum(np.hypot(*np.diff(points, axis=0).T))
    assert way[-1] == pytest.approx(ends, rel=1e-14)
