"""The CoreXY mechanism, moving: its two belts with marks on them, and the pulleys that slip."""

import functools
import pathlib
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

import corexy_jax as cx
from stickslip import plot
from stickslip.plot import Movie

from .._experiment import Context, Experiment
from ._film import film
from ._log import NEEDED, machine_told, read_columns
from ._machine import BELTS
from ._recorded import RECORDED
from .plan import machine_of

KEPT = ("x", "y", "theta", "omega", "omega_v", "dmn", "v", "slip")


def read_plan(text: str) -> tuple[cx.Ramps, dict[str, Any]]:
    """The voltages of a plan that `corexy-plan` wrote, linear from row to row, where a time stands
    twice with a jump; and the keywords of a run under them.

    Errors: `ValueError` naming the file.
    """
    found = read_columns(pathlib.Path(text), NEEDED, None, said="--set plan=")
    times, volts = found["time"], np.stack([found["v1"], found["v2"]], axis=1)
    steps = np.diff(times)
    if times.size < 2 or times[0] != 0.0 or np.any(steps < 0.0) or not times[-1] > 0.0:
        raise ValueError(f"--set plan={text}: its times must begin at 0 and not decrease.")
    slopes = np.diff(volts, axis=0)[steps > 0.0] / steps[steps > 0.0, None]
    begins, ends = np.flatnonzero(steps > 0.0), np.flatnonzero(steps > 0.0) + 1
    # Rows between breaks lie on one line: the engine need not stop at them.
    meet = np.all(np.isclose(volts[ends[:-1]], volts[begins[1:]], rtol=0.0, atol=1e-9), axis=1)
    alike = np.all(np.isclose(slopes[:-1], slopes[1:], rtol=1e-6, atol=1e-6), axis=1)
    new = np.append(True, ~(meet & alike))
    rows = [np.append(times[begins][new], times[-1])]
    rows += [np.append(column[begins][new], 0.0) for column in volts.T]
    rows += [np.append(column[new], 0.0) for column in slopes.T]
    return cx.Ramps(*rows), {name: found[name] for name in ("time", "x", "y") if name in found}


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """A scenario of the paper by the consistent law, or the machine under the voltages of a plan."""
    begin, rows = parameters["begin"], parameters["rows"]
    if parameters["plan"]:
        p = machine_of(parameters["machine"])
        v, planned = read_plan(parameters["plan"])
        end, name = 1.1 * float(v.times[-1]), pathlib.Path(parameters["plan"]).name
        start = cx.CoreXY(p, v).state(**{key: planned[key][0] for key in ("x", "y") if key in planned})
    else:
        p, v = cx.scenario(parameters["scenario"])
        end, name, start = begin + parameters["duration"], f"scenario {parameters['scenario']}", None
    data = cx.outputs(cx.simulate(p, v, end, rows=rows, y0=start))[list(KEPT)]
    if parameters["plan"]:
        print(machine_told(parameters["machine"], "corexy-feedforward"))
        print(_off_the_plan(data, planned))
    late = np.asarray(data.time) >= begin - 1e-9
    kept = {key: parameters[key] for key in ("frames", "per_second")}
    return data.isel(time=late).assign_attrs(r=float(p.r), drive=name, **kept)


def _off_the_plan(data: xr.Dataset, planned: dict[str, Any]) -> str:
    """How far the collar gets from where the plan has it."""
    if not {"x", "y", "time"} <= set(planned):
        return "The plan does not say where the collar is to be."
    time = np.asarray(data.time)
    time, rows = time[time <= planned["time"][-1]], slice(0, int(np.sum(time <= planned["time"][-1])))
    off = [np.asarray(data[k])[rows] - np.interp(time, planned["time"], planned[k]) for k in "xy"]
    size = 1e3 * np.hypot(*off)
    return f"The collar gets up to {size.max():.3g} mm off the plan, and ends {size[-1]:.3g} mm off."


def _slips(data: xr.Dataset) -> np.ndarray:
    """Whether each belt slips, `[row, 2]`."""
    dmn = np.asarray(data.dmn)
    return np.stack([np.isin(dmn, (2, 4)), np.isin(dmn, (3, 4))], axis=1)


def _curves(data: xr.Dataset, axis: Axes, k: int) -> None:
    plot.shade(np.asarray(data.time), _slips(data)[:, k], label="belt slips", color="#f5d0cc", ax=axis)
    axis.plot(data.time, data.omega.values[:, k], color=BELTS[k], lw=1.2, label="motor")
    axis.plot(data.time, data.omega_v.values[:, k], color="k", lw=0.9, ls="--", label="belt")
    axis.set_ylabel(f"motor {k + 1} [rad/s]")


def animate(data: xr.Dataset) -> Movie:
    """Frames of the machine from above; beside it the speeds of motors and belts."""
    time, slips = np.asarray(data.time), _slips(data)

    def words(row: int) -> str:
        said = [f"belt {k + 1} {'slips' if slips[row, k] else 'rolls'}" for k in range(2)]
        return f"{data.attrs['drive']}, t = {time[row]:.2f} s: {', '.join(said)}"

    return film(
        time, np.stack([data.x, data.y], axis=1), data.attrs["r"] * np.asarray(data.theta), slips,
        functools.partial(_curves, data), words, int(data.attrs["frames"]),
        int(data.attrs["per_second"]),
    )  # fmt: skip


EXPERIMENT = Experiment(
    name="animate-corexy",
    title="CoreXY: an animation of machine, belts and slips",
    parameters={
        "scenario": 1, "plan": "", "machine": "", "begin": 0.0, "duration": 2.0, "rows": 1201,
        "frames": 120, "per_second": 20,
    },
    quick={"rows": 201, "frames": 20},
    compute=compute,
    draw=lambda data: animate(data).still(),
    animate=animate,
    measured=RECORDED,
)  # fmt: skip
