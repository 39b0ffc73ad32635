"""The machine as a log of one's own saw it: no model computes anything."""

import functools
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from stickslip.plot import Movie

from .._experiment import Context, Experiment
from .._settings import refused
from ._film import film
from ._log import ANGLES, PLACES, SPEEDS, machine_told, read_columns, read_machine, times_of
from ._machine import BELTS


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Place of the collar and ways of the motors' rims, from what of both the log has.

    Without places the belts are taken to roll, and without angles the motors: then what belts and
    motors do is the same. Without angles speeds are summed.
    """
    path = context.data
    assert path is not None
    found = read_columns(
        path, ("time",), parameters["columns"], parameters["units"], parameters["counts_per_turn"]
    )
    times = times_of(path, found)
    turned = _both(found, ANGLES)
    if turned is None and (speeds := _both(found, SPEEDS)) is not None:
        steps = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)[:, None]
        turned = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    radius = float(read_machine(parameters["machine"]).r)
    if turned is not None:
        print(machine_told(parameters["machine"]))
    place, rims = _both(found, PLACES), None if turned is None else radius * turned
    if place is None and rims is None:
        raise ValueError(
            f"--data {path}: it must have the columns x and y, or theta_1 and theta_2, or omega_1 and "
            "omega_2. Name others by --set columns=theta_1=a,theta_2=b"
        )
    belts_by = "belt, as if it rolled" if place is None else "belt, by x and y"
    if place is None and rims is not None:
        place = 0.5 * np.stack([rims[:, 0] + rims[:, 1], rims[:, 0] - rims[:, 1]], axis=1)
    assert place is not None
    belts = np.stack([place[:, 0] + place[:, 1], place[:, 0] - place[:, 1]], axis=1)
    rims = belts if rims is None else rims
    frames = 1 + int(times[-1] * parameters["per_second"] / parameters["speed"])
    if not 2 <= frames <= Movie.most:
        raise refused(
            "speed", parameters["speed"], f"such that {frames:,} frames are 2 to {Movie.most}"
        )
    return xr.Dataset(
        {
            "x": ("time", place[:, 0], {"units": "m"}), "y": ("time", place[:, 1], {"units": "m"}),
            "rims": (("time", "motor"), rims - rims[0], {"units": "m"}),
            "belts": (("time", "motor"), belts - belts[0], {"units": "m"}),
        },
        {"time": ("time", times, {"units": "s"}), "motor": [1, 2]},
        {
            "log": path.name, "belts_by": belts_by, "frames": frames,
            "per_second": parameters["per_second"],
        },
    )  # fmt: skip


def _both(found: dict[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray | None:
    """Two columns, `[row, 2]`, where the log has both."""
    if not all(name in found for name in names):
        return None
    return np.stack([found[name] for name in names], axis=1)


def _curves(data: xr.Dataset, axis: Axes, k: int) -> None:
    axis.plot(data.time, data.rims[:, k], color=BELTS[k], lw=1.2, label="rim of the motor")
    axis.plot(data.time, data.belts[:, k], "k--", lw=0.9, label=data.attrs["belts_by"])
    axis.set_ylabel(f"way of motor {k + 1} [m]")


def animate(data: xr.Dataset) -> Movie:
    """Frames of the machine from above; beside it the ways of the motors' rims and of the belts.

    A log does not say when a belt slips: it does where the two ways part.
    """
    time = np.asarray(data.time)
    place, rims = np.stack([data.x, data.y], axis=1), np.asarray(data.rims)
    return film(
        time, place, rims, np.zeros(rims.shape, dtype=bool), functools.partial(_curves, data),
        lambda row: f"{data.attrs['log']}, t = {time[row]:.2f} s", int(data.attrs["frames"]),
        int(data.attrs["per_second"]),
    )  # fmt: skip


RECORDED = Experiment(
    name="animate-corexy",
    title="CoreXY: an animation of a log of your own",
    parameters={
        "columns": "", "units": "", "counts_per_turn": 0.0, "machine": "", "speed": 1.0,
        "per_second": 20,
    },
    quick={},
    compute=compute,
    draw=lambda data: animate(data).still(),
    animate=animate,
)  # fmt: skip
