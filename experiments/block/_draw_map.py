"""Picture of the map: settled motions as colours, curves of special points over them."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from ._draw import caption
from ._map import FAILED, IRREGULAR, RESTS, UNTOLD

# Kinds of motion in the order of the colour bar; a number of points is the kind of the greatest that
# is not above it.
KINDS = {
    "failed": "#000000", "not told": "#b8b8b8", "rests": "#ffffff", "irregular": "#5b3a29",
    "1": "#c6dbef", "2": "#6baed6", "3": "#a1d99b", "4": "#2171b5", "5 to 7": "#41ab5d", "8": "#08306b",
    "9 to 16": "#fd8d3c",
}  # fmt: skip
NUMBERS = {FAILED: 0, UNTOLD: 1, RESTS: 2, IRREGULAR: 3, 1: 4, 2: 5, 3: 6, 4: 7, 5: 8, 8: 9, 9: 10}
LINES = {"PD": "#d7301f", "LP": "#e6ab02", "NS": "#e7298a", "GR": "#111111"}
STYLES = ("-", "--", ":")  # by doublings of the orbit
PASSED = ("bounds of", "closed", "begins", "max_points")  # ends that are not points of their own


def draw_map(dataset: xr.Dataset) -> Figure:
    """Colours for the settled motions of all lanes, lines for curves, marks for their named ends."""
    figure, axis = plt.subplots(figsize=(9.0, 6.2))
    k3, speed = np.asarray(dataset.k3), np.asarray(dataset.V_b)
    colours = ListedColormap(list(KINDS.values()))
    norm = BoundaryNorm(np.arange(len(KINDS) + 1) - 0.5, len(KINDS))
    shown = kinds_of(np.asarray(dataset.motion.transpose("V_b", "k3")))
    mesh = axis.pcolormesh(
        k3, speed, shown, cmap=colours, norm=norm, shading="nearest", rasterized=True
    )
    bar = figure.colorbar(mesh, ax=axis, ticks=range(len(KINDS)), pad=0.01)
    bar.ax.set_yticklabels(list(KINDS))
    bar.set_label("maxima of x per period")
    for number in range(dataset.sizes["curve"]):
        _curve(axis, dataset, number)
    axis.set(
        xlabel="stiffness $k_3$ [N/m]", ylabel="belt speed $V_b$ [m/s]",
        xlim=(k3.min(), k3.max()), ylim=(speed.min(), speed.max()),
    )  # fmt: skip
    if axis.get_legend_handles_labels()[1]:
        axis.legend(loc="upper left", fontsize=8)
    caption(figure, dataset)
    return figure


def kinds_of(motion: np.ndarray) -> np.ndarray:
    """Number of the kind of each motion, an index into `KINDS`."""
    known = np.array(sorted(NUMBERS))
    at = np.clip(np.searchsorted(known, motion, side="right") - 1, 0, len(known) - 1)
    return np.array([NUMBERS[int(n)] for n in known])[at]


def _curve(axis, dataset: xr.Dataset, number: int) -> None:
    label, level = str(dataset.curve_label[number].item()), int(dataset.curve_level[number])
    points = dataset.isel(along=dataset.along_curve == number)
    turns = {0: "the orbit", 1: "the doubled orbit"}.get(level, f"{2**level} rounds")
    words = f"{label} of {turns}"
    drawn = axis.get_legend_handles_labels()[1]
    axis.plot(
        points.along_k3, points.along_V_b, STYLES[min(level, len(STYLES) - 1)],
        color=LINES.get(label, "black"), linewidth=1.6, label="" if words in drawn else words,
    )  # fmt: skip
    axis.plot(dataset.curve_k3[number], dataset.curve_V_b[number], "o", color="white",
              markeredgecolor="black", markersize=4)  # fmt: skip
    for at in np.flatnonzero(np.asarray(dataset.tip_curve) == number):
        words = str(dataset.tip_words[at].item())
        if words.startswith(PASSED):
            continue
        place = float(dataset.tip_k3[at]), float(dataset.tip_V_b[at])
        axis.plot(*place, "s", color="black", markersize=4.5)
        axis.annotate(
            words.partition(":")[0], place, xytext=(5, -9), textcoords="offset points", fontsize=8,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "alpha": 0.8, "linewidth": 0},
        )  # fmt: skip
