"""The CoreXY mechanism, moving: its two belts with marks on them, and the pulleys that slip."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.patches import Circle, Rectangle

import corexy_jax as cx
from stickslip import plot

from .._experiment import Context, Experiment
from .._movie import DARK, PALE, SLIP, Movie, along_path, still

BELTS = ("#1f4e9c", "#3d7a4b")
RIM = 0.03  # radius of the drawn pulleys, of the width of the frame
KEPT = ("x", "y", "theta", "omega", "omega_v", "dmn", "v", "slip")


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """A scenario of the paper by the consistent law."""
    p, v = cx.scenario(parameters["scenario"])
    end, rows = parameters["begin"] + parameters["duration"], parameters["rows"]
    data = cx.outputs(cx.simulate(p, v, end, rows=rows))[list(KEPT)]
    late = np.asarray(data.time) >= parameters["begin"] - 1e-9
    kept = ("scenario", "frames", "per_second")
    return data.isel(time=late).assign_attrs(r=float(p.r), **{name: parameters[name] for name in kept})


def paths(x: float, y: float, wide: float, high: float, gap: float) -> list[np.ndarray]:
    """Corners of the two belts, each from the collar around its motor and the far side back to it.

    Strands of a belt are a `gap` apart, and round the motor is half a circle of this diameter.
    """
    half = np.linspace(0.0, np.pi, 25)
    round_1 = np.stack([0.5 * gap * (np.cos(half) - 1.0), -0.5 * gap * np.sin(half)], axis=1)
    round_2 = np.stack([wide + 0.5 * gap * (1.0 - np.cos(half)), -0.5 * gap * np.sin(half)], axis=1)
    one = [
        (x, y), (0.0, y), *round_1, (-gap, high + gap), (wide, high + gap), (wide, y + 2 * gap),
        (x, y + 2 * gap),
    ]  # fmt: skip
    two = [
        (x, y - gap), (wide, y - gap), *round_2, (wide + gap, high), (0.0, high), (0.0, y + gap),
        (x, y + gap),
    ]  # fmt: skip
    return [np.array(one), np.array(two)]


def animate(data: xr.Dataset) -> Movie:
    """Frames of the machine from above; under it the speeds of motors and belts."""
    time, x, y = (np.asarray(data[name]) for name in ("time", "x", "y"))
    theta, dmn = np.asarray(data.theta), np.asarray(data.dmn)
    slips = np.stack([np.isin(dmn, (2, 4)), np.isin(dmn, (3, 4))], axis=1)
    frames = int(data.attrs["frames"])
    room = 0.18 * max(np.ptp(x), np.ptp(y), 0.1)
    x, y = x - x.min() + room, y - y.min() + room
    wide, high = x.max() + room, y.max() + room
    figure = plt.figure(figsize=(7.6, 5.2), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    machine = figure.add_subplot(grid[:, 0])
    edge = 0.14 * wide
    machine.set(xlim=(-edge, wide + edge), ylim=(-edge, high + edge), aspect="equal")
    machine.axis("off")
    (beam,) = machine.plot([], [], color=PALE, lw=9, zorder=1)
    belts = [machine.plot([], [], color=c, lw=1.4, zorder=3)[0] for c in BELTS]
    marks = [machine.plot([], [], "o", color=c, ms=3, zorder=4)[0] for c in BELTS]
    (trace,) = machine.plot([], [], color="0.6", lw=0.8, zorder=2)
    rim = RIM * wide
    gap = 2.0 * rim
    centres = np.array([(-rim, 0.0), (wide + rim, 0.0)])
    rims = [Circle(c, rim, fc="w", ec=DARK, lw=1.5, zorder=5) for c in centres]
    for patch in rims:
        machine.add_patch(patch)
    spokes = [machine.plot([], [], color=DARK, lw=2, zorder=6)[0] for _ in centres]
    for i, (centre, word) in enumerate(zip(centres, ("motor 1", "motor 2"), strict=True)):
        at = (0.0, -22.0)
        machine.annotate(word, centre, at, textcoords="offset points", ha="center", color=BELTS[i])
    side = 0.10 * wide
    collar = Rectangle((0.0, 0.0), side, 4.4 * gap, color=DARK, zorder=5)
    machine.add_patch(collar)
    title = machine.set_title("", fontsize=10)
    cursors = []
    for k in range(2):
        axis = figure.add_subplot(grid[k, 1])
        plot.shade(time, slips[:, k], label="belt slips", color="#f5d0cc", ax=axis)
        axis.plot(time, data.omega.values[:, k], color=BELTS[k], lw=1.2, label="motor")
        axis.plot(time, data.omega_v.values[:, k], color="k", lw=0.9, ls="--", label="belt")
        axis.set(ylabel=f"motor {k + 1} [rad/s]", xlim=(time[0], time[-1]))
        cursors.append(axis.axvline(time[0], color="k", lw=0.8))
    axis.set_xlabel("t [s]")
    axis.legend(fontsize=7, loc="upper right")
    rows = np.linspace(0, time.size - 1, frames).round().astype(int)
    length = float(np.hypot(*np.diff(paths(x[0], y[0], wide, high, gap)[0], axis=0).T).sum())
    places = np.arange(0.0, length, length / 40)

    def update(i: int) -> None:
        at = rows[i]
        beam.set_data([0.0, wide], [y[at] + 0.5 * gap] * 2)
        collar.set_xy((x[at] - 0.5 * side, y[at] - 1.7 * gap))
        trace.set_data(x[: at + 1], y[: at + 1] + 0.5 * gap)
        for k, corners in enumerate(paths(x[at], y[at], wide, high, gap)):
            belts[k].set_data(*corners.T)
            # The belt is held at the collar: each mark keeps its length from there.
            marks[k].set_data(*along_path(corners, places))
            marks[k].set_color(SLIP if slips[at, k] else BELTS[k])
            rims[k].set_edgecolor(SLIP if slips[at, k] else DARK)
            # The rim of the drawn pulley moves as far as that of the true one.
            turn = data.attrs["r"] * theta[at, k] / rim
            tip = rim * np.array([np.cos(turn), np.sin(turn)])
            spokes[k].set_data(*np.stack([centres[k] - tip, centres[k] + tip], axis=1))
            cursors[k].set_xdata([time[at], time[at]])
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
    draw=still(animate),
    animate=animate,
)  # fmt: skip
