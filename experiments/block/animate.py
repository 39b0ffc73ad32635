"""The block on its belt, moving: it sticks and slips under a pendulum that presses it down."""

from typing import Any

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.patches import Circle, Rectangle

import stickslip as ss
from stickslip import plot
from stickslip.plot import SLIP, STICK, Movie, coil
from stickslip.systems import BlockOnBeltSetValued, BlockState

from .._experiment import Context, Experiment

DARK, PALE = "0.25", "0.8"
SIDE, TOP = 0.10, 0.0  # of the block, and height of the belt [m]
LEFT, RIGHT, DRUM = -0.30, 0.42, 0.05  # ends of the belt and radius of its drums [m]
MARKS = 0.06  # between marks of the belt [m]


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """A motion of the set-valued model, rows for the curves; frames are every so many rows."""
    block = BlockOnBeltSetValued.constructed(parameters["k3"])
    begin, rows = parameters["transient"], parameters["frames"] * parameters["rows_per_frame"]
    times = begin + parameters["duration"] * np.arange(rows) / rows
    run = ss.simulate(
        block, 0.0, begin + parameters["duration"], BlockState(0.0, 0.0, 0.0, 0.0),
        saveat=ss.SaveAt(ts=jnp.asarray(times), max_events=None),
    )  # fmt: skip
    data = run.to_dataset(block)[["x", "vx", "y", "mode"]]
    data["stick"] = data.mode == block.mode_names.index("stick")
    every, r, speed = parameters["rows_per_frame"], float(block.r), float(block.V_b)
    return data.assign_attrs(r=r, belt_speed=speed, per_second=parameters["per_second"], every=every)


def animate(data: xr.Dataset) -> Movie:
    """Frames of the mechanism, and under it the velocity so far."""
    time, x, y, v = (np.asarray(data[name]) for name in ("time", "x", "y", "vx"))
    stick, r = np.asarray(data.stick), data.attrs["r"]
    every, frames = int(data.attrs["every"]), data.sizes["time"] // int(data.attrs["every"])
    time = time - time[0]
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(7.0, 5.6), height_ratios=(3, 1.1), layout="constrained"
    )
    above.set(xlim=(LEFT - 0.12, RIGHT + 0.12), ylim=(-0.15, 0.50), aspect="equal")
    above.axis("off")
    for place in (LEFT, RIGHT):
        above.add_patch(Circle((place, TOP - DRUM), DRUM, fill=False, color=DARK, lw=1.5))
    for height in (TOP, TOP - 2 * DRUM):
        above.plot([LEFT, RIGHT], [height, height], color=DARK, lw=1.5)
    wall = LEFT - 0.08
    above.plot([wall, wall], [TOP, 0.16], color=DARK, lw=3)
    (marks,) = above.plot([], [], "|", color=DARK, ms=9)
    (back,) = above.plot([], [], "|", color=PALE, ms=7)
    springs = [above.plot([], [], color=DARK, lw=1.0)[0] for _ in range(3)]
    body = above.add_patch(Rectangle((0.0, TOP), SIDE, SIDE))
    pivot = np.array([r, TOP + 0.5 * SIDE + r])
    (arms,) = above.plot([], [], color="#3d7a4b", lw=4, solid_joinstyle="round")
    above.plot(*pivot, "o", color="k", ms=6)
    title = above.set_title("", fontsize=10)
    plot.shade(time, stick, label="stick", ax=below)
    below.plot(time, v, color=STICK, lw=1.0)
    below.axhline(data.attrs["belt_speed"], color=DARK, lw=0.7, ls="--", label="belt")
    below.set(xlabel="t [s]", ylabel="block [m/s]", xlim=(time[0], time[-1]))
    below.legend(fontsize=8, loc="lower right")
    cursor = below.axvline(time[0], color="k", lw=0.8)
    (dot,) = below.plot([], [], "o", ms=4, color="k")
    span = RIGHT - LEFT

    def update(i: int) -> None:
        at = i * every
        moved = data.attrs["belt_speed"] * time[at]
        places = LEFT + np.mod(np.arange(0.0, span, MARKS) + moved, span)
        marks.set_data(places, np.full(places.size, TOP))
        back.set_data(LEFT + RIGHT - places, np.full(places.size, TOP - 2 * DRUM))
        centre, turn = x[at], y[at] / r
        body.set_xy((centre - 0.5 * SIDE, TOP))
        body.set_color(STICK if stick[at] else SLIP)
        # The pendulum turns clockwise: its lower end goes left, its left end up.
        down = pivot + r * np.array([-np.sin(turn), -np.cos(turn)])
        left = pivot + r * np.array([-np.cos(turn), np.sin(turn)])
        arms.set_data(*np.stack([left, pivot, down], axis=1))
        middle = TOP + 0.5 * SIDE
        springs[0].set_data(*coil((wall, middle), (centre - 0.5 * SIDE, middle), 7, 0.03))
        springs[1].set_data(*coil((centre + 0.5 * SIDE, middle), down, 6, 0.03))
        springs[2].set_data(*coil((centre, TOP + SIDE), left, 5, 0.03))
        title.set_text(f"t = {time[at]:.2f} s: {'sticks' if stick[at] else 'slips'}")
        cursor.set_xdata([time[at], time[at]])
        dot.set_data([time[at]], [v[at]])

    return Movie(figure, update, frames, int(data.attrs["per_second"]))


EXPERIMENT = Experiment(
    name="animate-block",
    title="Block on a belt: an animation of its sticks and slips",
    parameters={
        "k3": 85.0, "transient": 20.0, "duration": 6.0, "frames": 120, "rows_per_frame": 10,
        "per_second": 20,
    },
    quick={"frames": 20, "transient": 5.0},
    compute=compute,
    draw=lambda data: animate(data).still(),
    animate=animate,
)  # fmt: skip
