"""Forces whose slope has no bound at a border: roots of a depth, Stribeck's law below exponent 1."""

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Stribeck
from stickslip.hybrid.status import GRAZING
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import Motion

START = np.array([0.0, 1.0])
END = 4.0  # s
PLACES = np.linspace(0.3, 0.95, 14)


def power(depth, p):
    return jnp.maximum(depth, 0.0) ** p


class Root(ss.AbstractSmoothSystem):
    """An oscillator, x'' = -x - d^p, with the depth d of x beyond a border a."""

    a: Any
    p: float = eqx.field(static=True, default=0.5)
    force: Any = power  # a function among the fields, which nothing differentiates

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-y.x - self.force(y.x - self.a, self.p))


class Damper(ss.AbstractSmoothSystem):
    """An oscillator with an orifice, x'' = -x - c sgn(v) sqrt(|v|)."""

    c: Any

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=-y.x - self.c * jnp.sign(y.v) * jnp.sqrt(jnp.abs(y.v)))


def leaves(system, t, y, dy, mode, args):
    return y.x - system.a


OUT = ss.SaveAt(sections=ss.Section(leaves, direction="falling"))


def within(tol):
    return ss.Integrator(step=ss.AdaptiveStep(tol, tol))


def right(a, p):
    """Slope of x(END) by a, by the tangent in an angle w, t = middle + half sin(w), which is smooth."""

    def field(t, y):
        return [y[1], -y[0] - max(y[0] - a, 0.0) ** p]

    def out(t, y):
        return y[0] - a

    out.direction = -1.0
    precise = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    first = np.arcsin(a)
    motion = solve_ivp(field, (first, END), [a, np.cos(first)], events=out, dense_output=True,
                       first_step=1e-9, **precise)  # fmt: skip
    last = motion.t_events[0][-1]
    middle, half, ends = (first + last) / 2, (last - first) / 2, np.pi / 2 - 1e-5

    def tangent(w, z):
        depth = max(motion.sol(middle + half * np.sin(w))[0] - a, 1e-12)
        return half * np.cos(w) * np.array([z[1], -z[0] - p * depth ** (p - 1) * (z[0] - 1.0)])

    x, v = solve_ivp(tangent, (-ends, ends), [0.0, 0.0], **precise).y[:, -1]
    return np.cos(END - last) * x + np.sin(END - last) * v


def faint(depth, p):
    return 1e-30 * power(depth, p)


def rotation(t):
    """Derivatives of x and v at a time by those at the start, without any force."""
    return np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])


@pytest.mark.parametrize(
    "derivatives", [jax.jacfwd, pytest.param(jax.jacrev, marks=pytest.mark.more)], ids=["fwd", "rev"]
)
def test_slopes_at_a_border_are_those_at_it(derivatives):
    """Closed, as the force is nearly none: steps end a millionth before the border, slopes do not."""
    system = Root(jnp.asarray(0.2), force=faint)

    def ends(start):
        y0 = Motion(x=start[0], v=start[1])
        run = ss.simulate(system, 0.0, 12.0, y0, integrator=within(1e-11), saveat=OUT)
        (out,) = run.crossings
        return jnp.stack([run.y1.x, run.y1.v]), out.t[:2], jnp.stack([out.y.x[:2], out.y.v[:2]])

    start = jnp.array([0.3, 1.1])
    (_, times, _), (end, time, out) = ends(start), derivatives(ends)(start)
    np.testing.assert_allclose(end, rotation(12.0), atol=1e-10)
    for i, t in enumerate(np.asarray(times)):
        at = rotation(t)
        x, v = at @ np.asarray(start)
        assert x == pytest.approx(0.2, abs=1e-9)
        np.testing.assert_allclose(time[i], -at[0] / v, atol=1e-9)
        np.testing.assert_allclose(out[0, i], 0.0, atol=1e-9)
        np.testing.assert_allclose(out[1, i], at[1] - x * time[i], atol=1e-9)


@pytest.mark.parametrize(
    ("p", "tol", "off"), [(0.5, 1e-6, 4e-4), pytest.param(0.7, 1e-8, 3e-5, marks=pytest.mark.more)]
)
def test_slopes_through_a_border_where_a_force_has_none(p, tol, off):
    """A stage beside the border by rounding had a slope of 1e8: of 14 runs five were off by 1% to 2."""

    def end(a):
        run = ss.simulate(Root(a, p), 0.0, END, Motion(*START), integrator=within(tol), saveat=OUT)
        return (run.y1.x, run.crossings[0].y.v[0]), run.flags

    forward = jax.vmap(lambda a: jax.jvp(end, (a,), (jnp.ones(()),), has_aux=True)[1:])
    (slope, rate), flags = jax.jit(forward)(PLACES)
    assert not np.any(flags)
    np.testing.assert_allclose(slope, [right(a, p) for a in PLACES], atol=off)
    # It leaves as fast as it came, v^2 = 1 - a^2.
    np.testing.assert_allclose(rate, PLACES / np.sqrt(1 - PLACES**2), atol=off)


def test_slopes_of_one_lane_are_those_of_a_batch():
    """The program of one lane rounds otherwise: beside a border by rounding that made 14 of 0.1."""

    def end(a):
        return ss.simulate(Root(a), 0.0, 2.5, Motion(*START), integrator=within(1e-7)).y1.x

    forward = jax.jit(jax.vmap(jax.jacfwd(end)))(PLACES[:5])
    one = jax.jit(jax.grad(end))
    np.testing.assert_allclose([one(a) for a in PLACES[:5]], forward, atol=3e-5)


@pytest.mark.more
def test_the_same_in_reverse():
    def end(a):
        run = ss.simulate(Root(a), 0.0, END, Motion(*START), integrator=within(1e-6), saveat=OUT)
        return run.y1.x + run.crossings[0].y.v[0]

    back = jax.jit(jax.vmap(jax.grad(end)))(PLACES)
    slope = [right(a, 0.5) + a / np.sqrt(1 - a**2) for a in PLACES]
    np.testing.assert_allclose(back, slope, atol=8e-4)


@pytest.mark.more
def test_slopes_through_a_turn_in_an_orifice():
    """At a tolerance of 1e-6 slopes were off by 100, where they are 0.2."""

    def end(c):
        run = ss.simulate(Damper(c), 0.0, END, Motion(*START), integrator=within(1e-6))
        return run.y1.x, run.flags

    h, c = 1e-4, np.linspace(0.05, 0.3, 8)
    slope, flags = jax.jit(jax.vmap(jax.jacfwd(end, has_aux=True)))(c)
    assert not np.any(flags)

    def motion(c):
        """In three parts, from turn to turn; each begins and ends with the root at rest."""
        t, y = 0.0, START
        turn = lambda t, y: y[1]  # noqa: E731
        turn.terminal = True
        while t < END:
            side = np.sign(y[1]) if y[1] else -np.sign(y[0])
            field = lambda t, y, s=side: [y[1], -y[0] - c * s * np.sqrt(max(s * y[1], 0.0))]  # noqa: E731
            turn.direction = -side
            part = solve_ivp(field, (t, END), y, "DOP853", events=turn, first_step=1e-9,
                             rtol=1e-12, atol=1e-14)  # fmt: skip
            t, y = part.t[-1], part.y[:, -1] * [1.0, float(part.status == 0)]
        return y[0]

    by_differences = [
        (8 * (motion(x + h) - motion(x - h)) - (motion(x + 2 * h) - motion(x - 2 * h))) / (12 * h)
        for x in c
    ]
    np.testing.assert_allclose(slope, by_differences, atol=3e-4)


def test_a_motion_that_just_meets_a_steep_force_is_flagged():
    """The slope of x(END) is 1.45 of one that meets it and 0 of one that misses it."""
    depth = np.array([1e-2, 1e-9, 1e-12, 0.0, -1e-9, -1e-2])

    @jax.jit
    @jax.vmap
    def flags(a):
        return ss.simulate(Root(a), 0.0, END, Motion(*START), integrator=within(1e-8)).flags

    np.testing.assert_array_equal(flags(1.0 - depth) & GRAZING, [0, 1, 1, 1, 1, 0])


class Two(NamedTuple):
    a: Any
    b: Any
    va: Any
    vb: Any


class Pair(ss.AbstractSmoothSystem):
    """Two equal bodies on equal springs with a buffer between them, which a gap of 0 just touches."""

    k: Any = 1.0

    def vector_field(self, t, y, mode, args):
        force = self.k * jnp.maximum(y.a - y.b, 0.0)
        return Two(y.va, y.vb, 0.3 - y.a - force, 0.3 - y.b + force)


def test_bodies_that_move_as_one_beside_a_buffer_are_flagged():
    """Their common motion does not change the force: it was not seen to bend."""
    for start in (0.3, 0.5):
        run = ss.simulate(Pair(), 0.0, 2.0, Two(start, start, 0.0, 0.0))
        assert int(run.flags) & GRAZING


class OnBelt(AbstractMechanism):
    """A block on a spring and a belt, with an exponent of Stribeck's law below 1."""

    mu: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x - 0.1 * v.x}

    def contacts(self, t, q, v, args):
        return {"belt": Contact(Stribeck(self.mu, 0.5, 0.5, exponent=0.5), 1.0, 0.5)}


def end_on_belt(mu):
    system = OnBelt(mu)
    run = ss.simulate(system, 0.0, 8.0, system.state(), integrator=within(1e-9))
    return run.y1.x, run.num_events


def test_slopes_through_stick_slip_with_an_exponent_below_one():
    """They were NaN: at the onset of slip an infinite slope met a speed that stays zero."""
    h, mu = 1e-4, np.array([0.85, 1.0, 1.15])
    steps = mu + h * np.array([[0.0], [-2.0], [-1.0], [1.0], [2.0]])
    x, slope, events = jax.jit(
        jax.vmap(lambda mu: jax.jvp(end_on_belt, (mu,), (jnp.ones(()),), has_aux=True))
    )(steps.ravel())
    assert np.all(events == 3)
    x, slope = x.reshape(5, -1), slope.reshape(5, -1)[0]
    np.testing.assert_allclose(slope, (8 * (x[3] - x[2]) - (x[4] - x[1])) / (12 * h), atol=1e-5)


@pytest.mark.more
def test_the_same_with_an_exponent_in_reverse():
    mu = np.array([0.85, 1.0, 1.15])
    forward, back = (
        jax.jit(jax.vmap(d(lambda mu: end_on_belt(mu)[0])))(mu) for d in (jax.jacfwd, jax.grad)
    )
    np.testing.assert_allclose(back, forward, atol=1e-10)


class Orifice(ss.AbstractSmoothSystem):
    """Pulled by a spring through an orifice that opens at 0.3 m/s:
    x'' = 2 - x - c max(v - 0.3, 0)^p."""

    c: Any
    p: float = eqx.field(static=True)

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=2.0 - y.x - self.c * power(y.v - 0.3, self.p))


@pytest.mark.parametrize(
    ("p", "tol"), [(0.3, 1e-10), (0.5, 1e-12), pytest.param(0.3, 1e-12, marks=pytest.mark.more)]
)
def test_slopes_beside_a_border_where_steps_are_as_short_as_rounding(p, tol):
    """Steps of 1e-12 s ended at a depth of rounding, or on the border by rounding without a derivative,
    and the next one began there: slopes of 0.8 came out as 1000 without a flag."""

    def end(c, v):
        run = ss.simulate(Orifice(c, p), 0.0, 1.0, Motion(x=0.0, v=v), integrator=within(tol))
        return run.y1.x, run.flags

    h, c = 1e-4, np.linspace(0.15, 0.9, 8)
    starts = 0.2623 + h * np.array([[0.0], [-2.0], [-1.0], [1.0], [2.0]]) + 0.0 * c
    both = jax.jit(jax.vmap(lambda c, v: jax.jvp(lambda v: end(c, v), (v,), (1.0,), has_aux=True)))
    x, slope, flags = both(np.tile(c, 5), starts.ravel())
    assert not np.any(flags)
    x = x.reshape(5, -1)
    right = (8 * (x[3] - x[2]) - (x[4] - x[1])) / (12 * h)
    np.testing.assert_allclose(slope.reshape(5, -1)[0], right, atol=3e-6)


@pytest.mark.more
def test_the_same_beside_a_border_in_reverse():
    def end(c):
        run = ss.simulate(Orifice(c, 0.3), 0.0, 1.0, Motion(0.0, 0.2623), integrator=within(1e-11))
        return run.y1.x

    c = np.linspace(0.15, 0.9, 8)
    forward, back = (jax.jit(jax.vmap(d(end)))(c) for d in (jax.jacfwd, jax.grad))
    np.testing.assert_allclose(back, forward, atol=1e-9)
