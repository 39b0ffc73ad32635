"""Random loops of an axis whose friction is regularised or has bristles, and their slopes by gains."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.control import Commanded, WithController
from stickslip.friction import LuGre
from tests.stickslip.control._axis import Axis, under_pid

LOOPS, SAMPLES = 200, 60
# Of each: T_s, the three gains, static friction, where it begins.
LOW, HIGH = (0.005, 20.0, 0.0, 4.0, 1.0, -0.2), (0.03, 80.0, 80.0, 12.0, 2.0, 0.2)


def of_axis(t, y, args):
    """The state of the axis, whatever is beside it."""
    return getattr(y, "y", y)


def end(form, row):
    period, kp, ki, kd, static, x = row
    exact, axis = under_pid(period, kp, ki, kd, static), Axis(static)
    if form == "regularised":
        system, start = axis.regularised(0.02), axis.state(x=x)
    else:
        system = axis.bristles(LuGre, sigma_0=2e3, sigma_1=30.0)
        start = system.start(axis.state(x=x), args=Commanded(0.0, None))
    loop = WithController(system, exact.update, period, exact.initial, measure=of_axis)
    rk4 = ss.Integrator("rk4", ss.FixedStep(period / 64), max_steps=20000)
    run = ss.simulate(loop, 0.0, SAMPLES * period, loop.start(start), integrator=rk4, throw=False)
    return of_axis(0.0, run.y1.y, None).x, (run.flags, run.successful)


@pytest.mark.slow
@pytest.mark.parametrize(("form", "part"), [("regularised", 1e-4), ("bristles", 1e-6)])
def test_slopes_of_two_hundred_random_loops_are_differences(form, part):
    """All 600 to 1e-6 of themselves where the law is smooth, by differences of fourth order.

    Bristles bend at rest: fixed steps over the bend make a motion that is smooth in pieces, narrow
    ones. Differences over a millionth then differ by more than 1e-6 in 15 of the 600.
    """
    rows = np.random.default_rng(11).uniform(LOW, HIGH, (LOOPS, len(LOW)))
    ends = jax.jit(jax.vmap(lambda row: end(form, row)))
    gains = jnp.eye(len(LOW))[1:4]

    def slopes(row):
        return jax.vmap(lambda d: jax.jvp(lambda row: end(form, row)[0], (row,), (d,))[1])(gains)

    found = np.asarray(jax.jit(jax.vmap(slopes))(rows))
    _, (flags, fine) = ends(rows)
    assert np.all(fine)
    assert np.all(flags == 0)
    known = np.empty_like(found)
    for j in range(3):
        moved = {}
        for times in (-2, -1, 1, 2):
            row = rows.copy()
            row[:, 1 + j] += times * part * rows[:, 1 + j]
            moved[times] = np.asarray(ends(row)[0])
        near, far = moved[1] - moved[-1], 0.5 * (moved[2] - moved[-2])
        known[:, j] = (4.0 * near - far) / (6.0 * part * rows[:, 1 + j])
    error = np.sort(np.ravel(np.abs(found - known) / (np.abs(known) + 1e-9)))
    assert error[-1 if form == "regularised" else 580] < 1e-6
    assert error[-1] < 1e-4
