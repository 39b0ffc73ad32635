"""Curves of special points over two parameters."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type
from ..continuation import BifurcationCurve
from . import _axes


def curve(curve: Given[BifurcationCurve], *, ax: Given[Axes | None] = None, **options: Any) -> Axes:
    """A curve of special points in the plane of its two parameters, special points and ends marked.

    **Arguments**

    - `curve`: of `stickslip.continuation.continue_point`.
    - `ax`, `options`: axes to draw into; properties of the line.

    **Returns** the axes. Special points have their label; an end at a bound is not marked, others have
    the first word of their reason.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("curve", curve, BifurcationCurve, "a BifurcationCurve of continuation.continue_point")
    _axes.check_axes(ax)
    options = {"label": curve.label, "color": _axes.BLUE, **_axes.check_options(options)}
    axis = _axes.canvas(ax)
    axis.plot(*curve.values.T, **options)
    unmarked = "bounds of", "closed", "begins", "max_points", *(s.label for s in curve.specials)
    marks = [(special.label, special.values) for special in curve.specials]
    words = [(end.words.partition(":")[0], end.values) for end in curve.ends]
    for word, values in [*marks, *(end for end in words if not end[0].startswith(unmarked))]:
        axis.plot(*np.asarray(values), "o", color="black", markersize=4)
        axis.annotate(
            word, tuple(map(float, values)), xytext=(4, 4), textcoords="offset points", fontsize="small"
        )
    units = getattr(curve.system, "parameter_units", {})
    one, two = (_axes.axis_label(name, units.get(name)) for name in curve.parameters)
    axis.set(xlabel=one, ylabel=two)
    return axis
