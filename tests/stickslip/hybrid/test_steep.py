"""Forms that have no slope at a border, or no value beyond it, in fields that do: at rest, at zero."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.hybrid import _bends
from stickslip.hybrid.status import BENT
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import Motion

TIGHT = ss.Integrator(step=ss.AdaptiveStep(1e-11))
LENGTH = 5.0  # s


def root(x):
    """The square root as it is written where its derivative is to be finite at zero."""
    return jnp.where(x > 0, jnp.sqrt(jnp.where(x > 0, x, 1.0)), 0.0)


def drag(k, x, y, v, w):
    return -k * root(v * v + w * w) * v


def rope(k, x, y, v, w):
    square = x * x + y * y
    length = jnp.where(x * x + y * y > 0, root(square), 1.0)
    return -10 * k * jnp.maximum(root(square) - 0.3, 0.0) * jnp.where(square > 0, x / length, 0.0)


def orifice(k, x, y, v, w):
    return -k * jnp.sign(v) * root(jnp.abs(v))


class Place(NamedTuple):
    x: Any
    y: Any


class Body(AbstractMechanism):
    """Two coordinates with one force along each, a spring and a load; at rest only to begin with."""

    k: Any
    force: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {
            "x": 1.5 * jnp.cos(2.0 * t) - q.x + self.force(self.k, q.x, q.y, v.x, v.y),
            "y": 0.7 * jnp.sin(3.0 * t) - q.y + self.force(self.k, q.y, q.x, v.y, v.x),
        }


def by_scipy(force, k, start):
    def field(t, y):
        found = Body(k, force).forces(t, Place(y[0], y[1]), Place(y[2], y[3]), None)
        return jnp.stack([y[2], y[3], found["x"], found["y"]])

    plain = jax.jit(field)
    y0 = [*start, 0.0, 0.0]
    return solve_ivp(plain, (0.0, LENGTH), y0, rtol=1e-9, atol=1e-11, max_step=0.02).y[:2, -1]


# All at rest: at the origin, beside it, on a border exactly, and beyond.
STARTS = np.array([[0.0, 0.1, 0.02, 0.5], [0.0, 0.0, 0.02, -0.4]])


@pytest.mark.more
@pytest.mark.parametrize(
    ("force", "off"),
    [(drag, 1e-7), pytest.param(rope, 1e-6, marks=pytest.mark.slow), (orifice, 1e-4)],
)
def test_motion_and_slopes_from_rest(force, off):
    def end(k, x, y):
        body = Body(k, force)
        run = ss.simulate(body, 0.0, LENGTH, body.state(x=x, y=y), integrator=TIGHT, throw=False)
        return jnp.stack([run.y1.x, run.y1.y]), run.result == ss.RESULTS.successful

    @jax.jit
    @jax.vmap
    def found(k, x, y):
        return jax.jvp(lambda k: end(k, x, y), (k,), (jnp.ones_like(k),), has_aux=True)

    h, n = 5e-4, STARTS.shape[1]
    x, y = np.tile(STARTS, 5)
    k = np.repeat(2.0 + h * np.arange(-2, 3), n)
    value, slope, ok = (np.reshape(a, (5, n, -1)) for a in found(k, x, y))
    assert np.all(ok)
    differences = (8 * (value[3] - value[1]) - (value[4] - value[0])) / (12 * h)
    np.testing.assert_allclose(slope[2], differences, atol=off)
    for start, ends in zip(STARTS.T, value[2], strict=True):
        np.testing.assert_allclose(ends, by_scipy(force, 2.0, start), atol=1e-6)


def outcomes_of(function, *given):
    closed = jax.make_jaxpr(function)(*given)
    found = _bends.Outcomes()
    _bends.evaluate_with(closed, given, (True,) * len(given), found)
    return found


def test_one_comparison_is_one_outcome_however_it_is_said():
    """Two outcomes of one comparison would be turned over one by one, and contradict in between.

    `orifice` from rest chattered with them.
    """

    def field(v):
        away = jnp.where(v > 0, 1.0, 0.0) + jnp.where(0 < v, 2.0, 0.0) - jnp.where(v <= 0, 1.0, 0.0)
        return away + root(v * v) + root(v * v) + jnp.maximum(v, 0.0) + jnp.abs(v) + jnp.sign(v)

    # v above 0, v below 0, v^2 above 0.
    assert outcomes_of(field, jnp.asarray(0.3)).width == 3


def test_what_differs_in_the_sign_of_zero_is_computed_apart():
    def field(v):
        return jnp.arctan2(0.0 * v, -0.0 * v) + 2.0 * jnp.arctan2(0.0 * v, 0.0 * v)

    v = jnp.asarray(0.3)
    closed = jax.make_jaxpr(field)(v)
    (found,) = _bends.evaluate_with(closed, (v,), (True,), _bends.Outcomes())
    np.testing.assert_allclose(found, np.pi)


@jax.custom_jvp
def stop(d):
    """A soft stop with a derivative of the user's."""
    return jnp.where(d > 0, d, 0.0)


@stop.defjvp
def _stop_jvp(given, rates):
    return stop(given[0]), jnp.where(given[0] > 0, rates[0], 0.0)


class Stopped(ss.AbstractSmoothSystem):
    stop: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-y.x - 1e3 * self.stop(y.x - 0.02))


def in_a_loop(d):
    """A loop of as many rounds as a number says: it is not looked into."""
    rounds = jnp.where(d > 1e9, 2, 1)
    return jax.lax.while_loop(
        lambda c: c[0] < rounds, lambda c: (c[0] + 1, jnp.maximum(d, 0.0)), (0, 0.0 * d)
    )[1]


@pytest.mark.more
def test_bends_in_rules_of_the_user_are_seen_and_those_in_loops_flagged():
    def slope(stop):
        def end(x):
            run = ss.simulate(Stopped(stop), 0.0, 3.0, Motion(x, 0.0 * x))
            return run.y1.x, run.flags

        return jax.jit(jax.jacfwd(end, has_aux=True))(0.5)

    right, flags = slope(ss.positive_part)
    assert int(flags) == 0
    for rule in (stop, jax.nn.relu6):
        found, flags = slope(rule)
        np.testing.assert_allclose(found, right, rtol=1e-7)
        assert int(flags) == 0
    _, flags = slope(in_a_loop)
    assert int(flags) & BENT


class Blind(ss.AbstractHybridSystem):
    """A guard that has no value after a second."""

    mode_names: ClassVar = ("all",)
    guard_names: ClassVar = ("crossed",)

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=0.0 * y.x)

    def guards(self, t, y, mode, args):
        return (jnp.sqrt(1.0 - y.x) + 1.0,)

    def transition(self, t, y, mode, guard, args):
        return y, mode

    def initial_mode(self, t, y, args):
        return jnp.zeros((), jnp.int32)


def test_a_guard_without_a_value_ends_the_run():
    run = ss.simulate(Blind(), 0.0, 2.0, Motion(0.0, 1.0), throw=False)
    assert run.result != ss.RESULTS.successful
    np.testing.assert_allclose(run.t1, 1.0, atol=1e-6)


class Pressed(ss.AbstractSmoothSystem):
    """A body that meets a damped stop: its force jumps where the depth, which does not fall below zero,
    is above zero."""

    k: Any

    def vector_field(self, t, y, mode, args):
        depth = jnp.maximum(y.x - 0.05, 0.0)
        stop = jnp.where(depth > 0.0, self.k * depth + 2.0 * y.v, 0.0)
        return Motion(x=y.v, v=jnp.cos(2.0 * t) - y.x - stop)


@pytest.mark.more
def test_a_comparison_of_what_is_held_at_zero_does_not_outlive_it():
    """Beyond the stop 0 is compared with 0: the outcome of before went on, with its damping."""

    def end(k):
        run = ss.simulate(Pressed(k), 0.0, 10.0, Motion(0.3, 0.0 * k), integrator=TIGHT)
        return run.y1.x

    h = 1e-4
    k = 8.0 + h * jnp.array([0.0, -1.0, 1.0])
    x, slope = jax.jit(jax.vmap(lambda k: jax.jvp(end, (k,), (jnp.ones_like(k),))))(k)
    np.testing.assert_allclose(slope[0], (x[2] - x[1]) / (2 * h), rtol=1e-7)

    @jax.jit
    def field(t, y):
        return jnp.stack(Pressed(8.0).vector_field(t, Motion(*y), 0, None))

    right = solve_ivp(field, (0.0, 10.0), [0.3, 0.0], rtol=1e-9, atol=1e-11, max_step=0.01).y[0, -1]
    np.testing.assert_allclose(x[0], right, atol=1e-6)


@pytest.mark.more
def test_what_is_held_beside_a_border_does_not_fire_before_it():
    """From the last number below the stop, late, some of these chattered on it: a depth of 0 there is
    lower than a distance of one rounding."""
    rng = np.random.default_rng(0)
    stop, speed = rng.uniform([0.05, 0.2], [0.3, 1.5], (64, 2)).T
    late, short = 4.2303326209647159, 1e-9

    class At(Pressed):
        stop: Any

        def vector_field(self, t, y, mode, args):
            return super().vector_field(t, Motion(y.x - self.stop + 0.05, y.v), mode, args)

    @jax.jit
    @jax.vmap
    def run(stop, x, v):
        found = ss.simulate(At(8.0, stop), late, late + short, Motion(x, v), throw=False)
        return found.y1.x - x, found.result == ss.RESULTS.successful

    way, ok = run(stop, np.nextafter(stop, 0.0), speed)
    assert np.all(ok)
    np.testing.assert_allclose(way, short * speed, atol=1e-12)


class Hertz(ss.AbstractSmoothSystem):
    a: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-y.x - jnp.maximum(y.x - self.a, 0.0) ** 1.5)


def test_slopes_of_a_root_are_as_accurate_up_to_its_border():
    """The last step before the border was accepted for the state: slopes were off by 1.3e-4."""
    start, places = np.array([0.0, 1.0]), np.linspace(0.3, 0.95, 5)

    @jax.jit
    @jax.vmap
    def slope(a):
        def end(a):
            step = ss.Integrator(step=ss.AdaptiveStep(1e-8, 1e-8))
            return ss.simulate(Hertz(a), 0.0, 4.0, Motion(*start), integrator=step).y1.x

        return jax.jvp(end, (a,), (jnp.ones(()),))[1]

    def right(a):
        """By the tangent in an angle w, t = middle + half sin(w), in which its field is smooth."""

        def field(t, y):
            return [y[1], -y[0] - max(y[0] - a, 0.0) ** 1.5]

        def leaves(t, y):
            return y[0] - a

        leaves.direction = -1.0
        precise = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        motion = solve_ivp(field, (0.0, 4.0), start, events=leaves, dense_output=True, **precise)
        first, last = np.arcsin(a), motion.t_events[0][0]
        middle, half = (first + last) / 2, (last - first) / 2

        def tangent(w, z):
            depth = motion.sol(middle + half * np.sin(w))[0] - a
            pull = 1.5 * np.sqrt(max(depth, 0.0))
            return half * np.cos(w) * np.array([z[1], -z[0] - pull * (z[0] - 1.0)])

        x, v = solve_ivp(tangent, (-np.pi / 2, np.pi / 2), [0.0, 0.0], **precise).y[:, -1]
        return np.cos(4.0 - last) * x + np.sin(4.0 - last) * v

    np.testing.assert_allclose(slope(places), [right(a) for a in places], rtol=2e-5)


class Ball(AbstractMechanism):
    """A ball on a rough ground and on a spring of Hertz, whose root has no slope where it is off it."""

    k: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        depth = jnp.maximum(q.x - 0.1, 0.0)
        return {"x": 1.2 * jnp.sin(3.0 * t) - 2.0 * q.x - self.k * depth * jnp.sqrt(depth / 0.1)}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(0.2))}


@pytest.mark.more
def test_guards_have_the_slopes_of_the_force_in_them():
    """Derivatives were NaN, and where the normal force varies the run ended."""

    def end(k):
        ball = Ball(k)
        run = ss.simulate(ball, 0.0, 8.0, ball.state(x=-0.2), integrator=TIGHT, throw=False)
        return run.y1.x, (run.num_events, run.flags)

    h = 1e-4
    k = 14.0 + h * jnp.array([0.0, -1.0, 1.0])
    x, slope, (events, flags) = jax.jit(
        jax.vmap(lambda k: jax.jvp(end, (k,), (jnp.ones_like(k),), has_aux=True))
    )(k)
    assert np.all(events == 7)
    assert not np.any(flags)
    np.testing.assert_allclose(slope[0], (x[2] - x[1]) / (2 * h), rtol=1e-6)
