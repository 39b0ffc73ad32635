"""The picture the paper lacks: the dead zone of the mechanism, in torques and in voltages."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import corexy_jax as cx
from corexy_jax import motor_torque

from .._experiment import Context, Experiment
from ._draw import BAND, COLOURS


def _compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    t = np.linspace(0.0, 2.0, parameters["points"])
    torque, voltage, path, path_torque, axis = [], [], [], [], []
    for number in (1, 2, 3):
        p, v = cx.scenario(number)
        torque.append(cx.torque_dead_zone(p))
        voltage.append(cx.voltage_dead_zone(p))
        volts = np.array([[float(a) for a in v(time)] for time in t])
        path.append(volts)
        path_torque.append(np.asarray(motor_torque(p, volts, 0.0)))
        axis.append([float(a) for a in cx.axis_dead_zones(p, 1.0, 1.0)])
    lanes = ("scenario", "corner", "motor")
    steps = ("scenario", "time", "motor")
    return xr.Dataset(
        {
            "torque": (lanes, np.array(torque), {"units": "N m"}),
            "voltage": (lanes, np.array(voltage), {"units": "V"}),
            "path": (steps, np.array(path), {"units": "V"}),
            "path_torque": (steps, np.array(path_torque), {"units": "N m"}),
            "axis": (("scenario", "direction"), np.array(axis), {"units": "N m"}),
        },
        {"scenario": [1, 2, 3], "motor": [1, 2], "time": ("time", t, {"units": "s"})},
    )


def _draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 3, figsize=(10.5, 7.0))
    for column, number in enumerate(data.scenario.values):
        part = data.sel(scenario=number)
        rows = (("torque", "path_torque", r"\tau", "N m"), ("voltage", "path", "v", "V"))
        for axis, (zone, path, symbol, unit) in zip(axes[:, column], rows, strict=True):
            corners = np.asarray(part[zone])
            axis.fill(*corners.T, color=BAND, label="nothing moves (belts hold)")
            axis.plot(*np.vstack([corners, corners[:1]]).T, color="0.4", lw=0.8)
            axis.plot(*np.asarray(part[path]).T, ".-", ms=2, lw=0.7, color=COLOURS["consistent"],
                      label="input at rest")  # fmt: skip
            axis.set_xlabel(f"${symbol}_1$ [{unit}]")
            axis.set_ylabel(f"${symbol}_2$ [{unit}]")
            axis.set_aspect("equal", "datalim")
            if zone == "torque":
                x, y = (float(b) for b in part.axis)
                square = (
                    np.array([[x + y, x - y], [x - y, x + y], [-x - y, y - x], [y - x, -x - y]]) / 2
                )
                axis.plot(
                    *np.vstack([square, square[:1]]).T, ":", color="#c0392b", lw=1.0,
                    label="one dead zone per axis",
                )  # fmt: skip
                axis.set_title(f"scenario {int(number)}", fontsize=9)
    axes[0, 0].legend(frameon=False, fontsize=7)
    return figure


EXPERIMENT = Experiment(
    name="corexy-dead-zone",
    title="CoreXY: the dead zone as a zonotope of torques, and in the plane of the voltages",
    parameters={"points": 401},
    quick={"points": 41},
    compute=_compute,
    draw=_draw,
)
