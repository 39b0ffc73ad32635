"""Two motions of the block on a belt at one k3, with the set that the search found."""

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from experiments.block._diagram import system_of
from stickslip.basin import Settle, basins
from stickslip.sweep import map_lanes
from stickslip.systems import BlockState

K3 = 88.2
BOX = {"x": (-0.03, 0.1), "vx": (-0.3, 0.3), "y": (-0.3, 0.3), "vy": (-2.0, 2.0)}
STEPS = ss.Integrator(step=ss.AdaptiveStep(1e-8))


def spread_of_peaks(x, vx, y, vy):
    """Of x over 20 s after 280 s: next to none on the small orbit, which is of a period of 0.9 s."""
    system = system_of("simplified", K3, "found")[0]
    run = ss.simulate(system, 0.0, 280.0, BlockState(x, vx, y, vy), integrator=STEPS, throw=False)
    end = ss.simulate(
        system, 280.0, 300.0, run.y1, run.mode1, integrator=STEPS, throw=False,
        saveat=ss.SaveAt(ts=280.0 + jnp.linspace(0.0, 20.0, 1000)),
    )  # fmt: skip
    row = end.outputs.y.x
    peaks = (row[1:-1] >= row[:-2]) & (row[1:-1] > row[2:])
    high, low = (jnp.where(peaks, row[1:-1], side * jnp.inf) for side in (-1.0, 1.0))
    return jnp.max(high) - jnp.min(low)


@pytest.mark.slow
def test_the_share_of_the_small_orbit_is_that_of_many_runs():
    system, start = system_of("simplified", K3, "found")
    found = basins(system, start, BOX, Settle(900.0), points=256, integrator=STEPS)
    periods = {
        a.name: float(a.motion.period) / int(a.motion.repeats)
        for a in found.attractors
        if a.kind == "orbit"
    }
    small = min(periods, key=periods.get)
    assert periods[small] == pytest.approx(0.90966, abs=1e-4)
    random = np.random.default_rng(7).uniform(*np.array(list(BOX.values())).T, (4096, 4))
    peaks = np.asarray(map_lanes(spread_of_peaks)(*random.T))
    share = float(np.mean(peaks < 2e-3))
    assert 0.3 < share < 0.6
    error = np.hypot(found.errors[small], np.sqrt(share * (1.0 - share) / len(random)))
    assert abs(found.shares[small] - share) < 3.0 * error
