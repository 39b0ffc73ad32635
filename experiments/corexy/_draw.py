"""Pictures of one scenario, laid out as the paper's captions say."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

COLOURS = {"consistent": "#1f4e9c", "as printed": "#b7791f", "errata corrected": "#3d7a4b"}
VIRTUAL, BAND = "#c0392b", "#d9d9d9"
SHOWN = ("as printed", "consistent")  # the one on top last


def _time_axes(axes, data):
    for axis in np.ravel(axes):
        axis.set_xlim(0, float(data.time[-1]))
    for axis in np.atleast_1d(axes[-1]):
        axis.set_xlabel("$t$ [s]")


def _head(figure, data, text):
    figure.suptitle(f"Scenario {data.attrs['scenario']}: {text}", fontsize=10)


def _legend(axis, **options):
    axis.legend(frameon=False, fontsize=7, **options)


def _legend_above(axis):
    """A legend over the curves, with room made for it."""
    low, high = axis.get_ylim()
    axis.set_ylim(low, high + 0.18 * (high - low))
    _legend(axis, loc="upper center", ncols=2)


def _lines(axis, data, name, label, select=None, scale=1.0):
    for way in SHOWN:
        part = data.sel(way=way) if select is None else data.sel(way=way, **select)
        on_top = way == "consistent"
        axis.plot(
            part.time, scale * part[name], color=COLOURS[way], lw=1.1 if on_top else 0.6,
            alpha=1.0 if on_top else 0.7, label=way, rasterized=True,
        )  # fmt: skip
    axis.set_ylabel(label)


def draw_motion(data: xr.Dataset) -> Figure:
    """(a) motors and virtual pulleys, (b) torques with dead zones and motion along x and y."""
    figure = plt.figure(figsize=(11.5, 8.2))
    halves: Any = figure.subfigures(1, 2)
    left, right = halves
    axes = left.subplots(3, 2, sharex=True)
    names = (
        ("alpha", r"$\alpha$ [rad/s²]"),
        ("omega", r"$\omega$ [rad/s]"),
        ("theta", r"$\theta$ [rad]"),
    )
    for row, (name, label) in zip(axes, names, strict=True):
        for axis, motor in zip(row, (1, 2), strict=True):
            _lines(axis, data, name, label, {"motor": motor})
            part = data.sel(way="consistent", motor=motor)
            axis.plot(
                part.time, part[f"{name}_v"], "--", color=VIRTUAL, lw=0.9,
                label="virtual pulley (consistent)", rasterized=True,
            )  # fmt: skip
            if name == "alpha":
                axis.set_title(f"motor {motor}", fontsize=9)
                size = np.nanquantile(np.abs(data.sel(way="consistent").alpha), 0.999)
                axis.set_ylim(-1.2 * size, 1.2 * size)
    _legend(axes[0, 0])
    _time_axes(axes, data)
    left.suptitle("(a)", x=0.02, ha="left", fontsize=9)
    axes = right.subplots(4, 2, sharex=True)
    for column, axis_name in enumerate(("x", "y")):
        part = data.sel(way="consistent")
        bound = part[f"dead_{axis_name}"]
        axis = axes[0, column]
        axis.fill_between(part.time, -bound, bound, color=BAND, lw=0, label="dead zone at rest")
        _lines(axis, data, f"tau_{axis_name}", rf"$\tau_{axis_name}$ [N m]")
        axis.set_title(f"along {axis_name}", fontsize=9)
        for row, (prefix, unit) in enumerate((("a", "m/s²"), ("v", "m/s"), ("", "m")), start=1):
            name = f"{prefix}{axis_name}"
            _lines(axes[row, column], data, name, f"{name} [{unit}]")
    _legend(axes[0, 0])
    _time_axes(axes, data)
    right.suptitle("(b)", x=0.02, ha="left", fontsize=9)
    _head(figure, data, "motors and central mechanism")
    return figure


def draw_planes(data: xr.Dataset) -> Figure:
    """(a) trajectories and the input in planes, (b) voltages with mapped dead zones, torques."""
    figure = plt.figure(figsize=(11.5, 6.4))
    halves: Any = figure.subfigures(1, 2)
    left, right = halves
    axes = left.subplots(2, 2)
    for axis, (x, y, unit) in zip(
        axes.flat, (("x", "y", "m"), ("vx", "vy", "m/s"), ("ax", "ay", "m/s²")), strict=False
    ):
        for way in SHOWN:
            part = data.sel(way=way)
            axis.plot(part[x], part[y], color=COLOURS[way], lw=0.8, label=way, rasterized=True)
            # What never moves is a point.
            axis.plot(part[x][0], part[y][0], ".", color=COLOURS[way], ms=4)
        axis.locator_params(axis="x", nbins=4)
        axis.set_xlabel(f"{x} [{unit}]")
        axis.set_ylabel(f"{y} [{unit}]")
    _legend(axes[0, 0])
    draw_voltage_plane(axes[1, 1], data)
    left.suptitle("(a)", x=0.02, ha="left", fontsize=9)
    axes = right.subplots(2, 2, sharex=True)
    for column, motor in enumerate((1, 2)):
        part = data.sel(way="consistent", motor=motor)
        axis = axes[0, column]
        axis.fill_between(
            part.time, part.v_low, part.v_high, color=BAND, lw=0, label="mapped dead zone"
        )
        axis.plot(part.time, part.v, color=COLOURS["consistent"], lw=1.1, label=f"$v_{motor}$")
        axis.set_ylabel(f"$v_{motor}$ [V]")
        axis.set_title(f"motor {motor}", fontsize=9)
        _legend_above(axis)
        _lines(axes[1, column], data, "tau_belt", "torque on the belt [N m]", {"motor": motor})
    _legend_above(axes[1, 0])
    _time_axes(axes, data)
    right.suptitle("(b)", x=0.02, ha="left", fontsize=9)
    _head(figure, data, "planes, voltages and torques on the belts")
    return figure


def draw_voltage_plane(axis, data: xr.Dataset) -> None:
    """The input path over the dead zone of the machine at rest."""
    part = data.sel(way="consistent")
    corners = np.asarray(part.v_corner)
    axis.fill(*corners.T, color=BAND, label="dead zone at rest")
    axis.plot(*np.asarray(part.v).T, color=COLOURS["consistent"], lw=1.0, label="input")
    axis.set_xlabel("$v_1$ [V]")
    axis.set_ylabel("$v_2$ [V]")
    _legend_above(axis)


def draw_modes(data: xr.Dataset) -> Figure:
    """Dynamic model number over time, a row per way."""
    ways = list(data.way.values)
    figure, axes = plt.subplots(len(ways), 1, sharex=True, figsize=(8.0, 4.6))
    for axis, way in zip(axes, ways, strict=True):
        part = data.sel(way=way)
        axis.plot(part.time, part.dmn, ".", ms=1.6, mew=0, color=COLOURS[way], rasterized=True)
        shares = [float(np.mean(part.dmn == k)) for k in (1, 2, 3, 4)]
        axis.set_yticks([1, 2, 3, 4], [f"{k} {n} {s:.1%}" for k, n, s in zip(
            (1, 2, 3, 4), ("RR", "SR", "RS", "SS"), shares, strict=True)], fontsize=7)  # fmt: skip
        axis.set_ylim(0.5, 4.5)
        axis.set_title(way, fontsize=9)
    _time_axes(axes, data)
    _head(figure, data, "dynamic model")
    return figure
