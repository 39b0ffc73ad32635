"""Axes to draw into, their labels, and options of lines."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import ArtistInspector
from matplotlib.axes import Axes
from matplotlib.cbook import normalize_kwargs
from matplotlib.lines import Line2D

from .._drawing import BAND as BAND
from .._drawing import BLUE as BLUE
from .._drawing import GREEN as GREEN
from .._drawing import GREY as GREY
from .._drawing import RED as RED
from .._validation import refusal


def check_axes(ax: Any, count: int | None = None) -> None:
    """Raise if `ax` is neither None nor axes; with `count` it must be so many of them."""
    if ax is None:
        return
    if count is None:
        if not isinstance(ax, Axes):
            raise refusal("ax", ax, "axes of matplotlib or None", TypeError)
        return
    allowed = f"{count} axes of matplotlib in a row, or None"
    row = list(ax.flat) if isinstance(ax, np.ndarray) else ax
    if not isinstance(row, list | tuple) or not all(isinstance(a, Axes) for a in row):
        raise refusal("ax", ax, allowed, TypeError)
    if len(row) != count:
        raise refusal("ax", ax, allowed, but=f"of length {len(row)}")


def check_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Properties of a line by their full names; raises for a keyword that is none."""
    known = {*(inspector := ArtistInspector(Line2D)).get_setters()}
    known |= {alias for names in inspector.aliasd.values() for alias in names}
    for name, value in options.items():
        if name not in known:
            raise refusal(name, value, "left out: further options are properties of a line", TypeError)
    return normalize_kwargs(dict(options), Line2D)


def begin(
    ax: Any, options: Mapping[str, Any], rows: int | None = None,
    heights: Sequence[float] | None = None, **usual: Any,
) -> tuple[Any, dict[str, Any]]:  # fmt: skip
    """Axes as of `canvas`, and the options behind those that are usual, all checked before."""
    check_axes(ax, rows)
    options = {**usual, **check_options(options)}
    return canvas(ax, rows, heights=heights), options


def canvas(ax: Any, rows: int | None = None, *, heights: Sequence[float] | None = None) -> Any:
    """The axes to draw into: those given, or new ones; an array of so many `rows`, or one."""
    if ax is not None:
        if rows is None:
            return ax
        found = np.empty(rows, dtype=object)
        found[:] = list(np.asarray(ax, dtype=object).flat)
        return found
    # It chooses a backend, which whoever draws into axes of their own has done.
    from matplotlib import pyplot

    count = 1 if rows is None else rows
    height = 3.2 if rows is None else 0.8 + 1.7 * sum(heights or [1.0] * count)
    _, axes = pyplot.subplots(
        count, 1, sharex=True, squeeze=False, figsize=(7.0, height), layout="constrained",
        height_ratios=heights,
    )  # fmt: skip
    return axes[0, 0] if rows is None else axes[:, 0]


def axis_label(name: str, unit: str | None) -> str:
    """Label of an axis: the name, and the unit in brackets where there is one."""
    return f"{name} [{unit}]" if unit not in (None, "", "1") else name


def legend(axis: Axes, **options: Any) -> None:
    """A legend, where there is more than one thing to tell apart."""
    if len(axis.get_legend_handles_labels()[1]) > 1:
        axis.legend(frameon=False, fontsize="small", **options)
