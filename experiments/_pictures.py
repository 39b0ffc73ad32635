"""The two pictures of the README: the diagram that `make demo` draws, and a stick-slip motion."""

import pathlib
import tempfile
from typing import Any

import jax.numpy as jnp
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

from ._output import STYLE
from ._records import shrink

FOLDER = pathlib.Path(__file__).parent / "pictures"
WIDTH, COLOURS = 800, 200  # pixels; so many that no rare colour is lost
BELT, END = 0.2, 30.0  # [m/s], [s], those of the README's example
BLUE, RED, GREY = "#1f4e9c", "#c0392b", "0.88"


def motion() -> Figure:
    """Place and velocity of the README's block over time, sticks shaded, events marked."""
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, BELT)
    ts = jnp.linspace(0.0, END, 3001)
    run: Any = ss.simulate(
        block, 0.0, END, Motion(x=0.0, v=BELT), "stick", saveat=ss.SaveAt(ts=ts, events=True)
    )
    shown, events = run.outputs, run.events
    t = np.asarray(shown.t)
    stick = np.asarray(shown.mode) == block.mode_names.index("stick")
    at = np.asarray(events.t)[: int(run.num_events)]
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.1, 3.6))
    rows = (("x", "position $x$ [m]"), ("v", "velocity $\\dot x$ [m/s]"))
    for axis, (name, label) in zip(axes, rows, strict=True):
        values = np.asarray(getattr(shown.y, name))
        axis.fill_between(
            t, 0, 1, where=stick, transform=axis.get_xaxis_transform(), color=GREY, lw=0, label="sticks"
        )
        axis.plot(t, values, color=BLUE, lw=1.2)
        axis.plot(at, np.interp(at, t, values), "o", color=RED, ms=3.5, label="events")
        axis.set_ylabel(label)
    axes[0].legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    axes[1].axhline(BELT, color="0.4", lw=0.7, ls=":")
    axes[1].text(END, BELT, " belt", va="center", fontsize=8, color="0.3")
    axes[1].set_xlabel("time [s]")
    axes[1].set_xlim(0.0, END)
    return figure


def write(out: pathlib.Path, folder: pathlib.Path = FOLDER) -> list[pathlib.Path]:
    """Both pictures, small; that of the diagram from `demo.png` in `out`, if it is there."""
    folder.mkdir(exist_ok=True)
    written = []
    with tempfile.TemporaryDirectory() as place, matplotlib.rc_context(STYLE):
        path = pathlib.Path(place) / "motion.png"
        figure = motion()
        figure.savefig(path)
        plt.close(figure)
        shrink(path, folder / "motion.png", WIDTH, COLOURS)
        written.append(folder / "motion.png")
    if (out / "demo.png").exists():
        shrink(out / "demo.png", folder / "diagram.png", WIDTH, COLOURS)
        written.append(folder / "diagram.png")
    return written
