"""A file of G-code, printed: how far the head is off its lines, and what the motors have left."""

import functools
import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy import signal

import stickslip as ss
from corexy_jax import elastic
from stickslip.control import InputShaper
from stickslip.plot import Movie

from .._experiment import Context, Experiment
from ._film import film
from ._machine import BELTS
from ._printer import Machine, read_printer

BED = 0.25  # m, of the constructed printer
EXAMPLE = """\
; a square with a cut corner, a circle, a zigzag
G21
G90
G0 X105 Y105 F12000
G1 X145 F6000
G1 Y135
G1 X135 Y145
G1 X105
G1 Y105
G0 X133 Y125 F12000
G3 X133 Y125 I-8 J0 F3000
G0 X110 Y110 F12000
G1 X140 Y112 F6000
G1 X110 Y114
G1 X140 Y116
G1 X110 Y118
"""


def read_file(text: str) -> elastic.Moves:
    """Moves of a file, or of the example without one. Errors: `ValueError` naming the file or row."""
    try:
        return elastic.read_gcode(pathlib.Path(text) if text else EXAMPLE)
    except (ValueError, OSError) as error:
        raise ValueError(f"--set file={text}: {error}") from None


def axis_frequencies(printer: Machine, holding: float) -> np.ndarray:
    """Frequencies [Hz] of the vibrations along x and y in the middle of the bed."""
    found = elastic.resonances(printer.parameters, printer.belts, holding=holding)
    part = np.asarray(found.shapes)[:, :2] ** 2
    # The slowest vibration in which an axis has most of what the head moves.
    moves = part / np.maximum(part.sum(axis=1, keepdims=True), 1e-300)
    rows = [int(np.argmax((moves[:, i] > 0.5) & (np.asarray(found.frequencies) > 0))) for i in (0, 1)]
    return np.asarray(found.frequencies)[rows]


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """The motion of the head and the motors at equal distances of time."""
    printer, moves = read_printer(parameters["machine"]), read_file(parameters["file"])
    frame = printer.belts.frame
    room = np.array([float(frame.width), float(frame.depth)])
    # A file counts from the front left corner of the bed, where the head begins.
    points = np.asarray(moves.points) - 0.5 * BED
    outside = np.any(np.abs(points) >= 0.5 * room, axis=1)
    if outside.any():
        row = int(moves.rows[max(np.argmax(outside) - 1, 0)])
        raise ValueError(f"--set file={parameters['file']}: row {row} leaves the frame of the belts.")
    limits = {k: parameters[k] for k in ("acceleration", "corner_speed")}
    path = elastic.trajectory(points, moves.speeds, **limits)
    stepper = printer.motors(path)
    own = axis_frequencies(printer, float(stepper.stiffness))
    tuned = [parameters[f"frequency_{k}"] or float(f) for k, f in zip("xy", own, strict=True)]
    shaper = None
    if parameters["shaper"]:
        kind = parameters["shaper"]
        shaper = elastic.AxisShapers(*(InputShaper(path, kind, 2.0 * np.pi * f) for f in tuned))
        stepper = printer.motors(shaper)
    machine = elastic.ElasticCoreXY(printer.parameters, printer.belts, stepper)
    system = ss.WithBreaks(machine, path.breaks(shaper))
    end = float(path.duration) + parameters["settled"] + (float(shaper.times.max()) if shaper else 0.0)
    times = np.arange(0.0, end, 1.0 / parameters["rate"])
    start = system.start(machine.at(*points[0]))
    found = ss.simulate(
        system, 0.0, times[-1], start, saveat=ss.SaveAt(ts=times, max_events=None),
        integrator=ss.Integrator(max_steps=int(1e5 * (1.0 + end))), throw=False,
    )  # fmt: skip
    assert found.outputs is not None
    y = found.outputs.y.y
    done = np.isfinite(np.asarray(y.x))
    if not bool(found.successful):
        print(f"The run ends early: {found}")
    r = float(printer.parameters.r)
    angles = jnp.stack([y.one, y.two]) / r
    commanded = jax.jit(jax.vmap(lambda t: jnp.stack(stepper.angles(t))))(jnp.asarray(times)).T
    lag = np.asarray(commanded - angles)
    tensions = jax.jit(jax.vmap(machine.tensions))(y)
    place = np.stack([y.x, y.y], axis=1)
    # The line that the head is on, by the way that the command has gone, which a shaper delays.
    late = float(jnp.sum(shaper.x.times * shaper.x.amplitudes)) if shaper else 0.0
    ends = np.cumsum(np.hypot(*np.diff(points, axis=0).T))
    way = np.asarray(path.travelled(times - late))
    line = np.minimum(np.searchsorted(ends, way, side="right"), len(ends) - 1)
    off = np.full(times.size, np.nan)
    off[done] = elastic.contour_errors(points, place[done, 0], place[done, 1], line[done])
    drawn = moves.drawn[line] & (way > 0.0) & (way < ends[-1])
    data = xr.Dataset(
        {
            "place": (("time", "axis"), place, {"units": "m"}),
            "speed": (("time", "axis"), np.stack([y.v_x, y.v_y], axis=1), {"units": "m/s"}),
            "motor_speed": (("time", "motor"), np.stack([y.v_one, y.v_two], axis=1) / r,
                            {"units": "rad/s"}),
            "off": ("time", off, {"units": "m"}),
            "turned": (("time", "motor"), np.stack([y.one, y.two], axis=1), {"units": "m"}),
            "load_angle": (("time", "motor"), stepper.periods * lag.T, {"units": "rad"}),
            "drawn": ("time", drawn),
            "tension": (("time", "span"), np.stack(tensions, axis=1), {"units": "N"}),
            "points": (("point", "axis"), points, {"units": "m"}),
            "frequency": ("axis", own, {"units": "Hz"}),
        },
        {
            "time": ("time", times, {"units": "s"}), "axis": ["x", "y"], "motor": [1, 2],
            "span": list(elastic.Spans._fields),
        },
    )  # fmt: skip
    data = data.assign_attrs({k: parameters[k] for k in ("frames", "per_second")})
    data = data.assign_attrs(report="\n".join(report(data, moves, tuned, parameters)))
    print(data.attrs["report"])
    return data


def report(
    data: xr.Dataset, moves: elastic.Moves, tuned: list[float], parameters: dict[str, Any]
) -> list[str]:
    """The print in sentences."""
    way = float(np.sum(np.hypot(*np.diff(data.points.values, axis=0).T)))
    drawn = data.drawn.values & np.isfinite(data.off.values)
    off = 1e6 * np.where(drawn, data.off.values, 0.0)
    worst = int(np.argmax(off))
    x, y = 1e3 * (data.place.values[worst] + 0.5 * BED)
    turned = np.sin(np.clip(np.abs(data.load_angle.values), 0.0, 0.5 * np.pi))
    lost = 4.0 * np.round(data.load_angle.values / (2.0 * np.pi))
    kind = parameters["shaper"]
    shaper = f"shaper {kind} at {tuned[0]:.1f} and {tuned[1]:.1f} Hz" if kind else "no shaper"
    said = [
        f"{len(moves.speeds)} lines, {way:.2f} m, {float(data.time[-1]):.2f} s.",
        f"Vibrations in the middle of the bed: {data.frequency.values[0]:.1f} Hz along x, "
        f"{data.frequency.values[1]:.1f} Hz along y; {shaper}.",
        f"Where it draws the head is up to {off.max():.0f} um off its line (at X{x:.1f} Y{y:.1f}), "
        f"within {np.quantile(off[drawn], 0.95) if drawn.any() else 0:.0f} um for 95% of the time.",
    ]
    for k in range(2):
        least = float(np.nanmin(data.tension.values[:, 2 * k : 2 * k + 2]))
        slack = "a span goes slack" if least <= 0.0 else f"its spans keep {least:.1f} N or more"
        first = np.flatnonzero(np.abs(lost[:, k]) > 0.0)
        steps = "it loses no step"
        if first.size:
            steps = (
                f"IT LOSES STEPS, first after {float(data.time[first[0]]):.3f} s, and is "
                f"{abs(lost[np.isfinite(lost[:, k]), k][-1]):.0f} off at the end"
            )
        share = 100.0 * float(np.nanmax(turned[:, k]))
        said.append(
            f"Motor {k + 1} needs up to {share:.0f}% of its torque, {steps}; of belt {k + 1} {slack}."
        )
    return said


def reversals(data: xr.Dataset) -> np.ndarray:
    """Rows at which a motor begins to turn the other way, where its friction does too."""
    rows = []
    for speed in data.motor_speed.values.T:
        moving = np.flatnonzero(np.abs(speed) > 1e-3 * np.nanmax(np.abs(speed)))
        turns = np.flatnonzero(np.diff(np.sign(speed[moving])) != 0.0)
        rows.append(moving[turns + 1])
    return np.unique(np.concatenate(rows))


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 8.0))
    _draw_path(data, axes[0, 0])
    off, load, heard = axes[0, 1], axes[1, 0], axes[1, 1]
    off.plot(data.time, 1e6 * data.off, color="0.75", lw=0.6, label="travelling")
    off.plot(data.time, 1e6 * data.off.where(data.drawn), color="0.1", lw=0.6, label="drawing")
    off.set(xlabel="time [s]", ylabel="off the line [um]", ylim=(0.0, None))
    off.legend(frameon=False, fontsize=8)
    for k in range(2):
        torque = 100.0 * np.sin(data.load_angle[:, k])
        load.plot(data.time, torque, color=BELTS[k], lw=0.6, label=f"motor {k + 1}")
    load.set(xlabel="time [s]", ylabel="torque, of what the motor has [%]")
    load.axhline(100.0, color="0.6", lw=0.8, ls="--")
    load.axhline(-100.0, color="0.6", lw=0.8, ls="--")
    load.legend(frameon=False, fontsize=8)
    rate = 1.0 / float(data.time[1] - data.time[0])
    known = np.isfinite(data.speed.values).all(axis=1)
    for k, name in enumerate("xy"):
        felt = np.gradient(data.speed.values[known, k], 1.0 / rate)
        f, power = signal.welch(felt, rate, nperseg=min(2048, felt.size))
        heard.semilogy(f, np.sqrt(power), color=BELTS[k], lw=1.0, label=f"along {name}")
        heard.axvline(float(data.frequency[k]), color=BELTS[k], lw=0.8, ls=":")
    low = np.sqrt(power[(f > 0.0) & (f < 250.0)]).min()
    heard.set(xlim=(0.0, 250.0), ylim=(0.3 * max(low, 1e-9), None), xlabel="frequency [Hz]")
    heard.set_ylabel("acceleration of the head [m/s² per root Hz]")
    heard.legend(frameon=False, fontsize=8, title="dotted: the vibrations of the machine")
    figure.suptitle(data.attrs["report"], fontsize=8, x=0.01, ha="left")
    return figure


def _draw_path(data: xr.Dataset, axis: Axes) -> None:
    """The path as driven, its colour how far it is off; and where a motor turns back."""
    place = 1e3 * (data.place.values + 0.5 * BED)
    stride = max(len(place) // 20_000, 1)
    place, off = place[::stride], 1e6 * data.off.values[::stride]
    shown = np.flatnonzero(data.drawn.values[::stride][:-1] & np.isfinite(place[1:]).all(axis=1))
    pieces = list(np.stack([place[shown], place[shown + 1]], axis=1))
    lines = LineCollection(pieces, cmap="viridis", lw=1.6)
    lines.set_array(off[shown])
    axis.add_collection(lines)
    axis.plot(*(1e3 * (data.points.values + 0.5 * BED)).T, color="0.8", lw=0.5, zorder=0)
    turns = 1e3 * (data.place.values[reversals(data)] + 0.5 * BED)
    axis.plot(*turns.T, "x", ms=3, color="#c0392b", label="a motor turns back")
    axis.set(xlabel="X [mm]", ylabel="Y [mm]", aspect="equal")
    axis.legend(frameon=False, fontsize=8, loc="upper left")
    axis.figure.colorbar(lines, ax=axis, label="off the line [um]")


def _curves(data: xr.Dataset, axis: Axes, k: int) -> None:
    for i, style in ((2 * k, "-"), (2 * k + 1, "--")):
        label = f"span {k + 1}{'ab'[i % 2]}"
        axis.plot(data.time, data.tension[:, i], style, color=BELTS[k], lw=0.8, label=label)
    axis.set_ylabel(f"tension of belt {k + 1} [N]")


def animate(data: xr.Dataset) -> Movie:
    """Frames of the machine from above, a belt with a slack span red; beside it the tensions."""
    time, tension = np.asarray(data.time), np.asarray(data.tension)
    slack = np.stack([(tension[:, i : i + 2] <= 0.0).any(axis=1) for i in (0, 2)], axis=1)
    off = 1e6 * np.asarray(data.off)

    def words(row: int) -> str:
        return f"t = {time[row]:.2f} s, {off[row]:.0f} um off the line"

    return film(
        time, np.asarray(data.place), np.asarray(data.turned), slack, functools.partial(_curves, data),
        words, int(data.attrs["frames"]), int(data.attrs["per_second"]),
    )  # fmt: skip


def table(data: xr.Dataset) -> pd.DataFrame:
    """Columns time [s], x, y [m] in the coordinates of the file, `off` [m]."""
    place = data.place.values + 0.5 * BED
    return pd.DataFrame({
        "time": data.time.values, "x": place[:, 0], "y": place[:, 1], "off": data.off.values,
    })  # fmt: skip


EXPERIMENT = Experiment(
    name="corexy-print",
    title="CoreXY with elastic belts: a file of G-code, printed",
    parameters={
        "file": "", "machine": "", "shaper": "MZV", "frequency_x": 0.0, "frequency_y": 0.0,
        "acceleration": 5.0, "corner_speed": 0.005, "settled": 0.1, "rate": 2000.0,
        "frames": 120, "per_second": 20,
    },
    quick={"rate": 500.0, "frames": 12},
    compute=compute,
    draw=draw,
    animate=animate,
    table=table,
)  # fmt: skip
