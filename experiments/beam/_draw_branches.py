"""Picture of the branches over the diagrams of y."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip import plot

from ..block._draw import caption
from ..block._draw_branches import STABLE, UNSTABLE

ROUNDING = 1e-10  # of a multiplier: below it nothing is said
DECADES = (1e-8, 1e-5, 1e-2)
WEAK = 1e-5  # of a multiplier: what grows by less in a period is not seen in a simulation


def draw_branches(dataset: xr.Dataset) -> Figure:
    """A row per reading: orbits over the diagram, sizes of all multipliers, the largest one less 1."""
    figure, axes = plt.subplots(
        dataset.sizes["variant"], 3, sharex=True, squeeze=False,
        figsize=(13.0, 3.2 * dataset.sizes["variant"] + 0.6),
    )  # fmt: skip
    for row, variant in enumerate(map(str, dataset.variant.values)):
        left, middle, right = axes[row]
        lanes = dataset.sel(variant=variant)
        plot.orbit_diagram(lanes, "y", ax=left, color="0.75", markersize=0.8, alpha=1.0)
        left.set(xlabel=None, ylabel="$y$ where it is greatest", title=variant)
        for damping in np.unique(dataset.orbit_damping):
            mine = (dataset.orbit_variant == variant) & (dataset.orbit_damping == damping)
            part = dataset.isel(orbit=np.flatnonzero(mine)).sortby("orbit_v")
            if damping == 0:
                _orbits(left, part)
                middle.plot(part.orbit_v, part.orbit_size, ".", color="0.3", markersize=2.5)
            _growth(right, part, f"damping ratio {damping:g}", "-" if damping == 0 else ":")
        at = dataset.isel(special=np.flatnonzero(
            (dataset.special_variant == variant) & (dataset.special_damping == 0.0)
        ))  # fmt: skip
        _marks(left, right, at)
        for axis, line in ((middle, 1.0), (right, 0.0)):
            axis.axhline(line, color="0.6", linewidth=0.6)
        middle.set(title="sizes of the multipliers", ylim=(-0.05, 1.15))
        right.set_yscale("symlog", linthresh=ROUNDING)
        right.set_yticks([sign * size for sign in (-1, 1) for size in DECADES] + [0.0])
        right.set_title("largest one minus 1")
        right.legend(frameon=False, fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("belt speed $v$")
        axis.set_xscale("log")
    caption(figure, dataset)
    return figure


def _orbits(axis, part: xr.Dataset) -> None:
    stable = np.max(np.asarray(part.orbit_size), axis=1) - 1.0 < WEAK
    for wanted, colour, style in ((True, STABLE, "-"), (False, UNSTABLE, "--")):
        shown = stable == wanted
        shown[1:] |= stable[:-1] == wanted
        name = f"stable, or unstable by less than {WEAK:g}" if wanted else "unstable"
        height = np.where(shown, part.orbit_y, np.nan)
        axis.plot(part.orbit_v, height, style, color=colour, linewidth=1.2, label=name)


def _growth(axis, part: xr.Dataset, name: str, style: str) -> None:
    axis.plot(part.orbit_v, np.max(part.orbit_size, axis=1) - 1.0, style, label=name, linewidth=1.0)


def _marks(left, right, specials: xr.Dataset) -> None:
    for label, mark, words in (("GR", "D", "the stick ends"), ("PD", "s", "doubling")):
        these = specials.isel(special=np.flatnonzero(specials.special_label == label))
        if these.sizes["special"]:
            left.plot(
                these.special_v, these.special_y, mark, color="black", markersize=4.0, label=words
            )
            for v in np.asarray(these.special_v):
                right.axvline(v, color="0.8", linewidth=0.8, zorder=0)
    left.legend(frameon=False, fontsize=8)
