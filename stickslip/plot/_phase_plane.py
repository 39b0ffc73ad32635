"""One observable over another."""

from typing import Any

import xarray as xr
from jaxtyping import PyTree
from matplotlib.axes import Axes

from .._types import Given
from .._validation import refusal
from ..hybrid import AbstractHybridSystem, Solution
from ..mechanism import AbstractMechanism
from . import _axes
from ._observed import Source, with_gaps
from ._sticks import mechanism_of


def phase_plane(
    solution: Given[Solution | xr.Dataset],
    system: Given[AbstractHybridSystem | None] = None,
    x: Given[str | None] = None,
    y: Given[str | None] = None,
    *,
    args: PyTree = None,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """One observable of a motion over another: by default a rate over its coordinate.

    **Arguments**: `solution`, `system`, `args`, `options` as for `motion`; `x`, `y`: an observable
    each, as there; by default the first component and its rate, of any other system the first
    component that is not `x`. Of a batch of solutions each run is a line.

    **Returns** the axes. A component with a period is drawn within half of it on both sides of zero.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    source = Source(solution, system, args, one=False)
    if x is None:
        x = _first(source, "x", None)
    y = _rate(source, x) if y is None else y
    chosen = {"x": x, "y": y}
    functions = {argument: source.function(argument, what) for argument, what in chosen.items()}
    axis, options = _axes.begin(ax, options, color=_axes.BLUE, linewidth=0.8)
    across, along = (source.row(chosen[a], functions[a]) for a in ("x", "y"))
    size = across.values.shape[-1]
    across_rows, along_rows = (with_gaps(row).reshape(-1, size) for row in (across, along))
    for one, other in zip(across_rows, along_rows, strict=True):
        axis.plot(one, other, **options)
    axis.set_xlabel(_axes.axis_label(across.name, across.unit))
    axis.set_ylabel(_axes.axis_label(along.name, along.unit))
    return axis


def _first(source: Source, argument: str, other: str | None) -> str:
    """The first component that is not the other one."""
    found = [name for name in source.names if name != other]
    if not found:
        raise refusal(argument, None, "named, where there are not two components")
    return found[0]


def _rate(source: Source, x: str) -> str:
    """The rate of a coordinate of a mechanism; else another component."""
    inner = mechanism_of(source.system)
    if isinstance(inner, AbstractMechanism) and x in inner.names.coordinates:
        rate = inner.names.velocities[inner.names.coordinates.index(x)]
        if rate in source.names:
            return rate
    return _first(source, "y", x)
