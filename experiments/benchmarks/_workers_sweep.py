"""The sweep that the benchmark of workers has computed by other processes."""

import jax.numpy as jnp
import numpy as np
import xarray as xr

import stickslip as ss
from stickslip.sweep import run_sweep
from stickslip.systems import CoulombOscillator, Motion

UNIT = 256  # lanes


def sweep(store: str, units: int = 40, duration: float = 8000.0) -> xr.Dataset:
    """Where a block on a belt is after so many seconds, over the speed of the belt."""

    def lane(belt_speed):
        block = CoulombOscillator(1.0, 1.0, 1.5, 0.5, belt_speed)
        start = Motion(x=jnp.zeros(()), v=belt_speed)
        run = ss.simulate(block, 0.0, duration, start, max_events=None, throw=False)
        return {"x": run.y1.x, "events": run.num_events, "ok": run.successful}

    grid = {"belt_speed": np.linspace(0.2, 0.4, units * UNIT)}
    return run_sweep(lane, grid, store=store, chunk=UNIT)
