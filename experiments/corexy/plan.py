"""A plan for a machine of one's own: the fastest voltages along a path, as a table."""

import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

import corexy_jax as cx

from .._experiment import Context, Experiment
from ._log import machine_told, read_columns, read_machine
from ._machine import BELTS
from .feedforward import MACHINE

# Ready paths through points [m].
SHAPES = {
    "rectangle": ((0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2), (0.0, 0.0)),
    "triangle": ((0.0, 0.0), (0.3, 0.0), (0.15, 0.2), (0.0, 0.0)),
    "zigzag": ((0.0, 0.0), (0.3, 0.05), (0.0, 0.1), (0.3, 0.15), (0.0, 0.2)),
}


def read_path(text: str, columns: str, units: str) -> np.ndarray:
    """Points of a ready shape, or of a file with the columns x and y, `[point, 2]` [m]."""
    if text in SHAPES:
        return np.array(SHAPES[text])
    path = pathlib.Path(text)
    if not path.is_file():
        raise ValueError(
            f"--set path={text}: it must be one of {', '.join(SHAPES)}, or a file with columns x and y."
        )
    found = read_columns(path, ("x", "y"), columns, units, said="--set path=")
    return np.stack([found["x"], found["y"]], axis=1)


def machine_of(text: str) -> cx.CoreXYParameters:
    """The machine in a file; without one that of `corexy-feedforward`, whose belts hold."""
    return read_machine(text) if text else cx.CoreXYParameters(**MACHINE)


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """The plan at equal distances of time, and on both sides of each jump of a voltage."""
    points = read_path(parameters["path"], parameters["columns"], parameters["units"])
    machine = machine_of(parameters["machine"])
    limits = {name: parameters[name] for name in ("volts", "margin", "tension_error")}
    if parameters["radius"]:
        path = cx.Path.rounded(points, parameters["radius"])
        plan = cx.feedforward_along(machine, path, **limits)
    else:
        plan = cx.feedforward(machine, points, **limits)
    print(machine_told(parameters["machine"], "corexy-feedforward"))
    told = cx.check_rolling(plan)
    print(f"{float(plan.end):.4f} s: {told}")
    begin = np.asarray(plan.at(np.zeros(1)))[0]
    elsewhere = bool(np.hypot(*(begin - points[0])) > 1e-9)
    print(
        f"The machine is at rest at x = {begin[0]:g} m, y = {begin[1]:g} m when the plan begins"
        + (", not at the first point: of a closed path that corner is rounded too." * elsewhere or ".")
    )
    voltage, end = plan.voltage, float(plan.end)
    breaks = np.asarray(voltage.times)
    breaks = breaks[(breaks > 0.0) & (breaks <= end)]
    even = np.arange(0.0, end, 1.0 / parameters["rate"])
    times = np.sort(np.concatenate([even[~np.isin(even, breaks)], breaks, breaks]))
    # A time that stands twice is a jump: first the end of one piece, then the begin of the next.
    later = np.append(False, times[1:] == times[:-1])
    before = np.append(times[1:] == times[:-1], False)
    piece = np.searchsorted(np.asarray(voltage.times), times, side="right") - 1.0 - before
    volts = np.stack(jax.vmap(voltage.volts)(jnp.asarray(times), jnp.asarray(piece)), axis=-1)
    kept = ~later | np.append(True, np.abs(np.diff(volts, axis=0)).max(axis=1) > 0.0)
    return xr.Dataset(
        {
            "volts": (("row", "motor"), volts[kept], {"units": "V"}),
            "place": (("row", "axis"), np.asarray(plan.at(times[kept])), {"units": "m"}),
            "points": (("point", "axis"), points, {"units": "m"}),
        },
        {
            "time": ("row", times[kept], {"units": "s"}), "motor": [1, 2], "axis": ["x", "y"],
        },
        {"report": str(told), "volts_limit": parameters["volts"]},
    )  # fmt: skip


def table(data: xr.Dataset) -> pd.DataFrame:
    """Columns as those of a log: time [s], v1, v2 [V], x, y [m]."""
    names = {
        "v1": data.volts[:, 0],
        "v2": data.volts[:, 1],
        "x": data.place[:, 0],
        "y": data.place[:, 1],
    }
    return pd.DataFrame({"time": data.time.values, **{name: row.values for name, row in names.items()}})


def draw(data: xr.Dataset) -> Figure:
    figure, (way, volts, place) = plt.subplots(1, 3, figsize=(12.0, 3.8))
    way.plot(*data.place.values.T, color=BELTS[0])
    way.plot(*data.points.values.T, "o", ms=3, color="0.3")
    way.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    for k, name in enumerate(("motor 1", "motor 2")):
        volts.plot(data.time, data.volts[:, k], lw=1.0, color=BELTS[k], label=name)
    for k, style in enumerate(("-", "--")):
        place.plot(data.time, data.place[:, k], style, lw=1.0, color="0.3", label="xy"[k])
    volts.set(xlabel="time [s]", ylabel="voltage [V]", title=data.attrs["report"])
    place.set(xlabel="time [s]", ylabel="planned place [m]")
    volts.title.set_size(8)
    for axis in (volts, place):
        axis.legend(frameon=False, fontsize=8)
    return figure


EXPERIMENT = Experiment(
    name="corexy-plan",
    title="CoreXY: the fastest voltages along a path of your own, as a table",
    parameters={
        "path": "rectangle", "radius": 0.0, "machine": "", "volts": 24.0, "margin": 0.9,
        "tension_error": 0.0, "rate": 1000.0, "columns": "", "units": "",
    },
    quick={},
    compute=compute,
    draw=draw,
    table=table,
)  # fmt: skip
