"""Curves of special points over two parameters."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type
from ..continuation import BifurcationCurve
from . import _axes


def curve(curve: Given[BifurcationCurve], *, ax: Given[Axes | None] = None, **options: Any) -> Axes:
    """A curve of special points in the plane of its two parameters, its ends marked.

    **Arguments**

    - `curve`: of `stickslip.continuation.continue_point`.
    - `ax`, `options`: axes to draw into; properties of the line.

    **Returns** the axes. An end at a bound is not marked; others have the first word of their reason.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("curve", curve, BifurcationCurve, "a BifurcationCurve of continuation.continue_point")
    _axes.check_axes(ax)
    options = {"label": curve.label, "color": _axes.BLUE, **_axes.check_options(options)}
    axis = _axes.canvas(ax)
    axis.plot(*curve.values.T, **options)
    for end in curve.ends:
        word = end.words.partition(":")[0]
        if word.startswith(("bounds of", "closed", "begins", "max_points")):
            continue
        axis.plot(*np.asarray(end.values), "o", color="black", markersize=4)
        axis.annotate(
            word, tuple(map(float, end.values)), xytext=(4, 4), textcoords="offset points",
            fontsize="small",
        )  # fmt: skip
    units = getattr(curve.system, "parameter_units", {})
    one, two = (_axes.labelled(name, units.get(name)) for name in curve.parameters)
    axis.set(xlabel=one, ylabel=two)
    return axis
