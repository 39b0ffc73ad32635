"""Maps of hunting: where loops rest, hunt, creep or are unstable, and how far they hunt."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type, refusal
from ..control import HuntingMap
from . import _axes

COLORS = {"rests": "lightgrey", "creeps": "tan", "unstable": "black"}


def hunting(
    found: Given[HuntingMap],
    axes: Given[tuple[str, str] | None] = None,
    *,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """Verdicts over two of the values of a map, hunting loops coloured by their amplitude.

    - `found`: of `stickslip.control.hunting_map`. `axes`: names of two of its values, the first two by
      default; of further ones all loops are drawn over each other.
    - `ax`, `options`: axes to draw into, properties of markers.

    **Returns** the axes. **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("found", found, HuntingMap, "a HuntingMap of stickslip.control")
    known = tuple(found.values)
    names = known[:2] if axes is None else axes
    if not isinstance(names, tuple | list) or len(names) != 2 or any(n not in known for n in names):
        raise refusal("axes", axes, f"two of {', '.join(known)}")
    axis, options = _axes.begin(ax, options, marker="s", s=12.0)
    x, y = (np.ravel(found.values[name]) for name in names)
    verdict, amplitude = np.ravel(found.verdict), np.ravel(np.asarray(found.amplitude))
    for word in np.unique(verdict):
        here = verdict == word
        look = {"color": COLORS[word]} if word in COLORS else {"c": amplitude[here], "cmap": "autumn_r"}
        look = options if "color" in options else {**look, **options}
        marks = axis.scatter(x[here], y[here], label=word, **look)
        if "c" in look:
            axis.figure.colorbar(marks, ax=axis, label="amplitude of hunting")
    axis.set_xlabel(_axes.axis_label(names[0], None))
    axis.set_ylabel(_axes.axis_label(names[1], None))
    _axes.legend(axis)
    return axis
