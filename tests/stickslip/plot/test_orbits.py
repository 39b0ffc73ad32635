"""Pictures of periodic orbits and their branches: what is drawn, read back from the axes."""

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest

import stickslip as ss
from stickslip import plot
from stickslip.continuation import Branch, BranchPoint, OrbitGuess, periodic_orbit
from stickslip.plot import _axes
from tests.stickslip.continuation._systems import Motion, WeakeningBlock, closed_branch

PERIOD = 2 * np.pi


class State(NamedTuple):
    z: Any


class Ring(ss.AbstractSmoothSystem):
    r"""$\dot r = r(1 + a - r^2)$, $\dot\theta = 1$: a cycle of radius $\sqrt{1 + a}$."""

    a: Any
    units: ClassVar = {"z": "m"}
    parameter_units: ClassVar = {"a": "N"}

    def vector_field(self, t, y, mode, args):
        grow = 1.0 + self.a - jnp.sum(y.z**2)
        return State(grow * y.z + jnp.stack([-y.z[1], y.z[0]]))


class Level(NamedTuple):
    u: Any


class Tank(ss.AbstractSmoothSystem):
    r"""$\dot u = f\cos t - u$: $u = f(\cos t + \sin t)/2$."""

    strength: Any
    units: ClassVar = {"u": "m"}

    def time_scale(self, args):
        return 1.0

    def vector_field(self, t, y, mode, args):
        return Level(args * self.strength * jnp.cos(t) - y.u)


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def branch_of(parameter, values, systems, guesses, **options):
    """A branch from orbits that are looked for one by one, which compiles less than following them."""
    found = [periodic_orbit(s, g, **options) for s, g in zip(systems, guesses, strict=True)]
    orbits = jax.tree.map(lambda *leaves: np.stack(leaves), *found)
    end = BranchPoint(
        "EP", np.array(values[-1:]), found[-1], "", len(values) - 1, np.zeros(4), systems[-1]
    )
    return Branch((parameter,), np.asarray(values), orbits, ((),) * len(values), (end,), systems[0])


@pytest.fixture(scope="module")
def ring():
    values = (-0.2, 0.0, 0.5)
    guesses = [OrbitGuess(State(np.array([1.0, 0.0])), PERIOD)] * 3
    return branch_of("a", values, [Ring(a) for a in values], guesses)


@pytest.fixture(scope="module")
def tank():
    values, guess = (0.5, 1.0, 2.0), OrbitGuess(Level(0.5), PERIOD)
    return branch_of("strength", values, [Tank(f) for f in values], [guess] * 3, forced=True, args=1.0)


@pytest.fixture(scope="module")
def block():
    values, guess = (0.2, 0.21), OrbitGuess(Motion(1.135, 0.0), 12.0, 1)
    return branch_of("belt_speed", values, [WeakeningBlock(v, 0.0) for v in values], [guess] * 2)


def one(branch, k):
    return jax.tree.map(lambda leaf: leaf[k], branch.orbits)


def with_multipliers(orbit, rows):
    """The same orbit with other multipliers; a batch of it for a table of them."""
    rows = np.asarray(rows, complex)
    batch = jax.tree.map(lambda a: np.broadcast_to(a, rows.shape[:-1] + np.shape(a)), orbit)
    return eqx.tree_at(lambda o: o.multipliers, batch, rows)


def marked(branch, multipliers, specials):
    """A branch with given multipliers, and special points of given labels and multipliers."""
    orbit = one(branch, 0)
    points = tuple(
        BranchPoint(label, np.zeros(1), with_multipliers(orbit, row), "", 0, np.zeros(4), branch.system)
        for label, row in specials
    )
    orbits = with_multipliers(orbit, multipliers)
    return eqx.tree_at(lambda b: (b.orbits, b.specials), branch, (orbits, points), is_leaf=None)


def points(line):
    return np.sort_complex(np.asarray(line.get_xdata()) + 1j * np.asarray(line.get_ydata()))


def named(axis):
    return {line.get_label(): line for line in axis.lines if line.get_label()[0] != "_"}


def circle_of(axis):
    (circle,) = axis.patches
    assert circle.center == (0.0, 0.0)
    return circle.get_radius()


def beyond(axis):
    return [line for line in axis.lines if line.get_label() == "_beyond"]


@pytest.mark.more
def test_multipliers_of_one_orbit(tank):
    orbit = one(tank, 0)
    axis = plot.multipliers(orbit)
    assert circle_of(axis) == 1.0
    (line,) = named(axis).values()
    np.testing.assert_allclose(points(line), [np.exp(-PERIOD)], atol=1e-9)
    assert line.get_color() == _axes.BLUE
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("real part", "imaginary part")
    assert axis.get_aspect() == 1.0
    assert 1.0 < axis.get_xlim()[1] < 1.5
    assert axis.get_ylim() == axis.get_xlim()
    assert not axis.texts


@pytest.mark.more
def test_multipliers_of_a_batch_tell_stable_from_unstable(tank):
    table = [[[0.5, 0.0], [0.3 + 0.4j, 0.3 - 0.4j]], [[-1.5, 0.2], [np.nan, np.nan]]]
    axis = plot.multipliers(with_multipliers(one(tank, 0), table), ms=3.0, c="k")
    lines = named(axis)
    np.testing.assert_array_equal(points(lines["stable"]), [0, 0.3 - 0.4j, 0.3 + 0.4j, 0.5])
    np.testing.assert_array_equal(points(lines["unstable"]), [-1.5, 0.2])
    assert {line.get_color() for line in lines.values()} == {"k"}
    assert lines["stable"].get_markersize() == 3.0


@pytest.mark.more
def test_large_multipliers_do_not_hide_the_circle(tank):
    orbits = with_multipliers(one(tank, 0), [[1e5, 0.5], [3e4, -2.0], [1.0 - 1e3j, 1.0 + 1e3j]])
    axis = plot.multipliers(orbits)
    reach = axis.get_xlim()[1]
    assert reach < 3.0
    assert circle_of(axis) == 1.0
    np.testing.assert_array_equal(points(named(axis)["unstable"]), [-2.0, 0.5])
    # One triangle for each direction, at the edge.
    assert sorted(np.angle(points(line)[0], deg=True) for line in beyond(axis)) == [-90.0, 0.0, 90.0]
    assert all(2.0 < np.abs(points(line)[0]) < reach for line in beyond(axis))
    (note,) = axis.texts
    assert note.get_text() == "4 of 6 multipliers beyond, the largest of size 1e+05"
    # More into the same axes: one circle, and the view stays as wide as it was.
    plot.multipliers(with_multipliers(one(tank, 0), [0.5, 5.0]), ax=axis)
    assert circle_of(axis) == 1.0
    assert axis.get_xlim()[1] == reach
    heights = [text.get_position()[1] for text in axis.texts]
    assert len(set(heights)) == 2


@pytest.mark.more
def test_multipliers_of_a_branch_mark_its_special_points(tank):
    specials = [("EP", [7.0, 7.0]), ("PD", [-1.0, 0.1]), ("LP", [1.0, 0.3]), ("PD", [-1.0, 1e4])]
    branch = marked(tank, [[0.5, 0.2], [-1.1, 0.1]], specials)
    lines = named(axis := plot.multipliers(branch))
    assert set(lines) == {"stable", "unstable", "PD", "LP"}
    edge = points(lines["PD"])[-1].real
    assert 2.0 < edge < axis.get_xlim()[1]
    np.testing.assert_array_equal(points(lines["PD"]), [-1.0, -1.0, 0.1, edge])
    np.testing.assert_array_equal(points(lines["LP"]), [0.3, 1.0])
    assert (lines["PD"].get_marker(), lines["LP"].get_marker()) == ("D", "s")
    assert [lines[k].get_color() for k in ("stable", "unstable")] == [_axes.BLUE, _axes.RED]
    assert axis.texts[0].get_text().startswith("1 of 10 multipliers beyond")


@pytest.mark.more
def test_the_trivial_multiplier_is_not_drawn(ring):
    (line,) = named(plot.multipliers(ring)).values()
    np.testing.assert_allclose(
        points(line).real, np.sort(np.exp(-2 * PERIOD * (1 + ring.values))), atol=1e-8
    )


@pytest.mark.more
def test_no_multipliers(tank):
    orbit = one(tank, 0)
    for rows in ([np.nan], []):
        with pytest.raises(ValueError, match=r"orbits = PeriodicOrbit, .* nothing to draw: it must be"):
            plot.multipliers(with_multipliers(orbit, rows))
    with pytest.raises(TypeError, match="orbits = 3: it must be a PeriodicOrbit or a Branch"):
        plot.multipliers(3)
    with pytest.raises(TypeError, match="colour = 'k': it must be left out"):
        plot.multipliers(orbit, colour="k")
    with pytest.raises(TypeError, match="orbits = PeriodicOrbit: it must be known"):
        eqx.filter_jit(plot.multipliers)(jax.tree.map(jnp.asarray, orbit))


def closed(line, orbit, names=("x", "v")):
    """That a curve is closed, and as large as its orbit."""
    for values, name in zip(line.get_data(), names, strict=True):
        assert values[0] == pytest.approx(values[-1], abs=1e-7)
        high, low = getattr(orbit.highest, name), getattr(orbit.lowest, name)
        assert values.max() == pytest.approx(float(high), abs=1e-4)
        assert values.min() == pytest.approx(float(low), abs=1e-4)


@pytest.mark.more
def test_orbit_with_sticks(block):
    axis = plot.orbit(block, 1)
    curve, stick = axis.lines
    orbit = one(block, 1)
    closed(curve, orbit)
    across, along = stick.get_data()
    shown = np.isfinite(across)
    np.testing.assert_allclose(along[shown], block.values[1], atol=1e-12)
    events = dict(zip(np.asarray(orbit.events.mode_after)[:2], orbit.events.y_before.x, strict=False))
    # From the stop, after which it sticks, to the release.
    np.testing.assert_allclose(
        [across[shown].min(), across[shown].max()], [events[0], events[1]], atol=1e-6
    )
    assert stick.get_linewidth() > curve.get_linewidth()
    assert stick.get_zorder() < curve.get_zorder()
    assert axis.get_title() == (
        f"orbit 1 at belt_speed = {block.values[1]:.6g}, period {float(orbit.period):.6g} s"
    )
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("x [m]", "v [m/s]")


@pytest.mark.more
def test_orbit_at_a_special_point(block):
    special = block.specials[-1]
    _, axis = plt.subplots()
    found = plot.orbit(block, special, "v", "x", ax=axis, color="k")
    assert found is axis
    assert axis.lines[0].get_color() == "k"
    closed(axis.lines[0], special.orbit, ("v", "x"))
    assert axis.get_title().startswith(f"EP at belt_speed = {special.value:.6g}, period ")


@pytest.mark.more
def test_orbit_of_an_array(ring):
    axis = plot.orbit(ring, -1)
    (curve,) = axis.lines
    radius = np.sqrt(1 + ring.values[-1])
    np.testing.assert_allclose(np.hypot(*curve.get_data()), radius, atol=1e-8)
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("z[0] [m]", "z[1] [m]")
    assert axis.get_title() == f"orbit {len(ring) - 1} at a = {ring.values[-1]:.6g} N, period 6.28319 s"


def test_orbit_of_one_component_is_drawn_over_time(tank):
    axis = plot.orbit(tank, 2, args=1.0)
    curve = axis.lines[0]
    time, values = curve.get_data()
    exact = 0.5 * tank.values[2] * (np.cos(time) + np.sin(time))
    np.testing.assert_allclose(values, exact, atol=1e-8)
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("t [s]", "u [m]")
    assert time[-1] - time[0] == pytest.approx(PERIOD)
    assert (plot.orbit(tank, 2, args=1.0, y="slope of u").get_xlabel()) == "u [m]"


@pytest.mark.more
def test_wrong_arguments_of_an_orbit(ring, block):
    size = len(ring)
    for at, kind, text in (
        (
            size,
            ValueError,
            rf"at = {size}: it must be the number of an orbit, from -{size} to {size - 1}",
        ),
        (
            "PD",
            TypeError,
            r"at = 'PD': it must be .* or one of branch.specials \(here of branch\['EP'\]",
        ),
        (block.specials[0], ValueError, "at = BranchPoint, of another branch: it must be"),
    ):
        with pytest.raises(kind, match=text):
            plot.orbit(ring, at)
    with pytest.raises(ValueError, match=r"x = 'w': it must be .*z\[0\]"):
        plot.orbit(ring, 0, "w")
    with pytest.raises(ValueError, match=r"y = 'z': it must be a single number, one of z\[0\], z\[1\]"):
        plot.orbit(ring, 0, y="z")


@pytest.mark.more
def test_numbers_of_arrays_over_the_parameter(ring):
    axis = plot.branch(ring, "z[1]", lowest=True)
    high, low = axis.lines
    radius = np.sqrt(1 + ring.values)
    np.testing.assert_allclose(high.get_ydata(), radius, atol=1e-5)
    np.testing.assert_allclose(low.get_ydata(), -radius, atol=1e-5)
    assert axis.get_ylabel() == "greatest z[1] [m]"
    assert axis.get_xlabel() == "a [N]"
    assert plot.branch(ring).get_ylabel() == "greatest z[0] [m]"
    assert plot.branch(ring, "period").get_ylabel() == "period [s]"
    for name, text in (
        ("z", r"'z': it must be a single number, one of z\[0\], z\[1\]"),
        ("z[2]", r"'z\[2\]': it must be one of z\[0\] to z\[1\], period"),
        (1, "1: it must be one of"),
    ):
        with pytest.raises(ValueError, match=f"observable = {text}"):
            plot.branch(ring, name)


@pytest.mark.more
def test_a_branch_and_its_special_points(block):
    flip = BranchPoint("PD", np.array([0.22]), one(block, 0), "", 0, np.zeros(4), block.system)
    axis = plot.branch(eqx.tree_at(lambda b: b.specials, block, (flip,), is_leaf=None), "x")
    line, mark = axis.lines
    np.testing.assert_array_equal(line.get_data(), [block.values, block.orbits.highest.x])
    assert (mark.get_marker(), axis.texts[0].get_text()) == ("D", "PD")
    assert (line.get_color(), line.get_linestyle()) == (_axes.BLUE, "-")


@pytest.mark.slow
def test_a_branch_that_was_followed():
    branch = closed_branch()
    lines = named(axis := plot.multipliers(branch))
    assert set(lines) == {"stable", "unstable", *(p.label for p in branch.specials)} - {"EP"}
    assert np.min(np.abs(points(lines["PD"]) + 1.0)) < 1e-6
    assert np.min(np.abs(points(lines["LP"]) - 1.0)) < 1e-4
    np.testing.assert_allclose(np.abs(points(lines["NS"])), 1.0, atol=1e-6)
    shown = sum(points(lines[k]).size for k in ("stable", "unstable"))
    largest = np.abs(np.asarray(branch.orbits.multipliers))
    assert shown == np.sum(largest <= 2.5)
    assert axis.texts
    (flip,) = branch["PD"]
    axis = plot.orbit(branch, flip)
    closed(axis.lines[0], flip.orbit)
    assert axis.get_title() == f"PD at frequency = {flip.value:.6g}, period {flip.orbit.period:.6g} s"
