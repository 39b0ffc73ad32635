"""Pictures of the diagrams."""

import textwrap

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip import plot

COLOURS = {
    "simplified": "#1f4e9c",
    "full, sign as printed": "#c0392b",
    "full, consistent sign": "#b7791f",
}


def _words(part: xr.Dataset) -> str:
    total = float(part.transient) + float(part.duration)
    return f"{float(part.transient):g} to {total:g} s"


def draw_diagrams(dataset: xr.Dataset) -> Figure:
    """A row per model, a column per protocol, the largest exponent under each row."""
    models, names = list(dataset.model.values), list(dataset.protocol.values)
    exponents = "exponent" in dataset
    heights = ([2.4, 0.8] if exponents else [2.4]) * len(models)
    figure, axes = plt.subplots(
        len(heights), len(names), sharex=True, sharey="row", squeeze=False,
        figsize=(4.9 * len(names) + (2.2 if len(names) == 1 else 0), sum(heights) * 1.35 + 0.8),
        height_ratios=heights,
    )  # fmt: skip
    for i, model in enumerate(models):
        row = 2 * i if exponents else i
        for j, name in enumerate(names):
            part = dataset.sel(model=model, protocol=name)
            axis = axes[row, j]
            plot.orbit_diagram(part, "x", ax=axis, color=COLOURS[model])
            axis.set(xlabel=None, ylabel=None)
            kind = "the paper's protocol" if name == "paper" else "converged"
            axis.set_title(f"{model}: {kind}, {_words(part)}", fontsize=9)
            axis.set_xlim(float(dataset.k3[0]), float(dataset.k3[-1]))
            if exponents:
                _exponent(axes[row + 1, j], dataset.sel(model=model), COLOURS[model])
        axes[row, 0].set_ylabel("displacement $x$ [m]")
        if exponents:
            axes[row + 1, 0].set_ylabel("exponent [1/s]")
    for axis in axes[-1]:
        axis.set_xlabel("stiffness $k_3$ [N/m]")
    caption(figure, dataset)
    return figure


def _exponent(axis, part: xr.Dataset, colour: str) -> None:
    axis.axhline(0.0, color="0.6", linewidth=0.6)
    axis.plot(part.k3_exponent, part.exponent, color=colour, linewidth=0.7)
    low = np.nanpercentile(part.exponent, 2) if np.isfinite(part.exponent).any() else -1.0
    axis.set_ylim(max(float(low), -0.6) - 0.05)


def draw_overlay(dataset: xr.Dataset) -> Figure:
    """Simplified (blue) and full (red) in one diagram, a panel per protocol and sign."""
    others = [m for m in dataset.model.values if m != "simplified"]
    names = list(dataset.protocol.values)
    figure, axes = plt.subplots(
        len(others), len(names), sharex=True, sharey=True, squeeze=False,
        figsize=(4.9 * len(names), 3.1 * len(others) + 0.7),
    )  # fmt: skip
    for i, model in enumerate(others):
        for j, name in enumerate(names):
            for which, colour in (("simplified", "#1f4e9c"), (model, "#c0392b")):
                part = dataset.sel(model=which, protocol=name)
                plot.orbit_diagram(part, "x", ax=axes[i, j], color=colour)
            axes[i, j].set(xlabel=None, ylabel=None)
            words = _words(dataset.sel(protocol=name))
            axes[i, j].set_title(f"simplified (blue) and {model} (red), {words}", fontsize=9)
            axes[i, j].set_xlim(float(dataset.k3[0]), float(dataset.k3[-1]))
        axes[i, 0].set_ylabel("displacement $x$ [m]")
    for axis in axes[-1]:
        axis.set_xlabel("stiffness $k_3$ [N/m]")
    caption(figure, dataset)
    return figure


def caption(figure: Figure, dataset: xr.Dataset) -> None:
    """What was done and what is constructed, under the picture."""
    width = 24 * figure.get_figwidth()
    text = "\n".join(textwrap.wrap(dataset.attrs["caption"], int(width / 1.4)))
    figure.supxlabel(text, fontsize=7.5, color="0.35", ha="center")
