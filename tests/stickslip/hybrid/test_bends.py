"""Forces that bend or jump in the state: slopes through them, and what is said where there is none."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb, Stribeck
from stickslip.hybrid import _sided, _simulate
from stickslip.hybrid.status import BENT, GRAZING
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import Motion

GAP = 0.02
PRECISE = ss.Integrator(step=ss.AdaptiveStep(1e-12, 1e-12))


class Soft(ss.AbstractSmoothSystem):
    """A mass on a spring, a soft stop at `GAP` and a constant load."""

    stiffness: Any
    load: Any = 0.0

    def vector_field(self, t, y, mode, args):
        stop = self.stiffness * ss.positive_part(y.x - GAP)
        return Motion(x=y.v, v=self.load - y.x - stop)


def closed_form(x, v, k, t1):
    """x(t1) of `Soft` without load and its slope by x(0): at the bend the pieces' matrices multiply."""
    t, slope, inside = 0.0, np.eye(2), x > GAP
    while True:
        w, c = (np.sqrt(1 + k), k * GAP / (1 + k)) if inside else (1.0, 0.0)

        def matrix(u, w=w):
            return np.array([[np.cos(w * u), np.sin(w * u) / w], [-w * np.sin(w * u), np.cos(w * u)]])

        # The bend is met where amplitude * cos(w u - phase) = GAP - c.
        amplitude, phase = np.hypot(x - c, v / w), np.arctan2(v / w, x - c)
        turn = np.arccos((GAP - c) / amplitude)
        found = (np.array([turn, -turn]) + phase) / w % (2 * np.pi / w)
        # A time of zero is where it comes from.
        u = min(a for a in found if a > 1e-9 / w)
        if t + u > t1:
            end = matrix(t1 - t)
            return c + (end @ [x - c, v])[0], (end @ slope)[0, 0]
        _, v = matrix(u) @ [x - c, v]
        t, x, slope, inside = t + u, GAP, matrix(u) @ slope, not inside


def of_soft(x, k):
    run = ss.simulate(Soft(k), 0.0, 10.0, Motion(x=x, v=jnp.zeros(())), saveat=ss.SaveAt(max_events=0))
    return run.y1.x, (run.y1.x, run.flags)


STARTS = np.array([-1.0, -0.3, -0.5, -0.1])
STIFF = np.array([1.0, 15.0, 1e3, 1e5])


@pytest.mark.more
@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.grad])
def test_slopes_through_a_soft_stop_are_those_of_the_closed_form(derivative):
    # The last comes to the stop without a speed, and leaves it: a bend that is only touched is no bend.
    x, k = np.append(STARTS, -GAP), np.append(STIFF, 1e3)
    slopes, (ends, flags) = jax.jit(jax.vmap(derivative(of_soft, has_aux=True)))(x, k)
    found = [closed_form(a, 0.0, b, 10.0) for a, b in zip(STARTS, STIFF, strict=True)]
    found.append((-GAP * np.cos(10.0), np.cos(10.0)))
    np.testing.assert_allclose(ends, [end for end, _ in found], atol=2e-8)
    np.testing.assert_allclose(slopes, [slope for _, slope in found], rtol=1e-6)
    assert not np.any(flags)


def test_without_sides_a_step_over_a_bend_has_a_wrong_slope(monkeypatch):
    """The fault this file is about, planted."""
    monkeypatch.setattr(_simulate, "system_with_sides", lambda *given: (None, False))
    slope, _ = jax.jit(jax.jacfwd(of_soft, has_aux=True))(jnp.asarray(-0.3), jnp.asarray(1e5))
    assert abs(slope / closed_form(-0.3, 0.0, 1e5, 10.0)[1] - 1.0) > 2e-4


class Valley(ss.AbstractSmoothSystem):
    """A pull of -|x|: a spring above zero, and below it one that pushes away."""

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-jnp.abs(y.x))


def test_the_corner_of_an_absolute_value_is_met_in_long_steps():
    """x = a cos t, and from pi / 2 on x = -a sinh(t - pi / 2); a step across it is 1e-2 off."""
    long = ss.Integrator(step=ss.FixedStep(0.25))

    def end(a):
        run = ss.simulate(Valley(), 0.0, 3.0, Motion(a, 0.0 * a), integrator=long)
        return run.y1.x, (run.y1.x, run.flags)

    slope, (x, flags) = jax.jit(jax.jacfwd(end, has_aux=True))(jnp.asarray(0.7))
    exact = -np.sinh(3.0 - np.pi / 2)
    np.testing.assert_allclose([slope, x], [exact, 0.7 * exact], rtol=1e-10)
    assert int(flags) == 0


class Rectified(ss.AbstractSmoothSystem):
    """`Soft` by functions of JAX that have derivatives of their own."""

    stiffness: Any

    def vector_field(self, t, y, mode, args):
        smooth = 0.1 * jnp.logaddexp(y.x, y.v)  # compares its arguments, and has no bend
        return Motion(x=y.v, v=-y.x - self.stiffness * jax.nn.relu(y.x - GAP) - smooth)


@pytest.mark.more
def test_rules_of_their_own_hide_no_bend():
    def end(x):
        run = ss.simulate(Rectified(1e4), 0.0, 3.0, Motion(x, 0.0 * x), integrator=PRECISE)
        return run.y1.x, run.flags

    x, h = 0.5, 1e-5
    slope, flags = jax.jit(jax.jacfwd(end, has_aux=True))(x)
    ends, _ = jax.jit(jax.vmap(end))(jnp.array([x - h, x + h]))
    np.testing.assert_allclose(slope, (ends[1] - ends[0]) / (2 * h), rtol=1e-6)
    assert int(flags) == 0
    rectified = Rectified(1e4)
    start = jax.tree.map(jnp.asarray, Motion(x, 0.0))
    found, left = _sided.system_with_sides(
        rectified, jnp.zeros(()), start, jnp.zeros((), jnp.int32), None
    )
    assert len(found.changes) == 1
    assert not left


class Between(ss.AbstractSmoothSystem):
    """A mass at 1 m between two strings with a preload, each written down twice."""

    damping: Any = 0.0

    def pulls(self, x):
        return ss.positive_part(20.0 - 7e4 * x), ss.positive_part(20.0 + 3e4 * x)

    def vector_field(self, t, y, mode, args):
        right, left = self.pulls(y.x - 1.0 + self.damping * y.v)
        again = self.pulls(y.x - 1.0)
        return Motion(x=y.v, v=right - left + 1e-6 * (again[0] ** 2 - again[1] ** 2))

    def energy(self, y):
        parts = zip(self.pulls(y.x - 1.0), (7e4, 3e4), strict=True)
        return 0.5 * y.v**2 + sum((0.5 * f**2 + 1e-6 / 3.0 * f**3) / k for f, k in parts)


def test_two_bends_at_one_place_are_passed_together():
    """The hop from one to the other is lost in the rounding of the state: neither is met again."""
    system, most = Between(), ss.Integrator("dop853", ss.AdaptiveStep(1e-11, 1e-13), max_steps=20_000)
    v = np.random.default_rng(0).uniform(-0.4, 0.4, 20)

    @jax.jit
    @jax.vmap
    def ends(v):
        run = ss.simulate(system, 0.0, 0.5, Motion(1.0, v), integrator=most, throw=False)
        return run.result == ss.RESULTS.successful, run.y1

    good, end = ends(v)
    assert np.all(good)
    np.testing.assert_allclose(jax.vmap(system.energy)(end), system.energy(Motion(1.0, v)), rtol=1e-9)


class Cliff(ss.AbstractSmoothSystem):
    """A constant pull that is another one below zero."""

    above: Any
    below: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=jnp.where(y.x > 0.0, self.above, self.below))


@pytest.mark.more
def test_slopes_through_a_force_that_jumps_in_the_state():
    def end(height, above, below):
        run = ss.simulate(Cliff(above, below), 0.0, 3.0, Motion(height, 0.0 * height), throw=False)
        return run.y1.x, (run.y1.x, run.flags, run.num_events)

    height, above, below = 0.7, -1.0, -3.0
    slope, (x, flags, events) = jax.jit(jax.jacrev(end, has_aux=True))(height, above, below)
    falls = np.sqrt(2 * height / -above)
    left, rate, speed = 3.0 - falls, 1.0 / (-above * falls), above * falls
    np.testing.assert_allclose(x, speed * left + 0.5 * below * left**2, rtol=1e-10)
    exact = above * rate * left - speed * rate - below * left * rate
    np.testing.assert_allclose(slope, exact, rtol=1e-9)
    assert int(flags) == 0
    assert int(events) == 0


class Rubbed(ss.AbstractSmoothSystem):
    """Friction as the sign of the speed, which is no friction at rest; the load is not."""

    load: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=self.load - jnp.sign(y.v))


@pytest.mark.more
def test_what_attracts_from_both_sides_chatters_and_says_so():
    def run(load, v):
        return ss.simulate(Rubbed(load), 0.0, 3.0, Motion(0.0 * v, v), throw=False)

    runs = jax.jit(jax.vmap(run))(jnp.array([0.5, 2.0, 0.0]), jnp.array([1.0, -1.0, 0.0]))
    # The second goes on to the other side; the third is exactly at rest, without a load.
    np.testing.assert_array_equal(runs.result == ss.RESULTS.chattering, [True, False, False])
    np.testing.assert_allclose(runs.t1[0], 2.0, rtol=1e-9)
    np.testing.assert_allclose(runs.y1.v, [0.0, 3.0 - 1.0 / 3.0, 0.0], atol=1e-9)


class Wheels(AbstractMechanism):
    """Two wheels with play between them, one of them braked; a table and a loop as further loads."""

    gap: Any
    law: Any
    coordinates: ClassVar = {"a": "rad", "b": "rad"}
    contact_directions: ClassVar = {"brake": {"b": 1.0}}

    def mass_matrix(self, q):
        return {"a": 1.0, "b": 2.0}

    def forces(self, t, q, v, args):
        teeth = 50.0 * ss.backlash(q.a - q.b, self.gap)
        table = jnp.interp(q.a, jnp.array([-0.5, 0.0, 0.4]), jnp.array([-2.0, 0.0, 0.9]))
        return {"a": -teeth - table + 0.5 * jnp.cos(t), "b": teeth}

    def contacts(self, t, q, v, args):
        return {"brake": Contact(self.law, 0.3)}


@pytest.mark.more
def test_a_gear_with_play_a_table_and_a_brake():
    """Slopes by differences of runs; the log has the brake's events alone."""

    def end(gap):
        wheels = Wheels(gap, Coulomb(1.0, 0.8))
        run = ss.simulate(
            wheels, 0.0, 6.0, wheels.state(a=0.3, v_a=1.0), saveat=ss.SaveAt(max_events=32)
        )
        return run.y1.b, (run.y1.b, run.flags, run.num_events, run.events.guard, run.mode1)

    gap, h = 0.1, 1e-5
    runs = jax.jit(jax.vmap(jax.jacfwd(end, has_aux=True)))(jnp.array([gap, gap - h, gap + h]))
    slopes, (ends, flags, events, guards, modes) = runs
    np.testing.assert_allclose(slopes[0], (ends[2] - ends[1]) / (2 * h), rtol=1e-5)
    assert not np.any(flags)
    assert 0 < int(events[0]) < 32
    assert int(np.max(guards)) == 0
    assert int(modes[0]) in range(3)


class Height(NamedTuple):
    x: Any


class Looped(ss.AbstractSmoothSystem):
    """Twenty springs one after the other in a loop, which is too long to be looked into."""

    load: Any
    declares: bool

    def vector_field(self, t, y, mode, args):
        def add(i, force):
            return force + jnp.maximum(y.x - 0.5 * i.astype(jnp.float64), 0.0)

        return Height(x=self.load - jax.lax.fori_loop(0, 20, add, jnp.zeros(())))

    def switches(self, t, y, mode, args):
        return (y.x, y.x - 0.5) if self.declares else ()


class Kicked(ss.AbstractSmoothSystem):
    """A spring with a pull that jumps at `-place`."""

    place: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-3.0 * y.x - jnp.where(y.x < -self.place, -2.0, 4.0))


def test_a_border_that_is_met_to_the_last_digit_still_moves():
    """Of 58 runs with up to four crossings each, some end a step where the two sides are equal."""

    def end(place, t1):
        run = ss.simulate(Kicked(place), 0.0, t1, Motion(0.7, 0.0), integrator=PRECISE)
        return run.y1.x, (run.y1.x, run.flags)

    h, t1 = 1e-5, np.arange(0.3, 6.05, 0.1)
    found = jax.jit(jax.vmap(jax.jacfwd(end, has_aux=True)))
    slopes, (ends, flags) = found(np.repeat(0.5 + h * np.arange(-1, 2), 58), np.tile(t1, 3))
    low, _, high = ends.reshape(3, 58)
    np.testing.assert_allclose(slopes.reshape(3, 58)[1], (high - low) / (2 * h), atol=1e-6)
    assert not np.any(flags)


@pytest.mark.more
def test_what_is_not_seen_is_flagged_and_can_be_declared():
    def end(load, declares):
        run = ss.simulate(Looped(load, declares), 0.0, 2.0, Height(-0.25))
        return run.y1.x, run.flags

    (slope, flags), (_, bent) = (
        jax.jacfwd(end, has_aux=True)(jnp.asarray(1.0), d) for d in (True, False)
    )
    # x rises to 0 in 1/4 s, then x' = load - x, to 1/2 at ln 2 later, then x' = load + 1/2 - 2 x.
    a, h = 1.0, 1e-6

    def exact(a):
        first, second = 0.25 / a, np.log(a / (a - 0.5))
        left, rest = 2.0 - first - second, (a + 0.5) / 2.0
        return rest + (0.5 - rest) * np.exp(-2.0 * left)

    np.testing.assert_allclose(slope, (exact(a + h) - exact(a - h)) / (2 * h), rtol=1e-8)
    assert int(flags) == 0
    assert int(bent) & BENT


class Place(NamedTuple):
    x: Any
    y: Any


class Ratio(ss.AbstractSmoothSystem):
    """A border in a ratio that `y` hardly changes, and a rate that it does."""

    def vector_field(self, t, y, mode, args):
        return Place(1.0, y.y)

    def switches(self, t, y, mode, args):
        return (y.x / (1.0 + y.y**2),)


def test_a_state_beyond_a_declared_border_stays_where_it_is_but_for_that():
    """At x = 0.001 the ratio could be made 0 by y = 80 for 160: motions were off by 1e-7 of it."""
    y = Place(jnp.asarray(1e-3), jnp.asarray(160.0))
    sided, _ = _sided.system_with_sides(Ratio(), 0.0, y, jnp.zeros((), jnp.int32), None)
    assert sided is not None
    below = sided.with_sides(0.0, Place(-y.x, y.y), jnp.zeros((), jnp.int32), None)
    np.testing.assert_allclose(sided.vector_field(0.0, y, below, None).y, 160.0, rtol=1e-3)


def test_a_rest_on_a_bend_has_no_slope_and_says_so():
    run = ss.simulate(Soft(3.0, GAP), 0.0, 10.0, Motion(GAP, 0.0))
    assert int(run.flags) & GRAZING


def test_systems_with_friction_laws_have_no_sides():
    class Block(AbstractMechanism):
        law: Any
        coordinates: ClassVar = {"x": "m"}
        contact_directions: ClassVar = {"belt": {"x": 1.0}}

        def mass_matrix(self, q):
            return {"x": 1.0}

        def forces(self, t, q, v, args):
            return {"x": jnp.where(t > 1.0, 1.0, 0.0) - q.x}

        def contacts(self, t, q, v, args):
            return {"belt": Contact(self.law, surface_speed=0.2)}

    block = Block(Stribeck(1.0, 0.5, 0.1, 1))
    broken = ss.WithBreaks(block, jnp.array([1.0]))
    start = block.state(v_x=0.2)
    zero, mode = jnp.zeros(()), jnp.zeros((), jnp.int32)
    forms = (block, start), (block.regularised(1e-3), start), (broken, broken.start(start))
    for system, y in forms:
        y = jax.tree.map(jnp.asarray, y)
        assert _sided.system_with_sides(system, zero, y, mode, None) == (None, False)


def test_helpers_are_plain_functions():
    x = jnp.array([-2.0, -0.5, 0.5, 2.0])
    np.testing.assert_array_equal(ss.positive_part(x), [0, 0, 0.5, 2])
    np.testing.assert_array_equal(ss.absolute(x), [2, 0.5, 0.5, 2])
    np.testing.assert_array_equal(ss.saturate(x, -1, 1.5), [-1, -0.5, 0.5, 1.5])
    np.testing.assert_array_equal(ss.backlash(x, 2.0), [-1, 0, 0, 1])
    np.testing.assert_array_equal(jax.vmap(jax.grad(ss.dead_band), (0, None))(x, 2.0), [1, 0, 0, 1])
    with pytest.raises(ValueError, match="gap"):
        ss.backlash(0.0, -1.0)
    with pytest.raises(ValueError, match="high"):
        ss.saturate(0.0, 1.0, 0.0)
    with pytest.raises(TypeError, match="x"):
        ss.absolute("1")
