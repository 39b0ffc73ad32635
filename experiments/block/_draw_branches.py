"""Picture of the branches over the diagrams."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip import plot

from ._draw import caption

STABLE, UNSTABLE = "#1f4e9c", "#c0392b"
MARKS = {"PD": "D", "LP": "s", "NS": "o", "BP": "X"}
LARGE = 20.0  # multipliers beyond it are drawn on a scale of powers


def draw_branches(dataset: xr.Dataset) -> Figure:
    """A row per model: section points of every orbit over the diagram, and the largest multiplier."""
    models = list(map(str, dataset.model.values))
    figure, axes = plt.subplots(
        len(models), 2, sharex=True, squeeze=False, figsize=(11.0, 2.7 * len(models) + 0.6)
    )
    for row, model in enumerate(models):
        left, right = axes[row]
        part = dataset.sel(model=model).isel(protocol=-1)
        plot.orbit_diagram(part, "x", ax=left, color="0.75")
        left.set(xlabel=None, ylabel="$x$ at $\\ddot x = 0$ [m]", title=model)
        right.set(ylabel="largest multiplier", title="size of the largest Floquet multiplier")
        right.axhline(1.0, color="0.6", linewidth=0.6)
        found = np.asarray(dataset.orbit_multiplier)[np.asarray(dataset.orbit_model) == row]
        if np.nanmax(found, initial=0.0) > LARGE:
            right.set_yscale("log")
        for number in np.unique(dataset.orbit_branch[dataset.orbit_model == row]):
            _branch(left, right, dataset.isel(orbit=dataset.orbit_branch == number))
        _marks(left, dataset.isel(special=dataset.special_model == row))
    for axis in axes[-1]:
        axis.set_xlabel("stiffness $k_3$ [N/m]")
    caption(figure, dataset)
    return figure


def _branch(left, right, branch: xr.Dataset) -> None:
    k3, stable = np.asarray(branch.orbit_k3), np.asarray(branch.orbit_stable).astype(bool)
    largest = np.nanmax(np.asarray(branch.orbit_multiplier), axis=1)
    # In order of size, so that each line joins points of one kind; another number of them is cut off.
    x = np.sort(np.asarray(branch.orbit_x), axis=1)
    changes = np.flatnonzero(np.diff(np.isfinite(x).sum(axis=1))) + 1
    for wanted, colour, style in ((True, STABLE, "-"), (False, UNSTABLE, "--")):
        shown = stable == wanted
        shown[1:] |= stable[:-1] == wanted
        for column in x.T:
            height = np.insert(np.where(shown, column, np.nan), changes, np.nan)
            left.plot(np.insert(k3, changes, np.nan), height, style, color=colour, linewidth=1.0)
        right.plot(k3, np.where(shown, largest, np.nan), style, color=colour, linewidth=1.0)


def _marks(axis, specials: xr.Dataset) -> None:
    for label, mark in MARKS.items():
        these = specials.isel(special=specials.special_label == label)
        if not these.sizes["special"]:
            continue
        k3 = np.repeat(np.asarray(these.special_k3), these.sizes["crossing"])
        axis.plot(k3, np.ravel(these.special_x), mark, color="black", markersize=3.5, label=label)
    if axis.get_legend_handles_labels()[1]:
        axis.legend(frameon=False, fontsize=8)
