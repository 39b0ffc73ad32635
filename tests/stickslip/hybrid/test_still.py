"""Derivatives at an equilibrium, where no motion sets the length of the steps."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid.status import STILL
from stickslip.systems import CoulombOscillator, Motion

GROWTH = 0.015


class Oscillator(ss.AbstractSmoothSystem):
    """A mass on a spring under a constant load, with damping of either sign."""

    damping: Any
    load: Any

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.load - y.x - self.damping * y.v)


def exact(t):
    omega = np.sqrt(1.0 - GROWTH**2)
    return np.exp(GROWTH * t) * (np.cos(omega * t) - GROWTH / omega * np.sin(omega * t))


@pytest.mark.parametrize("method", ["dop853", pytest.param("tsit5", marks=pytest.mark.more)])
@pytest.mark.parametrize(
    "load", [pytest.param(0.0, marks=pytest.mark.more), 0.7, pytest.param(1e6, marks=pytest.mark.more)]
)
def test_derivatives_from_an_equilibrium_are_right_or_flagged(method, load):
    @jax.jit
    def run(away, t1, dtmax):
        integrator = ss.Integrator(method=method, step=ss.AdaptiveStep(1e-10, dtmax=dtmax))

        def end(x):
            system = Oscillator(-2 * GROWTH, load)
            found = ss.simulate(system, 0.0, t1, Motion(x, 0.0), integrator=integrator, throw=False)
            return found.y1.x, found.flags

        derivative, flags = jax.jacfwd(end, has_aux=True)(load + away)
        return derivative, flags

    scale = max(load, 1.0)
    flagged = 0
    for away in (0.0, 1e-16, 1e-14, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6, 1e-3, 1.0):
        for t1 in (0.3, 3.0, 20.0, 100.0):
            derivative, flags = run(scale * away, t1, jnp.inf)
            assert abs(derivative - exact(t1)) < 1e-4 or int(flags) == STILL, (away, t1)
            flagged += int(flags) != 0
            # A motion that is seen is not doubted.
            assert away < 1e-7 or int(flags) == 0, (away, t1)
            derivative, flags = run(scale * away, t1, 0.1)
            assert abs(derivative - exact(t1)) < 1e-6
            assert int(flags) == 0, (away, t1)
    assert flagged >= 3


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.5 * np.pi])
@pytest.mark.parametrize("step", [ss.AdaptiveStep(1e-10), ss.AdaptiveStep(1e-4, 1e-4)], ids=str)
def test_a_whole_number_of_periods_is_no_rest(phase, step):
    begun = Motion(np.cos(phase), -np.sin(phase))
    integrator = ss.Integrator(step=step)
    run = ss.simulate(Oscillator(0.0, 0.0), 0.0, 6 * np.pi, begun, integrator=integrator)
    np.testing.assert_allclose(run.y1.x, begun.x, atol=1e-2)
    assert int(run.flags) & STILL == 0


class WithShaft(ss.AbstractSmoothSystem):
    """A mass on a spring beside a shaft that turns at a constant speed, a large number."""

    def vector_field(self, t, y, mode, args):
        return {"x": y["v"], "v": -y["x"], "speed": 80.0 - y["speed"]}


def test_a_small_motion_beside_a_large_number_is_no_rest():
    """Numbers of unlike units are not compared: 80 rad/s say nothing of 2 cm."""
    start = {"x": 0.02, "v": 0.0, "speed": 80.0}
    integrator = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-9))
    run = ss.simulate(WithShaft(), 0.0, 20 * np.pi, start, integrator=integrator)
    assert int(run.stats.num_attempts) < 63 / 0.158  # steps long against 1 / rate, or nothing is asked
    assert int(run.flags) & STILL == 0


@pytest.mark.more
def test_a_block_that_sticks_for_good_is_not_doubted():
    """At rest on ground, the state has no rate of its own: its derivative is right with any steps."""
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.0)
    start = Motion(x=jnp.asarray(0.3), v=jnp.asarray(0.0))
    run = ss.simulate(block, 0.0, 50.0, start)
    assert int(run.flags) == 0
    assert jax.grad(lambda x: ss.simulate(block, 0.0, 50.0, Motion(x, 0.0)).y1.x)(0.3) == 1.0
