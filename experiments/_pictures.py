"""Pictures of the README and the pages: the demo's diagram, a motion, an attempt, animations."""

import pathlib
import tempfile

import jax.numpy as jnp
import matplotlib
import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from PIL import Image

import stickslip as ss
from stickslip import plot
from stickslip.systems import CoulombOscillator, Motion

from ._attempt_picture import attempt_figure
from ._output import STYLE
from ._records import shrink

FOLDER = pathlib.Path(__file__).parent / "pictures"
WIDTH, COLOURS = 800, 200  # pixels; so many that no rare colour is lost
MOVIES = ("animate-block", "animate-beam", "animate-corexy")
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
    """All pictures, small; the diagram and the animations if `demo.png` and their GIFs are in `out`."""
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
    for name in MOVIES:
        if (out / f"{name}.gif").exists():
            written.append(shrink_movie(out / f"{name}.gif", folder / f"{name}.gif"))
    return written


def shrink_movie(
    source: pathlib.Path, target: pathlib.Path, width: int = 480, colours: int = 32, every: int = 2
) -> pathlib.Path:
    """A GIF of `width` pixels with so many colours and every so many frames, at the same pace."""
    with Image.open(source) as movie:
        frames = []
        for number in range(0, movie.n_frames, every):  # pyright: ignore[reportAttributeAccessIssue]
            movie.seek(number)
            size = (width, round(movie.height * width / movie.width))
            frames.append(movie.convert("RGB").resize(size, Image.Resampling.LANCZOS))
        # One palette from frames throughout: a colour that comes late would be missing from the first.
        strip = Image.new("RGB", (frames[0].width, 4 * frames[0].height))
        for place in range(4):
            strip.paste(frames[place * len(frames) // 4], (0, place * frames[0].height))
        palette = strip.quantize(colours, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
        first, *rest = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in frames)
        milliseconds = every * movie.info["duration"]
        first.save(
            target, save_all=True, append_images=rest, duration=milliseconds, loop=0, optimize=True
        )
    return target
