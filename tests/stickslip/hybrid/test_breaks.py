"""Loads that jump at declared times."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion


class Pushed(ss.AbstractSmoothSystem):
    """A free mass under `force` from `begin` to `end`."""

    begin: Any
    end: Any
    force: Any

    def vector_field(self, t, y, mode, args):
        inside = (t >= self.begin) & (t < self.end)
        return Motion(y.v, jnp.where(inside, self.force, 0.0))


def position(begin, end, force):
    system = ss.WithBreaks(Pushed(begin, end, force), jnp.stack([begin, end]))
    run = ss.simulate(system, 0.0, 10.0, system.start(Motion(0.0, 0.0)))
    return run.y1.y.x, run


def exact(begin, end, force):
    return force * (end - begin) ** 2 / 2 + force * (end - begin) * (10.0 - end)


POINT = (jnp.asarray(2.0), jnp.asarray(3.5), jnp.asarray(4.0))


@pytest.mark.more
def test_a_push_between_two_breaks_and_its_derivatives():
    x, run = position(*POINT)
    np.testing.assert_allclose(x, exact(*POINT), rtol=1e-12)
    np.testing.assert_allclose(run.events.t[:2], [2.0, 3.5], rtol=1e-15)
    assert int(run.flags) == 0
    true = jax.jit(jax.grad(exact, argnums=(0, 1, 2)))(*POINT)
    for derivative in (jax.jacfwd, jax.jacrev):
        found = jax.jit(derivative(lambda *p: position(*p)[0], argnums=(0, 1, 2)))
        np.testing.assert_allclose(found(*POINT), true, rtol=1e-12)


@pytest.mark.more
@pytest.mark.parametrize("shift", [0.0, 1e-9, 1e3, 1e6])
def test_breaks_far_from_zero_time(shift):
    begin, end, force = POINT[0] + shift, POINT[1] + shift, POINT[2]
    system = ss.WithBreaks(Pushed(begin, end, force), jnp.stack([begin, end]))
    start = system.start(Motion(0.0, 0.0), shift)
    run = ss.simulate(system, shift, 10.0 + shift, start)
    # Times are rounded in each of the thousand steps.
    np.testing.assert_allclose(run.y1.y.x, exact(*POINT), rtol=1e-12 + 3e-15 * shift)
    assert int(run.flags) == 0


@pytest.mark.more
def test_breaks_before_at_and_after_the_run_do_nothing():
    system = ss.WithBreaks(Pushed(-1.0, 50.0, 1.0), [-1.0, 0.0, 50.0])
    run = ss.simulate(system, 0.0, 4.0, system.start(Motion(0.0, 0.0), 0.0))
    np.testing.assert_allclose(run.y1.y.x, 8.0, rtol=1e-12)
    assert int(run.num_events) == 0


def test_equal_breaks_are_one():
    """As of an input shaper whose parts are as far apart as the pieces of its path."""
    system = ss.WithBreaks(Pushed(2.0, 3.5, 4.0), [2.0, 2.0, 3.5, 3.5, 3.5, 12.0])
    run = ss.simulate(system, 0.0, 10.0, system.start(Motion(0.0, 0.0)))
    np.testing.assert_allclose(run.y1.y.x, exact(2.0, 3.5, 4.0), rtol=1e-12)
    assert float(run.y1.piece) == 5.0


def test_a_system_with_guards_keeps_them():
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    system = ss.WithBreaks(block, [1.0, 7.0])
    run = ss.simulate(system, 0.0, 30.0, system.start(Motion(0.0, 0.2)))
    plain = ss.simulate(block, 0.0, 30.0, Motion(0.0, 0.2))
    np.testing.assert_allclose(run.y1.y.x, plain.y1.x, rtol=1e-9)
    assert int(run.num_events) == int(plain.num_events) + 2


@pytest.mark.parametrize("times", [[], [[1.0]], [2.0, 1.0], [np.nan], [np.inf], "soon", None, 1.0])
def test_wrong_times_are_named(times):
    with pytest.raises((ValueError, TypeError), match="times"):
        ss.WithBreaks(Pushed(0.0, 1.0, 1.0), times)
    with pytest.raises(TypeError, match="system"):
        ss.WithBreaks("block", [1.0])


class Lines(ss.AbstractSmoothSystem):
    """A free mass under a force that is a straight line from one of `times` to the next."""

    times: Any
    forces: Any

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, jnp.interp(t, self.times, self.forces))


@pytest.mark.more
def test_outputs_at_the_very_breaks():
    """As of a record whose inputs have its stamps: a step that ends on a stamp ends on a bend."""
    count = 400
    forces = np.random.default_rng(0).uniform(-1.0, 1.0, count)

    @jax.jit
    def run(times):
        system = ss.WithBreaks(Lines(times, jnp.asarray(forces)), times[1:-1])
        start = system.start(Motion(0.0, 0.0))
        saveat = ss.SaveAt(ts=times, max_events=2 * count)
        done = ss.simulate(system, 0.0, times[-1], start, saveat=saveat)
        return done.outputs.y.y.x, done.num_events, done.flags

    for step in (0.02, 0.1, 1.0 / 3.0, 0.7):
        times = step * np.arange(count)
        found, events, flags = run(jnp.asarray(times))
        a, b = forces[:-1], forces[1:]
        v = np.concatenate([[0.0], np.cumsum(0.5 * step * (a + b))])
        x = np.concatenate([[0.0], np.cumsum(step * v[:-1] + step**2 * (2 * a + b) / 6.0)])
        np.testing.assert_allclose(found, x, atol=1e-11 * np.abs(x).max())
        assert int(events) == count - 2
        assert int(flags) == 0
