"""Maps a machine designer wants: mode occupancy and slip distance over two parameters."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

import corexy_jax as cx
import stickslip as ss
from corexy_jax import CoreXY
from stickslip.derived import WithIntegrals

from .._experiment import Context, Experiment

DURATION = 6.0
TOLERANCE = 1e-6
PARAMETERS = {"points": 100, "executor": "auto"}
QUICK = {"points": 12}


def occupancy(system: Any, t: Any, y: Any, mode: Any, args: Any) -> dict[str, Any]:
    """Rates of the slip distances, of the times in DMN2-4 and of the time in motion."""
    dmn = system.dmn(mode)
    times = {f"dmn_{k}": jnp.where(dmn == k, 1.0, 0.0) for k in (2, 3, 4)}
    moving = {"moving": jnp.where(system.carriage_rests(mode), 0.0, 1.0)}
    return {**system.slips(t, y, mode, args), **times, **moving}


def lane(parameters: cx.CoreXYParameters, voltage: cx.AbstractVoltage) -> dict[str, Any]:
    """Slip distances [m], shares of the time and largest event count of one machine."""
    system = CoreXY(parameters, voltage)
    ledger = WithIntegrals(system, occupancy)
    step = ss.AdaptiveStep(TOLERANCE, TOLERANCE)
    integrator = ss.Integrator(method="tsit5", step=step)
    found = ss.simulate(
        ledger, 0.0, DURATION, ledger.start(system.state()), integrator=integrator,
        saveat=ss.SaveAt(max_events=None), throw=False,
    )  # fmt: skip
    sums = found.y1.integrals
    shares = {name: sums[name] / DURATION for name in ("dmn_2", "dmn_3", "dmn_4", "moving")}
    rolling = 1.0 - shares["dmn_2"] - shares["dmn_3"] - shares["dmn_4"]
    good = jnp.where(found.successful, 1.0, jnp.nan)
    values = {"slip_1": sums["slip_1"], "slip_2": sums["slip_2"], "dmn_1": rolling, **shares}
    return {name: good * value for name, value in values.items()}


def machine_map(
    name: str,
    title: str,
    axes: tuple[tuple[str, str, str, float, float, bool], ...],
    machine: Callable,
) -> Experiment:
    """Experiment over one or two axes `(name, unit, label, low, high, logarithmic)`.

    `machine(*values) -> (parameters, voltage)`.
    """

    def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
        n = parameters["points"] if len(axes) == 2 else parameters["points"] ** 2
        grids = [(np.geomspace if log else np.linspace)(a, b, n) for *_, a, b, log in axes]
        values = [g.ravel() for g in np.meshgrid(*grids, indexing="ij")]
        run = ss.map_lanes(lambda *v: lane(*machine(*v)), executor=parameters["executor"])
        found = run(*values)
        dims = tuple(axis[0] for axis in axes)
        units = {"slip_1": "m", "slip_2": "m"}
        return xr.Dataset(
            {
                key: (dims, np.asarray(a).reshape([n] * len(axes)), {"units": units.get(key, "1")})
                for key, a in found.items()
            },
            {
                axis[0]: (axis[0], grid, {"units": axis[1], "long_name": axis[2]})
                for axis, grid in zip(axes, grids, strict=True)
            },
        )

    def draw(data: xr.Dataset) -> Figure:
        return _draw_plane(data, axes) if len(axes) == 2 else _draw_line(data, axes[0])

    return Experiment(name, title, PARAMETERS, QUICK, compute, draw)


SHOWN = (
    ("dmn_1", "time in RR"), ("dmn_2", "time in SR"), ("dmn_3", "time in RS"), ("dmn_4", "time in SS"),
    ("moving", "time in motion"),
    ("slip_1", "slip distance of belt 1 [m]"), ("slip_2", "slip distance of belt 2 [m]"),
)  # fmt: skip


def _label(axis) -> str:
    return f"{axis[2]} [{axis[1]}]" if axis[1] != "1" else axis[2]


def _draw_plane(data: xr.Dataset, axes) -> Figure:
    figure, panels = plt.subplots(2, 4, sharex=True, sharey=True, figsize=(13.0, 6.0))
    order = [SHOWN[i] for i in (0, 1, 5, 4, 2, 3, 6)]
    for panel, (name, text) in zip(panels.flat, order, strict=False):
        share = name not in ("slip_1", "slip_2")
        picture = panel.pcolormesh(
            data[axes[0][0]], data[axes[1][0]], data[name].T, cmap="viridis" if share else "magma",
            vmin=0, vmax=1 if share else None, rasterized=True,
        )  # fmt: skip
        figure.colorbar(picture, ax=panel)
        panel.set_title(text, fontsize=9)
    last = panels[1, 3]
    number = 1 + np.argmax([data[f"dmn_{k}"] for k in (1, 2, 3, 4)], axis=0)
    colours = ListedColormap(["#2c7fb8", "#d95f0e", "#31a354", "#bdbdbd"])
    picture = last.pcolormesh(
        data[axes[0][0]], data[axes[1][0]], number.T, cmap=colours, vmin=0.5, vmax=4.5,
        rasterized=True,
    )  # fmt: skip
    bar = figure.colorbar(picture, ax=last, ticks=[1, 2, 3, 4])
    bar.ax.set_yticklabels(["RR", "SR", "RS", "SS"])
    last.set_title("most of the time", fontsize=9)
    for panel in panels.flat:
        for axis, scaled in ((panel.xaxis, axes[0][5]), (panel.yaxis, axes[1][5])):
            if scaled:
                axis.axes.set(**{f"{axis.axis_name}scale": "log"})
                axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                axis.set_major_formatter(StrMethodFormatter("{x:g}"))
                axis.set_minor_formatter(NullFormatter())
    for panel in panels[-1]:
        panel.set_xlabel(_label(axes[0]))
    for panel in panels[:, 0]:
        panel.set_ylabel(_label(axes[1]))
    return figure


def _draw_line(data: xr.Dataset, axis) -> Figure:
    figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(8.0, 5.6))
    for name, text in SHOWN:
        panel = top if name not in ("slip_1", "slip_2") else bottom
        panel.plot(data[axis[0]], data[name], lw=1.0, label=text)
    for panel, label in ((top, "share of the time"), (bottom, "slip distance in 6 s [m]")):
        panel.legend(frameon=False, fontsize=7)
        panel.set_ylabel(label)
    if axis[5]:
        top.set_xscale("log")
    bottom.set_xlabel(_label(axis))
    return figure
