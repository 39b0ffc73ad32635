"""Orbits and regions of the block's diagrams for the viewer: `--with experiments.block.view`.

The parameters are those of the figures by default: set A, adaptive steps at 1e-8.
"""

import functools
from typing import Any

import numpy as np
import xarray as xr

from stickslip.analysis import PeriodTest, Recording, Samples, orbit_diagram, time_history
from stickslip.sweep import Compute, Labels

from ._diagram import LABELS, MODELS, PROTOCOL, integrator_of, system_of

LANES = 201  # of a region: one number, so that a second region compiles nothing
SHOWN, INTERVAL = 6.0, 0.002  # of an orbit [s]
OBSERVABLES = {"x": "x", "velocity": "vx"}


def orbit(k3: float, model: str = MODELS[0], protocol: str = "paper") -> xr.Dataset:
    """Six seconds of the motion at `k3` [N/m] after the transient that `protocol` drops.

    Returns `x` [m] and `velocity` [m/s] of the block over `time` [s].
    """
    transient, _ = _times(protocol)
    system, start = system_of(model, float(k3))
    times = transient + np.arange(round(SHOWN / INTERVAL) + 1) * INTERVAL
    return time_history(
        system, start, Samples(times, transient), OBSERVABLES, integrator=integrator_of(PROTOCOL)
    )


def diagram(k3: tuple[float, float], model: str = MODELS[0], protocol: str = "paper") -> xr.Dataset:
    """The diagram of `model` between two values of k3 [N/m], with as much dropped as in the figures."""
    transient, duration = _times(protocol)
    low, high = map(float, k3)
    system, start = system_of(model, low)
    return orbit_diagram(
        _builder(model),
        {"k3": np.linspace(low, high, LANES)},
        start,
        Recording(
            transient, duration, system.zero_acceleration_section(), "x",
            max_points=PROTOCOL["max_points"], period=PeriodTest(1e-3), check=0,
        ),
        integrator=integrator_of(PROTOCOL),
        labels=Labels(
            LABELS, name=f"{model}, {protocol} protocol, k3 from {low:.7g} to {high:.7g} N/m"
        ),
        compute=Compute(progress=False),
    )  # fmt: skip


@functools.cache
def _builder(model: str) -> Any:
    # The same function at every call: what was traced for it is known again.
    return lambda k3: system_of(model, k3)[0]


def _times(protocol: str) -> tuple[float, float]:
    """Time dropped and recorded [s]."""
    before = "converged_" if protocol == "converged" else ""
    return PROTOCOL[f"{before}transient"], PROTOCOL[f"{before}duration"]
