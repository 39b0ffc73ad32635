"""Bands over the times in which something holds."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Array
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from .._types import Given, Row
from .._validation import check_known, check_text, one_row, refusal, shape_refusal
from . import _axes


def shade(
    time: Row,
    holds: Given[Sequence[bool] | np.ndarray | Array],
    *,
    label: str | None = None,
    color: str = _axes.BAND,
    ax: Given[Axes | None] = None,
) -> Axes:
    """Bands over the times in which a contact sticks, or whatever else holds.

    **Arguments:** `time` [s], `[row]`; `holds`, `[row]`: booleans at these times. A band reaches from
    the first to the last row of a run of true ones. `label` for the legend; `color` of matplotlib.

    **Returns** the axes, with one collection more, a polygon a band.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    times = np.asarray(one_row("time", time))
    check_known("holds", holds)
    row = np.ma.asarray(holds) if isinstance(holds, np.ma.MaskedArray) else _array(holds)
    if isinstance(row, np.ma.MaskedArray) or row.dtype != bool:
        raise refusal("holds", holds, "a row of booleans", TypeError)
    if row.shape != times.shape:
        raise shape_refusal("holds", holds, f"of shape {times.shape}, as time")
    if label is not None:
        check_text("label", label)
    check_colour("color", color)
    _axes.check_axes(ax)
    axis = _axes.canvas(ax)
    bands(axis, spans(times, row), label=label, color=color)
    return axis


def _array(holds: Any) -> np.ndarray:
    try:
        return np.asarray(holds)
    except (TypeError, ValueError):  # rows of different lengths, keys of random numbers
        return np.zeros(0)


def check_colour(name: str, value: Any) -> Any:
    """A colour that matplotlib knows."""
    from matplotlib.colors import is_color_like

    if not isinstance(value, str) or not is_color_like(value):
        raise refusal(name, value, "a colour of matplotlib, such as '0.8' or '#1f4e9c'", TypeError)
    return value


def spans(
    time: np.ndarray, holds: np.ndarray, until: np.ndarray | None = None
) -> list[tuple[float, float]]:
    """First and last time of each run of true rows, each row until its own time where one is given."""
    until = time if until is None else until
    edges = np.flatnonzero(np.diff(np.concatenate([[0], holds.astype(int), [0]])))
    return [(float(time[a]), float(until[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def bands(
    axis: Axes,
    found: list[tuple[float, float]],
    *,
    label: str | None,
    color: str,
    low: float = 0.0,
    high: float = 1.0,
) -> PolyCollection:
    """Bands from `low` to `high` of the height of the axes, behind everything else."""
    corners = [[(a, low), (a, high), (b, high), (b, low)] for a, b in found]
    drawn = PolyCollection(
        corners, transform=axis.get_xaxis_transform(), facecolor=color, linewidth=0, label=label,
        zorder=0.5,
    )  # fmt: skip
    axis.add_collection(drawn, autolim=False)
    return drawn
