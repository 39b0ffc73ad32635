"""Loads that jump in every period: against closed forms, and against the same breaks one by one."""

import itertools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

import stickslip as ss
from stickslip.plot._sticks import intervals
from stickslip.systems import Motion


class Pushed(ss.AbstractSmoothSystem):
    """Unit mass, spring, dashpot; pushed with +1 N for a part `duty` of the period, then with -1 N."""

    period: Any
    duty: Any = 0.5
    begin: Any = 0.0

    def vector_field(self, t, y, mode, args):
        part = jnp.mod((t - self.begin) / self.period, 1.0)
        return Motion(y.v, jnp.where(part < self.duty, 1.0, -1.0) - y.x - 0.2 * y.v)


def times(system):
    return system.begin + system.period * jnp.stack([0.0 * system.duty, 1.0 * system.duty])


def period(system):
    return system.period


def recurring(*parameters):
    return ss.WithPeriodicBreaks(Pushed(*map(jnp.asarray, parameters)), times, period)


def pieces(t, system):
    """State after `t` from rest: the field is linear in each piece."""
    rate = np.array([[0.0, 1.0, 0.0], [-1.0, -0.2, 0.0], [0.0, 0.0, 0.0]])
    T, duty, begin = (float(a) for a in (system.period, system.duty, system.begin))
    count = np.arange(np.floor(-begin / T) - 2, np.ceil((t - begin) / T) + 2)
    edges = np.unique(np.clip(np.concatenate([begin + T * count, begin + T * (count + duty)]), 0.0, t))
    state = np.array([0.0, 0.0, 1.0])
    for one, two in itertools.pairwise(edges):
        rate[1, 2] = 1.0 if ((0.5 * (one + two) - begin) / T) % 1.0 < duty else -1.0
        state = expm(rate * (two - one)) @ state
    return state[:2]


@jax.jit
def pushed_from_rest(system):
    return ss.simulate(system, 0.0, 100.0, Motion(0.0, 0.0), saveat=ss.SaveAt(max_events=None))


@pytest.mark.parametrize(
    ("T", "duty", "begin"),
    [(4.8, 0.5, 0.0), (4.8, 0.03, 0.0), (4.8, 0.97, -1.0), (0.1, 0.4, 0.05), (300.0, 0.5, -70.0)],
)
def test_a_push_that_recurs(T, duty, begin):
    system = recurring(T, duty, begin)
    run = pushed_from_rest(system)
    np.testing.assert_allclose([run.y1.x, run.y1.v], pieces(100.0, system.system), atol=1e-8)
    assert int(run.flags) == 0
    count = sum(np.sum((b > 0.0) & (b < 100.0)) for b in _breaks(T, duty, begin))
    assert int(run.num_events) == count


def _breaks(T, duty, begin):
    whole = np.arange(-5, 2000)
    return begin + T * whole, begin + T * (whole + duty)


@pytest.mark.more
def test_derivatives_by_the_period_and_the_times():
    def end(T, duty, begin):
        return ss.simulate(recurring(T, duty, begin), 0.0, 30.0, Motion(0.0, 0.0)).y1.x

    point, h = (4.8, 0.3, 0.4), 1e-5
    for derivative in (jax.jacfwd, jax.grad):
        found = jax.jit(derivative(end, argnums=(0, 1, 2)))(*map(jnp.asarray, point))
        for k, slope in enumerate(found):
            ends = []
            for side in (-h, h):
                moved = np.array(point)
                moved[k] += side
                ends.append(pieces(30.0, Pushed(*moved))[0])
            np.testing.assert_allclose(slope, (ends[1] - ends[0]) / (2 * h), rtol=1e-7)


class Block(ss.AbstractHybridSystem):
    """A block on a belt, pulled."""

    period: Any
    mode_names = ("backward", "stick", "forward")
    guard_names = ("stop", "down", "up")

    def pull(self, t):
        part = jnp.mod(t / self.period, 1.0)
        return jnp.where(part < 0.25, 0.8, jnp.where(part < 0.5, -0.9, 0.1))

    def vector_field(self, t, y, mode, args):
        sign = 1.0 - 1.0 * jnp.asarray(mode, jnp.float64)
        return Motion(y.v, jnp.where(mode == 1, 0.0, self.pull(t) - y.x + 0.5 * sign))

    def guards(self, t, y, mode, args):
        stick, held = mode == 1, self.pull(t) - y.x
        sign = 1.0 - 1.0 * jnp.asarray(mode, jnp.float64)
        return (
            jnp.where(stick, 1.0, sign * (0.2 - y.v)),
            jnp.where(stick, 1.0 + held, 1.0),
            jnp.where(stick, 1.0 - held, 1.0),
        )

    def transition(self, t, y, mode, guard, args):
        held = self.pull(t) - y.x
        after = jnp.where(held < -1.0, 0, jnp.where(held > 1.0, 2, 1))
        after = jnp.where(guard == 1, 0, jnp.where(guard == 2, 2, after))
        return Motion(y.x, 0.2 + 0.0 * y.v), after.astype(jnp.int32)

    def initial_mode(self, t, y, args):
        held = self.pull(t) - y.x
        at = jnp.where(held < -1.0, 0, jnp.where(held > 1.0, 2, 1))
        return jnp.where(y.v < 0.2, 0, jnp.where(y.v > 0.2, 2, at)).astype(jnp.int32)


@pytest.mark.more
def test_jumps_that_end_a_stick_or_find_the_block_slipping():
    """The same events as with each break declared by itself; a jump may release the block."""
    block = Block(5.0)
    row = np.array([0.0, 1.25, 2.5])
    system = ss.WithPeriodicBreaks(block, row, 5.0)
    counted = ss.WithBreaks(block, np.sort(np.concatenate([row + 5.0 * k for k in range(40)]))[1:])
    ts = np.linspace(0.0, 100.0, 301)
    one = ss.simulate(system, 0.0, 100.0, Motion(0.0, 0.2), saveat=ss.SaveAt(ts=ts))
    two = ss.simulate(counted, 0.0, 100.0, counted.start(Motion(0.0, 0.2)), saveat=ss.SaveAt(ts=ts))
    assert int(one.num_events) == int(two.num_events) > 70
    np.testing.assert_allclose(one.outputs.y.x, two.outputs.y.y.x, atol=1e-7)
    sticks = np.asarray(one.outputs.mode) % 3 == 1
    assert 0.1 < sticks.mean() < 0.9
    assert (np.asarray(two.outputs.mode)[sticks] == 1).mean() > 0.98  # but for those at a break


@pytest.mark.more
def test_a_single_break_a_period_and_a_batch():
    """A saw tooth: the second break, in the middle, changes nothing."""

    class Tooth(ss.AbstractSmoothSystem):
        period: Any

        def vector_field(self, t, y, mode, args):
            return Motion(y.v, jnp.mod(t / self.period, 1.0))

    def end(T):
        system = ss.WithPeriodicBreaks(Tooth(T), lambda s: jnp.zeros(1), period)
        run = ss.simulate(system, 0.0, 12.0, Motion(0.0, 0.0))
        return run.y1.v, run.flags

    T = np.array([1.0, 2.0, 3.0, 5.0])
    speed, flags = ss.map_lanes(end)(T)
    whole = np.floor(12.0 / T)
    np.testing.assert_allclose(speed, 0.5 * T * (whole + (12.0 / T - whole) ** 2), rtol=1e-12)
    assert (np.asarray(flags) == 0).all()


def test_modes_by_name():
    system = recurring(2.0)
    assert system.mode_names[:] == ["motion, load 1", "motion, load 2"]
    assert system.mode_names.index("motion, load 2") == 1
    assert "motion, load 3" not in system.mode_names
    assert int(system.initial_mode(0.5, Motion(0.0, 0.0), None)) == 1
    run = ss.simulate(system, 0.5, 0.6, Motion(0.0, 0.0), "motion, load 2")
    assert int(run.mode1) == 1
    with pytest.raises(ValueError, match=r"'motion, load 1': it must be of the piece of the load"):
        ss.simulate(system, 0.5, 0.6, Motion(0.0, 0.0), "motion, load 1")


@pytest.mark.more
def test_sticks_are_drawn_by_the_modes_of_the_block():
    system = ss.WithPeriodicBreaks(Block(5.0), [0.0, 1.25, 2.5], 5.0)
    run = ss.simulate(system, 0.0, 20.0, Motion(0.0, 0.2))
    ((_, spans),) = intervals(run, system).items()
    lengths = [b - a for a, b in spans]
    assert len(spans) > 3
    assert min(lengths) > 0.0


@pytest.mark.parametrize(
    ("times", "period", "words"),
    [
        ([1.0, 0.5], 2.0, "times"),
        ([0.0, 2.0], 2.0, r"times = .*: it must be within less than the period, 2.0 s"),
        ([], 2.0, "times"),
        ([0.0], 0.0, "period"),
        ([0.0], np.nan, "period"),
        (lambda s: jnp.array([0.0, 3.0]), 2.0, "within less than the period"),
        (lambda: 0, 2.0, r"times = .*: it must be callable as times\(system\)"),
    ],
)
def test_wrong_times_are_named(times, period, words):
    with pytest.raises((ValueError, TypeError), match=words):
        ss.WithPeriodicBreaks(Pushed(2.0), times, period)
