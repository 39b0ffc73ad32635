"""Pictures of the jointed beam."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip import plot

from ..block._draw import caption

COLOURS = {"consistent": "#1f4e9c", "as printed": "#c0392b", "found by search": "#2e7d32"}
LABELS = {
    "x": "$x$", "vx": r"$\dot x$", "y": "$y$", "vy": r"$\dot y$", "w": "$w(z_A)$",
    "w_rate": r"$\dot w(z_A)$", "W_f": "$W_f$", "W_b": "$W_b$",
}  # fmt: skip


def draw_diagrams(dataset: xr.Dataset) -> Figure:
    """A row per coordinate, a column per reading of the equations."""
    names = ("x", "y", "w")
    figure, axes = plt.subplots(
        len(names), dataset.sizes["variant"], sharex=True, sharey="row", squeeze=False,
        figsize=(1.5 + 4.5 * dataset.sizes["variant"], 8.0),
    )  # fmt: skip
    for column, variant in enumerate(dataset.variant.values):
        part = dataset.sel(variant=variant)
        for row, name in enumerate(names):
            plot.orbit_diagram(
                part, name, ax=axes[row, column], color=COLOURS[variant], markersize=0.8, alpha=1.0
            )
            axes[row, column].set(xlabel=None, ylabel=None)
            axes[row, 0].set_ylabel(LABELS[name])
        axes[0, column].set_title(variant)
        axes[-1, column].set_xlabel("belt speed $v$")
    # x is the same to rounding, which no axis should magnify.
    axes[0, 0].set_ylim(0.0, 1.5 * float(dataset.x.max()))
    caption(figure, dataset)
    return figure


def draw_phases(dataset: xr.Dataset) -> Figure:
    """Phase planes of x, y and w(z_A): the whole motion faint, what is settled in full colour."""
    pairs = (("x", "vx"), ("y", "vy"), ("w", "w_rate"))
    figure, axes = plt.subplots(dataset.sizes["variant"], 3, squeeze=False, figsize=(11.0, 6.6))
    late = dataset.time >= dataset.attrs["dropped"]
    for row, variant in enumerate(dataset.variant.values):
        part = dataset.sel(variant=variant)
        for column, (a, b) in enumerate(pairs):
            axis = axes[row, column]
            for chosen, colour in ((part, "0.8"), (part.isel(time=late), COLOURS[variant])):
                plot.phase_plane(chosen, x=a, y=b, ax=axis, color=colour, lw=0.3, rasterized=True)
            axis.locator_params(nbins=5)
            axis.ticklabel_format(scilimits=(-2, 3))
            axis.set_xlabel(LABELS[a])
            axis.set_ylabel(LABELS[b])
        axes[row, 1].set_title(f"{variant}, $v$ = {dataset.attrs['v']:g}")
    caption(figure, dataset)
    return figure


def draw_histories(dataset: xr.Dataset, names: tuple[str, str]) -> Figure:
    """Two observables over time, from the start, and their spectra; each reading to its own scale."""
    count = dataset.sizes["variant"]
    figure, axes = plt.subplots(2, 2 * count, sharex="col", squeeze=False, figsize=(7.5 * count, 6.0))
    shown = dataset.time <= dataset.attrs["shown"]
    for k, variant in enumerate(dataset.variant.values):
        part, colour = dataset.sel(variant=variant), COLOURS[variant]
        for row, name in enumerate(names):
            left, right = axes[row, 2 * k : 2 * k + 2]
            left.plot(dataset.time[shown], part[name][shown], color=colour, linewidth=0.8)
            amplitude = part[f"{name}_amplitude"][1:]
            right.semilogy(dataset.frequency[1:], amplitude, color=colour, linewidth=0.5)
            for i in range(1, 5):
                right.axvline(i * i * np.pi / 2, color="0.75", linewidth=0.6, zorder=0)
            right.set_ylim(1e-6 * float(amplitude.max()), 2 * float(amplitude.max()))
            right.set_xlim(0, 26)
            left.ticklabel_format(axis="y", scilimits=(-2, 3))
            left.set_ylabel(LABELS[name])
            right.set_ylabel(f"amplitude of {LABELS[name]}")
        axes[0, 2 * k].set_title(f"{variant}, $v$ = {dataset.attrs['v']:g}")
        axes[0, 2 * k + 1].set_title(f"from $t$ = {dataset.attrs['dropped']:g}; grey: the beam alone")
        axes[1, 2 * k].set_xlabel("time")
        axes[1, 2 * k + 1].set_xlabel("frequency")
    caption(figure, dataset)
    return figure


def draw_running(dataset: xr.Dataset) -> Figure:
    """Exponents as they converge, with the error of the last value."""
    figure, axes = plt.subplots(1, 3, figsize=(11.5, 3.8))
    titles = ("greatest exponent", "of the mass (last finite)", "Eq. (2.25) to the letter")
    early = dataset.sizes["time"] // 40
    for axis, name, title in zip(axes, ("greatest", "mass", "letter"), titles, strict=True):
        for variant in dataset.variant.values:
            part, colour = dataset.sel(variant=variant), COLOURS[variant]
            axis.plot(dataset.time, part[name], color=colour, linewidth=0.9, label=variant)
            if f"{name}_error" in dataset:
                value, error = float(part[name][-1]), float(part[f"{name}_error"])
                axis.axhspan(value - error, value + error, color=colour, alpha=0.2)
        axis.axhline(0.0, color="0.6", linewidth=0.6)
        # The first values are those of a few segments, far from where they go.
        settled = np.append(np.asarray(dataset[name])[:, early:], 0.0)
        room = 0.1 * (settled.max() - settled.min())
        axis.set_ylim(settled.min() - room, settled.max() + room)
        axis.set_title(title)
        axis.set_xlabel("time")
    axes[0].set_ylabel("exponent")
    axes[0].legend(frameon=False)
    caption(figure, dataset)
    return figure


def draw_exponents(dataset: xr.Dataset) -> Figure:
    """All exponents over belt speed with their errors, and the last value of (2.25)."""
    figure, axes = plt.subplots(
        2, dataset.sizes["variant"], sharex=True, sharey="row", figsize=(10.5, 6.4)
    )
    for column, variant in enumerate(dataset.variant.values):
        part, colour = dataset.sel(variant=variant), COLOURS[variant]
        axis = plot.exponents(part, ax=axes[0, column], color=colour, markersize=1.5)
        axis.set(xlabel=None, ylabel=None, title=variant)
        axes[1, column].plot(part.v, part.letter, color=colour, linewidth=0.8)
        axes[1, column].axhline(0.0, color="0.6", linewidth=0.6)
        axes[1, column].set_xlabel("belt speed $v$")
    axes[0, 0].set_ylabel("finite exponents of $y$ and the beam")
    axes[1, 0].set_ylabel("last value of (2.25)")
    caption(figure, dataset)
    return figure


def draw_friction(dataset: xr.Dataset) -> Figure:
    """Friction curve, Fig. 2.2."""
    figure, axis = plt.subplots(figsize=(6.0, 4.0))
    for variant in dataset.variant.values:
        axis.plot(dataset.V, dataset.T_d.sel(variant=variant), color=COLOURS[variant], label=variant)
    axis.set_ylim(-4, 4)
    axis.axvline(float(dataset.attrs["pole"]), color="0.7", linewidth=0.6, linestyle="--")
    axis.set_xlabel(r"relative velocity $\dot y - v$")
    axis.set_ylabel(r"$T_d/(\mu_s N)$")
    axis.legend(frameon=False)
    caption(figure, dataset)
    return figure
