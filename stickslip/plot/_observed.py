"""Rows of numbers to draw: observables of a solution, or variables of a dataset."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
import xarray as xr
from jaxtyping import PyTree

from .._validation import check_handed_on, is_concrete, refusal
from ..analysis._observable import as_observable
from ..hybrid import AbstractHybridSystem, Solution
from ..hybrid._components import components_of, period_of, unit_of
from ..hybrid._labelled import per_second, second_of
from ._sticks import rows_of

OBSERVABLES = "the name of an observable, or a sequence of names"


class Row(NamedTuple):
    """An observable over time: batch axes in front, the rows last."""

    name: str
    unit: str | None
    period: float | None
    values: np.ndarray


class Source:
    """A motion that was kept: a solution with its system, or a dataset of `time_history`."""

    def __init__(self, solution: Any, system: Any, args: PyTree, *, one: bool):
        self.solution, self.system, self.args = solution, system, args
        if system is not None and not isinstance(system, AbstractHybridSystem):
            raise refusal("system", system, "an AbstractHybridSystem or None", TypeError)
        if isinstance(solution, xr.Dataset):
            if "time" not in solution.dims or "time" not in solution.coords:
                raise refusal("solution", "a Dataset", "a Dataset over `time`")
            return
        if not isinstance(solution, Solution):
            raise refusal("solution", solution, "a Solution, or a Dataset over `time`", TypeError)
        if system is None:
            raise refusal("system", system, "the system of the solution", TypeError)
        if not is_concrete(solution):
            raise refusal("solution", solution, "known: call this outside of jit and vmap", TypeError)
        if one and solution.t1.ndim:
            take = "one run of the batch: jax.tree.map(lambda a: a[0], solution)"
            raise refusal("solution", solution, take, but=f"of shape {solution.t1.shape}")
        self.log = rows_of(solution)
        if self.log is None:
            saved = "of a run with saveat=SaveAt(ts=...) or SaveAt(steps=True)"
            raise refusal("solution", solution, saved)
        check_handed_on("args", args)
        # The values are not read: only what parts the state has.
        self.components = components_of(solution.y1)

    @property
    def dataset(self) -> bool:
        """Whether it is a dataset, in which everything has been computed."""
        return isinstance(self.solution, xr.Dataset)

    @property
    def names(self) -> tuple[str, ...]:
        """What is there to draw: components that are single numbers, or variables over time alone."""
        if self.dataset:
            found = self.solution.data_vars.items()
            return tuple(str(k) for k, v in found if v.dims == ("time",) and k != "mode")
        batch = self.solution.t1.ndim
        return tuple(k for k, v in self.components.items() if np.ndim(v) == batch)

    def function(self, argument: str, name: Any) -> Any:
        """What computes an observable; refused where there is none of the name."""
        if self.dataset:
            # What has no other axis than time can be drawn as a line.
            known = [str(k) for k, v in self.solution.data_vars.items() if v.dims == ("time",)]
            if not isinstance(name, str) or name not in known:
                raise refusal(argument, name, f"one of {', '.join(known)}")
            return None
        plain = name.removeprefix("slope of ") if isinstance(name, str) else name
        if isinstance(name, str) and plain in self.components:
            if plain not in self.names:
                raise refusal(argument, name, f"one of {', '.join(self.names)}: a single number")
            return None
        return as_observable(argument, name, self.system, self.solution.y1)[0]

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s]; batch axes in front."""
        if self.dataset:
            return np.asarray(self.solution.time)
        return self._kept(self.log.t)

    @property
    def time_label(self) -> tuple[str, str | None]:
        """Name and unit of the time."""
        if self.dataset:
            return "t", self.solution.time.attrs.get("units", "s")
        return "t", second_of(self.system)

    def _kept(self, values: Any) -> np.ndarray:
        values = np.asarray(values)
        return values if self.solution.t1.ndim else values[: int(self.log.count)]

    def row(self, name: Any, function: Any) -> Row:
        """An observable over all rows."""
        if self.dataset:
            found = self.solution[name]
            label = str(found.attrs.get("long_name", name))
            return Row(label, found.attrs.get("units"), found.attrs.get("period"), np.asarray(found))
        if function is not None:
            log, label = self.log, name if isinstance(name, str) else "observable"
            rows, axes = (log.t, log.y, log.dy, log.mode), self.solution.t1.ndim + 1
            values = _evaluated(function, axes, self.system, rows, self.args)
            return Row(label, None, None, self._kept(values))
        plain = name.removeprefix("slope of ")
        unit, period = unit_of(self.system, plain), period_of(self.system, plain)
        if plain != name:
            return Row(name, per_second(unit), None, self._kept(components_of(self.log.dy)[plain]))
        return Row(name, unit, period, self._kept(components_of(self.log.y)[plain]))


@eqx.filter_jit
def _evaluated(function: Any, axes: int, system: Any, log: tuple, args: PyTree) -> Any:
    def one(t, y, dy, mode):
        return function(system, t, y, dy, mode, args)

    for _ in range(axes):
        one = jax.vmap(one)
    return one(*log)


def several(source: Source, observables: Any) -> tuple[dict[Any, Any], bool]:
    """Functions by observable, and whether it is a row of them; all there are for None."""
    single = isinstance(observables, str) or callable(observables)
    if observables is None:
        names: Sequence[Any] = source.names
    elif single:
        names = (observables,)
    elif isinstance(observables, Sequence) and not isinstance(observables, bytes) and observables:
        names = observables
    else:
        raise refusal("observables", observables, OBSERVABLES, TypeError)
    found = {}
    for i, name in enumerate(names):
        where = "observables" if single or observables is None else f"observables[{i}]"
        if not isinstance(name, str) and not callable(name):
            raise refusal(where, name, OBSERVABLES, TypeError)
        found[name] = source.function(where, name)
    return found, single


def unbroken(row: Row) -> np.ndarray:
    """Values of one run; of a periodic one within half a period of zero, with a gap where it jumps."""
    if row.period is None:
        return row.values
    inside = within(row.values, row.period)
    jumps = np.abs(np.diff(inside, axis=-1)) > 0.5 * row.period
    # NaN in place of the first value behind the jump: a line of matplotlib has a gap there.
    inside[..., 1:][jumps] = np.nan
    return inside


def within(values: np.ndarray, period: float) -> np.ndarray:
    """Values of a periodic quantity from minus to plus half a period."""
    return np.mod(np.asarray(values) + 0.5 * period, period) - 0.5 * period


def named(what: Mapping[str, Any]) -> str:
    """Names in a row, for messages."""
    return ", ".join(map(repr, what)) or "none"
