"""The jointed beam, moving: a mass on a belt that sticks, slips, lifts off, and the beam it pulls."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.patches import Rectangle

import stickslip as ss
from stickslip import plot
from stickslip.analysis import Samples, time_history
from stickslip.plot import SLIP, STICK, Movie, coil
from stickslip.systems import JointedBeam

from .._experiment import Context, Experiment

DARK, PALE = "0.25", "0.8"
NODES = 81  # of the beam
SIDE = 0.14
MARKS = 0.18
METHOD = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-13), max_steps=10_000_000)
WORDS = ("slips", "sticks", "slips", "is off the belt")


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Motion of the mass, and the shape of the beam at every row."""
    beam = JointedBeam.constructed(parameters["v"])
    begin, rows = parameters["transient"], parameters["frames"] * parameters["rows_per_frame"]
    times = begin + parameters["duration"] * np.arange(rows) / rows
    names = [f"q{i}" for i in range(beam.modes)]
    parts = {name: (lambda system, t, y, dy, mode, args, i=i: y.q[i]) for i, name in enumerate(names)}
    seen = time_history(
        beam, beam.start(), Samples(times, begin), {"x": "x", "y": "y", "vy": "vy", **parts},
        integrator=METHOD,
    )  # fmt: skip
    z = np.linspace(0.0, 1.0, NODES)
    shapes = np.sqrt(2.0) * np.sin(np.pi * np.outer(np.arange(1, beam.modes + 1), z))
    bend = np.stack([np.asarray(seen[name]) for name in names], axis=1) @ shapes
    data = seen.drop_vars(names).assign_coords(z=("z", z, {"units": "1"}))
    data["w"] = (("time", "z"), bend, {"units": "1"})
    return data.assign_attrs(
        v=parameters["v"], z_A=float(beam.z_A), per_second=parameters["per_second"],
        every=parameters["rows_per_frame"],
    )  # fmt: skip


def animate(data: xr.Dataset) -> Movie:
    """Frames of beam, joint, mass and belt, each drawn larger by a factor of its own."""
    time, x, y, vy = (np.asarray(data[name]) for name in ("time", "x", "y", "vy"))
    w, z, mode = np.asarray(data.w), np.asarray(data.z), np.asarray(data["mode"])
    every, frames = int(data.attrs["every"]), data.sizes["time"] // int(data.attrs["every"])
    # The motion is a thousandth of the beam, the beam bends a hundredth of that.
    large, wide, bent = 0.3 / np.ptp(y), 0.08 / np.abs(x).max(), 0.10 / max(np.abs(w).max(), 1e-300)
    time = time - time[0]
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(7.0, 5.8), height_ratios=(3, 1.1), layout="constrained"
    )
    above.set(xlim=(-0.06, 1.06), ylim=(-0.25, 0.75), aspect="equal")
    above.axis("off")
    place, rest = data.attrs["z_A"], 0.45
    for end in (0.0, 1.0):
        above.plot([end], [-0.03], "^", color=DARK, ms=12)
    (line,) = above.plot([], [], color=DARK, lw=4)
    (spring,) = above.plot([], [], color=DARK, lw=1.0)
    touch = place + 0.5 * SIDE + 0.08
    above.add_patch(Rectangle((touch, 0.02), 0.05, 0.72, color=PALE))
    (marks,) = above.plot([], [], "_", color=DARK, ms=12)
    body = above.add_patch(Rectangle((0.0, 0.0), SIDE, SIDE))
    title = above.set_title("", fontsize=10)
    above.text(
        0.5, -0.21, f"motion of the mass along the belt x {large:.0f}, across it x {wide:.0f}, bend of "
        f"the beam x {bent:.0f}", ha="center", fontsize=8, color=DARK,
    )  # fmt: skip
    plot.shade(time, mode == 1, label="stick", ax=below)
    plot.shade(time, mode == 3, label="off the belt", color="#f5e9d3", ax=below)
    below.plot(time, vy, color=STICK, lw=1.0)
    below.set(xlabel="t", ylabel=r"$\dot y$", xlim=(time[0], time[-1]))
    below.ticklabel_format(axis="y", scilimits=(-2, 3))
    below.legend(fontsize=8, loc="lower right")
    cursor = below.axvline(time[0], color="k", lw=0.8)
    (dot,) = below.plot([], [], "o", ms=4, color="k")
    middle = 0.5 * (y.max() + y.min())
    colours = (SLIP, STICK, SLIP, "#b7791f")

    def update(i: int) -> None:
        at = i * every
        height = rest + large * (y[at] - middle)
        # The face of the mass touches the belt at x = 0; deeper, it presses.
        across = place + wide * min(x[at], 0.0) + 0.08
        body.set_xy((across - 0.5 * SIDE, height - 0.5 * SIDE))
        body.set_color(colours[mode[at]])
        line.set_data(z, bent * w[at])
        joint = np.interp(place, z, bent * w[at])
        spring.set_data(*coil((place, joint), (across, height - 0.5 * SIDE), 6, 0.05))
        moved = large * data.attrs["v"] * time[at]
        ticks = 0.04 + np.mod(np.arange(0.0, 0.68, MARKS) + moved, 0.68)
        marks.set_data(np.full(ticks.size, touch + 0.025), ticks)
        title.set_text(f"t = {time[at]:.2f}: the mass {WORDS[mode[at]]}")
        cursor.set_xdata([time[at], time[at]])
        dot.set_data([time[at]], [vy[at]])

    return Movie(figure, update, frames, int(data.attrs["per_second"]))


EXPERIMENT = Experiment(
    name="animate-beam",
    title="Jointed beam: an animation of mass, joint, beam and belt",
    parameters={
        "v": 5e-4, "transient": 100.0, "duration": 2.4, "frames": 120, "rows_per_frame": 10,
        "per_second": 20,
    },
    quick={"frames": 20, "transient": 20.0},
    compute=compute,
    draw=lambda data: animate(data).still(),
    animate=animate,
)  # fmt: skip
