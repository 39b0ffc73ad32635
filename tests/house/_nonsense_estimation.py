"""Right arguments of the filter and what it takes."""

import jax
import numpy as np

from stickslip import estimation
from tests.house._nonsense_engine import ARGS, INTEGRATOR, START, STATE, SYSTEM, TIME
from tests.house._nonsense_target import Target, arg


def place(system, t, y, mode, args):
    return {"x": y.x}


NOISE = estimation.Noise({"x": 0.1})
GAUSSIAN = estimation.Gaussian(START, START)
ROWS = jax.tree.map(np.atleast_1d, START)
ESTIMATE = estimation.StateEstimate(
    np.zeros(1), ROWS, np.zeros((1, 2, 2)), np.zeros(1, int), SYSTEM.value, None
)
ROW = np.array([0.1])
FILTERED = estimation.Filtered(
    ESTIMATE, ESTIMATE, np.zeros((1, 1)), np.ones((1, 1, 1)), np.zeros(1), np.zeros(()),
    np.ones((1, 2, 2)), np.ones((1, 1, 2)), np.ones((1, 2, 2)), np.zeros(1, int), None, ("x",),
)  # fmt: skip
TARGETS = [
    Target(
        estimation.Gaussian,
        {"mean": STATE, "spread": arg(np.eye(2)), "mode": arg(None, "none", "whole")},
        lambda **given: estimation.kalman_filter(
            SYSTEM.value, 0.0, estimation.Gaussian(**given), [0.5], {"x": ROW}, place, NOISE
        ),
    ),
    Target(
        estimation.Noise, {"measured": arg({"x": 0.1}, "unknowns"), "process": arg(None, "none")},
        lambda **given: estimation.kalman_filter(
            SYSTEM.value, 0.0, GAUSSIAN, [0.5], {"x": ROW}, place, estimation.Noise(**given)
        ),
    ),
    Target(
        estimation.kalman_filter,
        {
            "system": SYSTEM, "t0": TIME, "start": arg(GAUSSIAN), "t": arg([0.5], "times"),
            "measured": arg({"x": ROW}), "measure": arg(place, "function"), "noise": arg(NOISE),
            "args": ARGS, "integrator": INTEGRATOR,
        },
    ),
    Target(estimation.smooth, {"filtered": arg(FILTERED)}),
    Target(
        estimation.StateEstimate.sense, {"observables": arg(place, "function")}, ESTIMATE.sense
    ),
]  # fmt: skip
