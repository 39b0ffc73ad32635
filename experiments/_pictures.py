"""Pictures of the README and the pages: the diagram that `make demo` draws, a motion, an attempt."""

import pathlib
import tempfile

import jax.numpy as jnp
import matplotlib
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

import stickslip as ss
from stickslip import plot
from stickslip.systems import CoulombOscillator, Motion

from ._attempt_picture import attempt_figure
from ._output import STYLE
from ._records import shrink

FOLDER = pathlib.Path(__file__).parent / "pictures"
WIDTH, COLOURS = 800, 200  # pixels; so many that no rare colour is lost
BELT, END = 0.2, 30.0  # [m/s], [s], those of the README's example


def motion() -> Figure:
    """Place and velocity of the README's block over time, sticks shaded, events marked."""
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, BELT)
    saved = ss.SaveAt(ts=jnp.linspace(0.0, END, 3001))
    run = ss.simulate(block, 0.0, END, Motion(x=0.0, v=BELT), "stick", saveat=saved)
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.1, 3.6))
    plot.motion(run, block, ["x", "v"], ax=axes)
    axes[1].axhline(BELT, color="0.4", lw=0.7, ls=":")
    axes[1].text(END, BELT, " belt", va="center", fontsize=8, color="0.3")
    axes[1].set_xlim(0.0, END)
    return figure


def write(out: pathlib.Path, folder: pathlib.Path = FOLDER) -> list[pathlib.Path]:
    """All pictures, small; that of the diagram from `demo.png` in `out`, if it is there."""
    folder.mkdir(exist_ok=True)
    written = []
    with tempfile.TemporaryDirectory() as place, matplotlib.rc_context(STYLE):
        for name, draw in (("motion.png", motion), ("attempt.png", attempt_figure)):
            figure = draw()
            figure.savefig(pathlib.Path(place) / name)
            plt.close(figure)
            shrink(pathlib.Path(place) / name, folder / name, WIDTH, COLOURS)
            written.append(folder / name)
    if (out / "demo.png").exists():
        shrink(out / "demo.png", folder / "diagram.png", WIDTH, COLOURS)
        written.append(folder / "diagram.png")
    return written
