"""Basins of attraction over two components of the start, and their shares over a parameter."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap

from .._attractor_color import attractor_color
from .._types import Given
from .._validation import check_type, refusal
from ..basin import Basins, BasinsOver
from ..hybrid import AbstractHybridSystem
from ..hybrid.components import components_of, entries, split, unit_of
from . import _axes


def basins(
    found: Given[Basins],
    system: Given[AbstractHybridSystem],
    axes: Given[tuple[str, str] | None] = None,
    *,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """Starts coloured by the attractor that their motion comes to.

    - `found`: of `stickslip.basin.basins`; `system`: for units.
    - `axes`: two components of its box, the first two by default. A grid over these two is drawn as
      cells, anything else as dots.
    - `ax`, `options`: axes to draw into, properties of the dots.

    **Returns** the axes. **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("found", found, Basins, "a Basins of stickslip.basin")
    check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
    known = tuple(found.box)
    names = known[:2] if axes is None else axes
    if not isinstance(names, tuple | list) or len(names) != 2 or any(n not in known for n in names):
        raise refusal("axes", axes, f"two of {', '.join(known)}")
    axis, options = _axes.begin(ax, options, marker="s", linestyle="none", markersize=2.0)
    columns = components_of(found.starts)
    x, y = (_column(columns, name, found.code.ndim) for name in names)
    for number, (code, name) in enumerate(found.names.items()):
        here, color = found.code == code, attractor_color(name, number)
        look = {"color": color, **options}
        if found.code.ndim == 2 and tuple(names) in (known, known[::-1]):
            cells = np.ma.masked_where(~here, here.astype(float))
            axis.pcolormesh(x, y, cells, cmap=ListedColormap([color]), norm=BoundaryNorm([0, 2], 1))
            axis.plot([], [], "s", color=color, label=name)
        else:
            axis.plot(x[here], y[here], label=name, **look)
    for name, set_label in zip(names, (axis.set_xlabel, axis.set_ylabel), strict=True):
        set_label(_axes.axis_label(name, unit_of(system, split(name)[0])))
    _axes.legend(axis)
    return axis


def _column(columns: dict[str, Any], name: str, axes: int) -> np.ndarray:
    """Values of one number of the state, with the axes of the starts."""
    base, _ = split(name)
    index = entries(base, np.shape(columns[base])[axes:])[name]
    return np.asarray(columns[base])[(..., *index)]


def shares(found: Given[BasinsOver], *, ax: Given[Axes | None] = None, **options: Any) -> Axes:
    """Shares of the basins over the parameter, one upon the other.

    - `found`: of `stickslip.basin.basins_over`.
    - `ax`, `options`: axes to draw into, properties of the lines between them.

    **Returns** the axes. **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("found", found, BasinsOver, "a BasinsOver of stickslip.basin")
    axis, options = _axes.begin(ax, options, color="white", linewidth=1.0)
    low = np.zeros(len(found.values))
    for number, (name, share) in enumerate(found.shares.items()):
        axis.fill_between(
            found.values, low, low + share, color=attractor_color(name, number), label=name
        )
        low = low + share
        axis.plot(found.values, low, **options)
    axis.set_xlabel(found.parameter)
    axis.set_ylabel("share of the box")
    axis.set_ylim(0.0, 1.0)
    _axes.legend(axis)
    return axis
