"""A motion over time, its sticks shaded and its events marked."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import PyTree
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_flag, refusal
from ..hybrid import AbstractHybridSystem, Solution
from . import _axes
from ._observed import Source, list_of_names, several, with_gaps, within
from ._shade import bands
from ._sticks import contacts_of, intervals_of

SHADES = ("0.82", "#dbe6f4", "#f4e3d3", "#dcefdc", "#eadff0")


def motion(
    solution: Given[Solution | xr.Dataset],
    system: Given[AbstractHybridSystem | None] = None,
    observables: Given[str | Sequence[str] | None] = None,
    *,
    lane: Given[int | Sequence[int] | None] = None,
    contacts: Given[str | Sequence[str] | None] = None,
    events: bool = True,
    args: PyTree = None,
    ax: Given[Axes | Sequence[Axes] | None] = None,
    **options: Any,
) -> Any:
    """Observables of one motion over time, with its sticks shaded and its events marked.

    **Arguments**

    - `solution`: of `simulate` with `SaveAt(ts=...)` or `SaveAt(steps=True)`, and its `system`; or a
      Dataset over `time`, of `time_history` or `solution.to_dataset`.
    - `lane`: of a batch of runs the number of the one that is drawn, or its numbers along the batch
      axes, with the `system` of that run; of a Dataset take one run with `isel` or `sel`.
    - `observables`: a component of the state, `"x[0]"` for one number of an array, `"slope of x"`, a
      method `(t, y, mode, args)` of the system, a function `(system, t, y, dy, mode, args)`; or a
      sequence of them; all components by default. Of a dataset the names of its variables.
    - `contacts`: names of the contacts whose sticks are shaded, all by default; `()` for none. Several
      share the height, the first one at the bottom.
    - `events`: whether events are marked, by a dot on the curve. Datasets have no events.
    - `args`: what `simulate` was given.
    - `ax`: axes to draw into: one for a single observable, else one for each.
    - `options`: properties of the lines, as matplotlib calls them.

    **Returns** the axes: one for a single observable, else an array of them. Sticks are drawn from the
    log of events, to rounding; without one, or for a dataset, from the modes of the rows. A component
    with a period is drawn within half of it on both sides of zero, with a gap where it goes round.

    **Raises** `ValueError`, `TypeError` naming the argument; for a batch without a `lane`: the sticks
    and events of several runs do not share axes. `phase_plane` draws all of them.
    """
    source = Source(solution, system, args, one=True, lane=lane)
    check_flag("events", events)
    functions, single = several(source, observables)
    shaded = _contacts(source, contacts)
    rows = None if single else len(functions)
    axes, options = _axes.begin(ax, options, rows, color=_axes.BLUE, linewidth=1.0)
    held = intervals_of(source) if shaded else {}
    time, (name, unit) = source.time, source.time_label
    for axis, (what, function) in zip(np.atleast_1d(axes), functions.items(), strict=True):
        row = source.row(what, function)
        for i, contact in enumerate(shaded):
            bands(
                axis, held[contact], label=f"{contact} sticks" if contact else "stick",
                color=SHADES[i % len(SHADES)], low=i / len(shaded), high=(i + 1) / len(shaded),
            )  # fmt: skip
        axis.plot(time, with_gaps(row), **options)
        if events and not source.dataset and source.solution.events is not None:
            _mark(axis, source, what, function, row)
        axis.set_ylabel(_axes.axis_label(row.name, row.unit))
        if ax is None:
            axis.set_xlim(time[0], time[-1])
    np.atleast_1d(axes)[-1].set_xlabel(_axes.axis_label(name, unit))
    if ax is None:
        _axes.legend(np.atleast_1d(axes)[0])
    return axes


def _contacts(source: Source, contacts: Any) -> tuple[str, ...]:
    """Names of the contacts to shade, checked."""
    if source.system is None:
        known = ("",) if "mode_names" in source.solution.attrs and "mode" in source.solution else ()
    else:
        known = contacts_of(source.system)
        if source.dataset and "mode" not in source.solution:
            known = ()
    if contacts is None:
        return known
    row = (contacts,) if isinstance(contacts, str) else contacts
    if not isinstance(row, list | tuple) or not all(isinstance(name, str) for name in row):
        raise refusal("contacts", contacts, "the name of a contact, or a sequence of names", TypeError)
    for name in row:
        if name not in known:
            among = list_of_names(dict.fromkeys(known))
            raise refusal("contacts", contacts, f"of the contacts that may stick: {among}")
    return tuple(row)


def _mark(axis: Axes, source: Source, what: Any, function: Any, row: Any) -> None:
    """A dot at each event: of a component its value before it, else the value of the curve there."""
    log = source.solution.events
    count = int(log.count)
    if not count:
        return
    time = np.asarray(log.t)[:count]
    if function is None and not what.startswith("slope of "):
        values = source.read(log.y_before, what)[:count]
        values = values if row.period is None else within(values, row.period)
    else:
        values = np.interp(time, source.time, row.values)
    axis.plot(time, values, ".", color=_axes.RED, ms=4, label="events", zorder=3)
