"""Fig. 11: phase planes of the block at k3 = 87.968 N/m, simplified and full model."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.sweep import Compute

from .._experiment import Context, Experiment
from .._thresholds import Block
from ._diagram import MODELS, constructed, integrator_of, lanes_of, system_of, without_sign
from ._draw import COLOURS, caption
from ._exponent import largest_exponents
from ._judge import judge_special


def compute(parameters, context: Context) -> xr.Dataset:
    """Motion and Poincaré points of each model after a transient, and its largest exponent."""
    integrator = integrator_of(parameters)
    parts = []
    first, last = parameters["transient"], parameters["transient"] + parameters["duration"]
    room = 2048 * math.ceil(max(first, last - first) / 300.0)
    for model in MODELS:
        system, start = system_of(model, parameters["k3"], parameters["set"])
        times = first + np.arange(0.0, parameters["shown"], 0.005)
        y = jax.tree.map(jnp.asarray, start)
        mode = jnp.asarray(system.initial_mode(0.0, y, None), jnp.int32)

        def run(t0, t1, y, mode, ts, system=system):
            # The transient is recorded too and its record dropped: one program serves both parts.
            return ss.simulate(
                system, t0, t1, y, mode, integrator=integrator,
                saveat=ss.SaveAt(
                    ts=jnp.asarray(ts), sections=system.zero_acceleration_section(), max_events=None,
                    max_crossings=room,
                ),
            )  # fmt: skip

        settled = run(0.0, first, y, mode, np.linspace(0.0, first, times.size))
        motion = run(first, last, settled.y1, settled.mode1, times)
        points: Any = motion.crossings[0]
        shown: Any = motion.outputs
        exponent = without_sign(
            largest_exponents(
                *lanes_of(model, np.array([parameters["k3"]]), parameters["set"]),
                start,
                transient=first,
                segments=parameters["segments"],
                integrator=integrator,
                compute=Compute(parameters["executor"]),
            )
        )
        parts.append(
            xr.Dataset(
                {
                    "x": ("time", np.asarray(shown.y.x), {"units": "m"}),
                    "vx": ("time", np.asarray(shown.y.vx), {"units": "m/s"}),
                    "x_section": ("point", np.asarray(points.y.x), {"units": "m"}),
                    "vx_section": ("point", np.asarray(points.y.vx), {"units": "m/s"}),
                    "exponent": exponent.exponent.isel(k3=0, drop=True),
                    "spread": exponent.spread.isel(k3=0, drop=True),
                },
                {"time": ("time", times, {"units": "s"})},
            )
        )
    result = xr.concat(parts, xr.Variable("model", list(MODELS)))
    text = constructed(parameters)
    return result.assign_attrs(k3=parameters["k3"], set=parameters["set"], caption=text)


def draw(dataset: xr.Dataset) -> Figure:
    """Velocity over displacement, Poincaré points in red."""
    figure, axes = plt.subplots(
        1, dataset.sizes["model"], sharex=True, sharey=True, figsize=(11.5, 4.4)
    )
    for axis, model in zip(axes, dataset.model.values, strict=True):
        part = dataset.sel(model=model)
        axis.plot(part.x, part.vx, color=COLOURS[model], linewidth=0.4, alpha=0.7)
        axis.plot(part.x_section, part.vx_section, "o", color="red", markersize=2.5, zorder=3)
        exponent = f"{float(part.exponent):.3f} ± {float(part.spread):.3f} 1/s"
        axis.set_title(f"{model}, $k_3$ = {dataset.attrs['k3']:g} N/m\nexponent {exponent}", fontsize=9)
        axis.set_xlabel("displacement $x$ [m]")
    axes[0].set_ylabel("velocity $\\dot x$ [m/s]")
    caption(figure, dataset)
    return figure


EXPERIMENT = Experiment(
    name="block-fig11",
    title=f"Phase planes of the block on a belt at k3 = {Block.SPECIAL:g} N/m, both models",
    parameters={
        "set": "A", "k3": Block.SPECIAL, "transient": 300.0, "duration": 300.0, "shown": 40.0,
        "segments": 300, "h": 1e-3, "tolerance": 1e-8, "method": "tsit5", "executor": "auto",
    },
    quick={
        "transient": 60.0, "duration": 60.0, "shown": 20.0, "segments": 40, "executor": "portable",
    },
    compute=compute,
    draw=draw,
    judge=judge_special,
)  # fmt: skip
