"""What moves on without an error for the step to see, and what it does to others meanwhile."""

import math
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.hybrid import longest_step
from stickslip.hybrid._unseen import HIDES, hiding, turns
from stickslip.systems import CoulombOscillator, Motion

END = 30.0


class Rotor(NamedTuple):
    angle: Any
    speed: Any
    x: Any
    v: Any


class Pushed(ss.AbstractHybridSystem):
    """A block of 1 kg, 1 N at rest and 0.5 N in motion, pushed by 2 N while a rotor passes its cam.

    The rotor is driven and braked: the rate of its speed is `torque - drag * speed`. The cam is written
    by what is rounded, which is a jump that nobody locates.
    """

    torque: Any
    drag: Any
    begin: Any
    end: Any

    mode_names: ClassVar = ("rest", "forward")
    guard_names: ClassVar = ("starts", "stops")

    def push(self, y):
        passed = jnp.floor((y.angle - self.begin) / (self.end - self.begin))
        return jnp.where(passed == 0.0, 2.0, 0.0)

    def vector_field(self, t, y, mode, args):
        slope = jnp.where(mode == 0, 0.0, self.push(y) - 0.5)
        return Rotor(y.speed, self.torque - self.drag * y.speed, y.v, slope)

    def guards(self, t, y, mode, args):
        return jnp.where(mode == 0, 1.0 - self.push(y), 1.0), jnp.where(mode == 0, 1.0, y.v)

    def transition(self, t, y, mode, guard, args):
        return y._replace(v=0.0 * y.v), 1 - mode

    def initial_mode(self, t, y, args):
        return jnp.asarray(0, jnp.int32)


class Compared(Pushed):
    """The same by comparisons, which a run finds in the program of the field."""

    def push(self, y):
        return jnp.where((y.angle >= self.begin) & (y.angle < self.end), 2.0, 0.0)


class Turning(Pushed):
    """The same with a period, which says how far a step may go."""

    periods: ClassVar = {"angle": 2.0 * math.pi}


def drives(number, seed):
    """Rotors that turn evenly, run down, run up and speed up: torque, drag, and speed at first."""
    rng = np.random.default_rng(seed)
    speed, drag = rng.uniform(1.0, 20.0, number), 10.0 ** rng.uniform(-1.0, 0.5, number)
    kind = np.arange(number) % 4
    torque = np.choose(kind, [0.0 * speed, 0.0 * speed, speed * drag, 0.1 * speed])
    drag = np.where((kind == 1) | (kind == 2), drag, 0.0)
    return torque, drag, np.where(kind < 2, speed, 0.0), rng


def angle(torque, drag, speed, t):
    """Of the rotor at a time."""
    some = np.where(drag > 0.0, drag, 1.0)
    settled, decay = torque / some, (1.0 - np.exp(-some * t)) / some
    return np.where(
        drag > 0.0, settled * t + (speed - settled) * decay, speed * t + 0.5 * torque * t**2
    )


def pushes(kind, torque, drag, speed, begin, end):
    def run(torque, drag, speed, begin, end):
        zero = 0.0 * speed
        done = ss.simulate(
            kind(torque, drag, begin, end), 0.0, END, Rotor(zero, speed, zero, zero), throw=False
        )
        return done.num_events, done.y1.x

    return map(np.asarray, jax.jit(jax.vmap(run))(torque, drag, speed, begin, end))


def way(lasts):
    """Of a block that is pushed for a time and then brakes."""
    return 1.5 * lasts**2 / 2 + (1.5 * lasts) ** 2 / (2 * 0.5)


def at_time_bound(number, seed, part):
    torque, drag, speed, rng = drives(number, seed)
    begin, lasts = rng.uniform(0.05, 0.9 * END, number), part * END / 1000
    edges = (angle(torque, drag, speed, t) for t in (begin, begin + lasts))
    return (torque, drag, speed, *edges), lasts


@pytest.mark.more
def test_pushes_by_a_rotor_are_found_at_the_documented_bound():
    """`AdaptiveStep`: not shorter than 0.4 of 1/1000 of the run, in whatever way the rotor turns."""
    given, lasts = at_time_bound(80, seed=0, part=0.4)
    events, x = pushes(Pushed, *given)
    # Where the rotor has almost stopped, its angle does not say the time.
    begin, end = given[3:]
    sure = end - begin > 1e-5 * end
    assert np.sum(sure) > 60
    np.testing.assert_array_equal(events[sure], 2)
    np.testing.assert_allclose(x[sure], way(lasts), rtol=1e-5)
    shorter, _ = at_time_bound(80, seed=0, part=0.01)
    events, _ = pushes(Pushed, *shorter)
    assert np.mean(events == 0) > 0.4  # so that the bound is one
    events, _ = pushes(Compared, *shorter)
    np.testing.assert_array_equal(events[sure], 2)  # however short they are


@pytest.mark.slow
def test_pushes_by_a_rotor_with_a_period_are_found_at_the_documented_bound():
    """Not within 1/60 of a period."""
    torque, drag, speed, rng = drives(400, seed=1)
    last = angle(torque, drag, speed, END)
    begin = rng.uniform(0.0, 0.95, 400) * last
    events, _ = pushes(Turning, torque, drag, speed, begin, begin + 2.0 * np.pi / 60.0)
    inside = begin + 2.0 * np.pi / 60.0 < 0.999 * last
    np.testing.assert_array_equal(events[inside], 2)


@pytest.mark.more
def test_without_the_watch_pushes_are_missed(monkeypatch):
    """The fault this file is about, planted."""
    unseen = longest_step.hiding
    monkeypatch.setattr(longest_step, "hiding", lambda *a: unseen(*a)._replace(
        any=False, runs_free=False, watched=()))  # fmt: skip
    given, _ = at_time_bound(12, seed=0, part=10.0)

    class Unwatched(Pushed):
        pass

    events, _ = pushes(Unwatched, *given)
    assert np.mean(events == 0) > 0.4


class Passing(ss.AbstractSmoothSystem):
    """A body that crosses a well of 0.3 m on its way, and feels nothing before and behind."""

    place: Any

    def vector_field(self, t, y, mode, args):
        s = (y.x - self.place) / 0.1
        return Motion(y.v, -20.0 * s * jnp.exp(-s * s))


def test_a_bump_in_its_own_field_is_felt_by_a_body_that_moves_evenly():
    def end(place):
        return ss.simulate(Passing(place), 0.0, END, Motion(0.0, 1.0)).y1.x

    places = np.array([3.3, 8.9, 21.7])
    found = jax.jit(jax.vmap(end))(places)

    def field(t, y, place):
        s = (y[0] - place) / 0.1
        return y[1], -20.0 * s * np.exp(-s * s)

    for place, x in zip(places, found, strict=True):
        true = solve_ivp(
            field,
            (0.0, END),
            [0.0, 1.0],
            "DOP853",
            args=(place,),
            rtol=1e-12,
            atol=1e-13,
            max_step=0.02,
        )
        assert abs(true.y[0, -1] - END) > 1e-2
        np.testing.assert_allclose(x, true.y[0, -1], atol=1e-7)


def hidden(system, y, sections=()):
    y = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y)
    closed = longest_step._motion(system, sections, jnp.zeros(()), y, jnp.zeros((), jnp.int32), None)
    return hiding(system, closed, y)


def test_what_costs_nothing_and_what_is_watched():
    belt = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    assert hidden(belt, Motion(0.0, 0.2)) == (False, False, ())
    rotor = hidden(Pushed(0.0, 1.0, 2.0, 3.0), Rotor(0.0, 0.0, 0.0, 0.0))
    assert rotor.runs_free
    assert [(one.leaf, one.free) for one in rotor.watched] == [(0, (True,))]
    turning = hidden(Turning(0.0, 1.0, 2.0, 3.0), Rotor(0.0, 0.0, 0.0, 0.0))
    assert not turning.runs_free
    np.testing.assert_allclose(turning.watched[0].way, 2.0 * np.pi / 36.0)
    passing = hidden(Passing(1.0), Motion(0.0, 0.0))
    assert [(one.leaf, one.free) for one in passing.watched] == [(0, (False,))]
    section = ss.Section(lambda system, t, y, dy, mode, args: jnp.sin(y.x))
    assert hidden(belt, Motion(0.0, 0.2), (section,)).any

    class Row(ss.AbstractSmoothSystem):
        """The numbers of an array are told apart."""

        def vector_field(self, t, y, mode, args):
            return jnp.stack([y[1], 0.0 * y[0], y[3], jnp.cos(y[0]) ** 50 - y[2]])

    (one,) = hidden(Row(), jnp.zeros(4)).watched
    assert one.hides == (True, False, False, False)
    assert one.free == (True, True, False, False)


@pytest.mark.parametrize(
    ("function", "number"),
    [
        (lambda x: 2.0 * x - 1.0, 1), (lambda x: jnp.abs(x) - x, 2), (lambda x: x * x, 2),
        (lambda x: jnp.minimum(1.0 - x, x), 2), (lambda x: jax.lax.clamp(-1.0, x, 1.0), 3),
        (lambda x: jnp.tanh(x / 1e-3), 3), (lambda x: x + x**3, 3), (lambda x: 0.0 * x, 0),
        (lambda x: x**3 - x * x, 3), (lambda x: jnp.abs(x) * x + jnp.abs(x - 1.0), HIDES),
        (lambda x: jnp.minimum(jnp.abs(x), 1.0), HIDES), (jnp.sin, HIDES),
        (lambda x: x**50, HIDES), (lambda x: jnp.where(x > 1.0, 1.0, 0.0), HIDES),
        (lambda x: 1.0 / (1.0 + x * x), HIDES), (lambda x: jnp.exp(-x * x), HIDES),
        (lambda x: jax.lax.fori_loop(0, 3, lambda _, a: a + x, x), HIDES),
        (lambda x: jax.jit(jnp.abs)(x), 2), (lambda x: jnp.stack([x, 1.0])[1], 0),
    ],
)  # fmt: skip
def test_turns(function, number):
    closed = jax.make_jaxpr(function)(jnp.asarray(1.0))
    assert turns(closed, [np.asarray(0)], 1)[0][0] == number


class Timed(Turning):
    def time_scale(self, args):
        return 0.01


def test_a_declared_time_scale_is_asked_for_loads_of_the_state():
    y = jax.tree.map(jnp.asarray, Rotor(0.0, 1.0, 0.0, 0.0))
    given = jnp.zeros(()), jnp.asarray(END), y, jnp.zeros((), jnp.int32), None
    bound = longest_step.step_bound(ss.AdaptiveStep(1e-10), Timed(0.0, 0.0, 9.0, 9.1), (), *given)
    assert bound.watched == ()
    np.testing.assert_allclose(bound.rule.dtmax, 0.02)
    bound = longest_step.step_bound(ss.AdaptiveStep(1e-10), Pushed(0.0, 0.0, 9.0, 9.1), (), *given)
    np.testing.assert_allclose(bound.rule.dtmax, END / 1000)
    # Pieces of an analysis are bounded by the whole.
    pieces = longest_step.spanning(ss.Integrator(), 100.0 * END).step
    bound = longest_step.step_bound(pieces, Pushed(0.0, 0.0, 9.0, 9.1), (), *given)
    np.testing.assert_allclose(bound.rule.dtmax, END / 10)
