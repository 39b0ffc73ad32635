"""A sampled controller hunts with a period of whole samples, which the continuation finds."""

import jax
import jax.numpy as jnp
import pytest

import stickslip as ss
from stickslip.continuation import orbit_guess, periodic_orbit
from stickslip.control import PID, WithController
from tests.stickslip.control._axis import Axis

SAMPLE = 0.05  # [s]


@pytest.mark.slow
def test_hunting_of_a_sampled_controller_is_a_periodic_orbit():
    """It closes; and a simulation beside it leaves it by its largest multiplier in each period."""
    pid = PID(50.0, 200.0, 10.0, period=SAMPLE, limit=20.0)
    loop = WithController(Axis(), pid, SAMPLE, pid.state())
    start = loop.start(loop.system.state(x=0.1))
    guess = orbit_guess(loop, start, transient=60.0, max_period=12.0, forcing_period=SAMPLE)
    orbit = periodic_orbit(loop, guess, forced=True)
    assert float(orbit.period) / SAMPLE == pytest.approx(99.0, abs=1e-9)

    def after(y, periods):
        return ss.simulate(loop, orbit.t0, orbit.t0 + periods * orbit.period, y).y1

    away = [
        abs(a - b) for a, b in zip(*map(jax.tree.leaves, (after(orbit.y0, 1), orbit.y0)), strict=True)
    ]
    assert max(map(float, away)) < 1e-8
    beside = orbit.y0._replace(state=orbit.y0.state._replace(integral=orbit.y0.state.integral + 1e-8))
    once, twice = (
        float(after(beside, n).state.integral - after(orbit.y0, n).state.integral) for n in (1, 2)
    )
    largest = float(jnp.max(jnp.abs(orbit.multipliers)))
    assert largest > 10.0
    assert abs(twice / once) == pytest.approx(largest, rel=1e-3)
