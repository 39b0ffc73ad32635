"""Events in steps so short that a part of them is less than the rounding of the time."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion
from tests.stickslip.hybrid._loads import Block


class Growth(NamedTuple):
    """A load that grows by a factor of e in each `time`, and is 1 N `before` the time `at` [s]."""

    at: Any
    before: Any
    time: Any

    def __call__(self, t):
        """Force [N]."""
        return jnp.exp((t - self.at + self.before) / self.time)


def run(at, t0, h):
    fixed = ss.Integrator(step=ss.FixedStep(h))
    # Between two numbers, so that no time can be told at which the guard is zero.
    before = 0.4 * np.spacing(max(t0, h))
    block, rest = Block(Growth(at, before, h)), Motion(0.0, 0.0)
    return ss.simulate(block, t0, t0 + 8 * h, rest, integrator=fixed, saveat=ss.SaveAt(max_events=8))


@pytest.mark.more
@pytest.mark.parametrize(("t0", "h"), [(0.0, 1e-4), (29.0, 8e-6), (29.0, 1e-7), (1e6, 1e-3)])
def test_an_event_in_a_short_step_is_no_grazing(t0, h):
    at = jnp.asarray(t0 + 3.4 * h)
    solution = run(at, t0, h)
    assert int(solution.num_events) == 1
    assert int(solution.flags) == 0
    np.testing.assert_allclose(solution.events.t[0], at, rtol=4e-16, atol=1e-12 * h)
    slope = jax.jacfwd(lambda at: run(at, t0, h).events.t[0])(at)
    # The slope of the guard there is known as well as the time is.
    np.testing.assert_allclose(slope, 1.0, rtol=1e-9 + 1e-15 * t0 / h)


class Bent(CoulombOscillator):
    """The oscillator with a guard at rest that is no straight line: it is looked at inside of steps."""

    guard_scales = None

    def guards(self, t, y, mode, args):
        (value,) = super().guards(t, y, mode, args)
        return (jnp.where(mode == 1, self.static_force - jnp.abs(self.stiffness * y.x), value),)


def held(speed):
    block = Bent(1.0, 1.0, 1.0, 0.5, speed)
    fixed = ss.Integrator(step=ss.FixedStep(0.2))
    return ss.simulate(
        block, 0.0, 4.1, Motion(0.0, speed), integrator=fixed, saveat=ss.SaveAt(max_events=4)
    )


@pytest.mark.more
def test_a_guard_that_reaches_zero_as_a_step_ends_is_found_in_the_next():
    """The limit 1 N is reached at t = 4, after twenty steps, to rounding."""
    speed = jnp.asarray(0.25)
    solution = held(speed)
    np.testing.assert_allclose(solution.events.t[0], 4.0, rtol=0, atol=1e-14)
    assert int(solution.flags) == 0
    assert int(solution.stats.num_attempts) <= 28
    slope = jax.jacfwd(lambda speed: held(speed).events.t[0])(speed)
    np.testing.assert_allclose(slope, -16.0, rtol=1e-10)
