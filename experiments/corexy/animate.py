"""The CoreXY mechanism, moving: its two belts with marks on them, and the pulleys that slip."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import corexy_jax as cx
from stickslip import plot
from stickslip.plot import Movie

from .._experiment import Context, Experiment
from ._machine import BELTS, Machine

KEPT = ("x", "y", "theta", "omega", "omega_v", "dmn", "v", "slip")


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """A scenario of the paper by the consistent law."""
    p, v = cx.scenario(parameters["scenario"])
    end, rows = parameters["begin"] + parameters["duration"], parameters["rows"]
    data = cx.outputs(cx.simulate(p, v, end, rows=rows))[list(KEPT)]
    late = np.asarray(data.time) >= parameters["begin"] - 1e-9
    kept = ("scenario", "frames", "per_second")
    return data.isel(time=late).assign_attrs(r=float(p.r), **{name: parameters[name] for name in kept})


def animate(data: xr.Dataset) -> Movie:
    """Frames of the machine from above; beside it the speeds of motors and belts."""
    time, x, y = (np.asarray(data[name]) for name in ("time", "x", "y"))
    turned, dmn = data.attrs["r"] * np.asarray(data.theta), np.asarray(data.dmn)
    slips = np.stack([np.isin(dmn, (2, 4)), np.isin(dmn, (3, 4))], axis=1)
    frames = int(data.attrs["frames"])
    room = 0.18 * max(np.ptp(x), np.ptp(y), 0.1)
    x, y = x - x.min() + room, y - y.min() + room
    figure = plt.figure(figsize=(7.6, 5.2), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    axis = figure.add_subplot(grid[:, 0])
    (trace,) = axis.plot([], [], color="0.6", lw=0.8, zorder=2)
    machine = Machine(axis, x.max() + room, y.max() + room)
    title = axis.set_title("", fontsize=10)
    cursors = []
    for k in range(2):
        panel = figure.add_subplot(grid[k, 1])
        plot.shade(time, slips[:, k], label="belt slips", color="#f5d0cc", ax=panel)
        panel.plot(time, data.omega.values[:, k], color=BELTS[k], lw=1.2, label="motor")
        panel.plot(time, data.omega_v.values[:, k], color="k", lw=0.9, ls="--", label="belt")
        panel.set(ylabel=f"motor {k + 1} [rad/s]", xlim=(time[0], time[-1]))
        cursors.append(panel.axvline(time[0], color="k", lw=0.8))
    panel.set_xlabel("t [s]")
    panel.legend(fontsize=7, loc="upper right")
    rows = np.linspace(0, time.size - 1, frames).round().astype(int)

    def update(i: int) -> None:
        at = rows[i]
        machine.move(x[at], y[at], turned[at], slips[at])
        trace.set_data(x[: at + 1], y[: at + 1] + 0.5 * machine.gap)
        for cursor in cursors:
            cursor.set_xdata([time[at], time[at]])
        words = [f"belt {k + 1} {'slips' if slips[at, k] else 'rolls'}" for k in range(2)]
        title.set_text(f"scenario {data.attrs['scenario']}, t = {time[at]:.2f} s: {', '.join(words)}")

    return Movie(figure, update, frames, int(data.attrs["per_second"]))


EXPERIMENT = Experiment(
    name="animate-corexy",
    title="CoreXY: an animation of machine, belts and slips",
    parameters={
        "scenario": 1, "begin": 0.0, "duration": 2.0, "rows": 1201, "frames": 120, "per_second": 20,
    },
    quick={"rows": 201, "frames": 20},
    compute=compute,
    draw=lambda data: animate(data).still(),
    animate=animate,
)  # fmt: skip
