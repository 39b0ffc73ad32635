"""Gains tuned through the exact motion, under static friction that is known with an interval only."""

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

import stickslip as ss
from tests.stickslip.control._axis import begin, under_pid
from tests.stickslip.control._reference import Loop

T = 0.02
STATIC = np.array([1.2, 1.5, 1.8])
SEEN = np.arange(60, 201, 10)
# A rule for an inertia of 1 kg: a pole of third order at -w, a tenth of the rate of samples.
W = 0.1 / T
RULE = np.array([3 * W**2, W**3, 3 * W])


def off(gains, static):
    """Root mean square of the error from 1.2 s to 4 s after a step of 0.1 m."""
    loop = under_pid(T, *gains, static)
    saved = ss.SaveAt(ts=SEEN * T, events=False)
    run = ss.simulate(loop, 0.0, 4.0, begin(loop), saveat=saved, throw=False)
    return jnp.sqrt(jnp.mean(run.outputs.y.y.x**2))


def worst(logarithms):
    return jnp.max(ss.map_lanes(lambda static: off(jnp.exp(logarithms), static))(STATIC))


def exact(logarithms, statics=STATIC):
    """The same in closed form."""
    gains = np.exp(logarithms)
    rows = [[Loop(T, *gains, static).run(n, 0.1)[0] for n in SEEN] for static in statics]
    return float(np.max(np.sqrt(np.mean(np.square(rows), axis=1))))


@pytest.mark.more
def test_gains_from_the_gradient_are_better_in_the_worst_case_than_those_of_a_rule():
    step = jax.jit(jax.value_and_grad(worst))
    z = np.log(RULE)
    optimiser = optax.adam(0.05)
    state, found = optimiser.init(z), []
    for i in range(40):
        cost, slope = step(z)
        if i % 13 == 0:
            assert float(cost) == pytest.approx(exact(z), abs=1e-12)
            for j, h in enumerate(1e-6 * np.eye(3)):
                ends = exact(z - h), exact(z + h)
                assert float(slope[j]) == pytest.approx((ends[1] - ends[0]) / 2e-6, rel=1e-6, abs=1e-9)
        found.append((float(cost), z))
        with jax.numpy_dtype_promotion("standard"):  # as optax needs it
            change, state = optimiser.update(slope, state)
        z = np.asarray(z + change)
    best = min(found, key=lambda pair: pair[0])[1]
    # Between the values that it was tuned for, too.
    between = np.linspace(1.2, 1.8, 13)
    assert exact(np.log(RULE), between) == pytest.approx(9.022e-3, rel=1e-3)
    assert exact(best, between) < 1e-4
