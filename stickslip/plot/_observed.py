"""Rows of numbers to draw: observables of a solution, or variables of a dataset."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr
from jaxtyping import PyTree

from .._jit_by_code import jit_by_code
from .._validation import check_handed_on, check_known, refusal
from ..analysis.observable import as_observable
from ..hybrid import AbstractHybridSystem, Solution
from ..hybrid.components import components_of, entries, per_second, period_of, second_of, unit_of
from ._sticks import rows_of

OBSERVABLES = "the name of an observable, or a sequence of names"


class Series(NamedTuple):
    """An observable over time: batch axes in front, the rows last."""

    name: str
    unit: str | None
    period: float | None
    values: np.ndarray


class Source:
    """A motion that was kept: a solution with its system, or a dataset of `time_history`.

    With `one` it must be a single run, or `lane` says which of a batch it is.
    """

    solution: Any

    def __init__(self, solution: Any, system: Any, args: PyTree, *, one: bool, lane: Any = None):
        self.solution, self.system, self.args = solution, system, args
        if system is not None and not isinstance(system, AbstractHybridSystem):
            raise refusal("system", system, "an AbstractHybridSystem or None", TypeError)
        if isinstance(solution, xr.Dataset):
            if "time" not in solution.dims or "time" not in solution.coords:
                raise refusal("solution", "a Dataset", "a Dataset over `time`")
            if lane is not None:
                raise refusal(
                    "lane", lane, "left out for a Dataset, of which dataset.isel takes one run"
                )
            self.parts = _variables(solution)
            return
        if not isinstance(solution, Solution):
            raise refusal("solution", solution, "a Solution, or a Dataset over `time`", TypeError)
        if system is None:
            raise refusal("system", system, "the system of the solution", TypeError)
        check_known("solution", solution)
        if one:
            self.solution = solution = one_run(solution, lane)
        self.log = rows_of(solution)
        if self.log is None:
            saved = "of a run with saveat=SaveAt(ts=...) or SaveAt(steps=True)"
            raise refusal("solution", solution, saved)
        check_handed_on("args", args)
        # The values are not read: only what parts the state has, and of which shapes.
        batch = solution.t1.ndim
        self.state = jax.tree.map(lambda a: np.zeros(np.shape(a)[batch:]), solution.y1)
        self.components = components_of(self.state)
        self.parts = _parts(self.components)

    @property
    def dataset(self) -> bool:
        """Whether it is a dataset, in which everything has been computed."""
        return isinstance(self.solution, xr.Dataset)

    @property
    def names(self) -> tuple[str, ...]:
        """Names that can be drawn: single numbers of the state, or of the variables over time."""
        return tuple(name for name in self.parts if not self.dataset or name != "mode")

    def function(self, argument: str, name: Any) -> Any:
        """Function of an observable; an error where there is none of the name."""
        if self.dataset:
            if not isinstance(name, str) or name not in self.parts:
                raise refusal(argument, name, f"one of {', '.join(self.parts)}")
            return None
        return function_of(argument, name, self.system, self.state)

    def read(self, y: PyTree, name: str) -> np.ndarray:
        """A single number of the state over the rows of a log."""
        component, index = self.parts[name]
        return np.asarray(components_of(y)[component])[(..., *index)]

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

    def row(self, name: Any, function: Any) -> Series:
        """An observable over all rows."""
        if self.dataset:
            variable, index = self.parts[name]
            found, attrs = self.solution[variable], self.solution[variable].attrs
            label = str(attrs.get("long_name", variable)) + name.removeprefix(variable)
            values = np.asarray(found)[(slice(None), *index)]
            return Series(label, attrs.get("units"), attrs.get("period"), values)
        if function is not None:
            log, label = self.log, name if isinstance(name, str) else "observable"
            rows, axes = (log.t, log.y, log.dy, log.mode), self.solution.t1.ndim + 1
            values = _evaluate(function, axes, self.system, rows, self.args)
            return Series(label, None, None, self._kept(values))
        plain = name.removeprefix("slope of ")
        component = self.parts[plain][0]
        unit, period = unit_of(self.system, component), period_of(self.system, component)
        if plain != name:
            return Series(name, per_second(unit), None, self._kept(self.read(self.log.dy, plain)))
        return Series(name, unit, period, self._kept(self.read(self.log.y, plain)))


def function_of(argument: str, name: Any, system: Any, state: PyTree) -> Any:
    """Function of an observable, None for a single number of the state; an error if it is neither."""
    components = components_of(state)
    parts = _parts(components)
    plain = name.removeprefix("slope of ") if isinstance(name, str) else name
    if isinstance(name, str) and plain in components:
        if plain not in parts:
            of_it = entries(plain, np.shape(components[plain]))
            allowed = f"a single number, one of {', '.join(name.replace(plain, k) for k in of_it)}"
            raise refusal(argument, name, allowed)
        return None
    if isinstance(name, str) and plain in parts:
        return None
    return as_observable(argument, name, system, state)[0]


def one_run(solution: Any, lane: Any) -> Any:
    """A single run: the solution itself, or the one with the number `lane` of a batch."""
    shape = solution.t1.shape
    if not shape:
        if lane is not None:
            raise refusal("lane", lane, "None: the solution is a single run")
        return solution
    if lane is None:
        how = ", ".join(f"0 to {n - 1}" for n in shape)
        say = f"lane={how}" if len(shape) == 1 else f"lane=({how})"
        raise refusal(
            "solution", solution, f"a single run, or {say} given to draw one run of the batch",
            but=f"of shape {shape}",
        )  # fmt: skip
    place = tuple(lane) if isinstance(lane, tuple | list) else (lane,)
    if len(place) != len(shape) or not all(
        isinstance(i, int) and not isinstance(i, bool) and 0 <= i < n
        for i, n in zip(place, shape, strict=True)
    ):
        last = ", ".join(str(n - 1) for n in shape)
        many = "the number of one run of the batch, from 0 to " + last
        if len(shape) > 1:
            many = f"{len(shape)} numbers, those of one run of the batch, up to ({last})"
        raise refusal("lane", lane, many, but=f"for a solution of shape {shape}")
    return jax.tree.map(lambda a: a[place], solution)


def _parts(components: Mapping[str, Any]) -> dict[str, tuple[str, tuple[int, ...]]]:
    """The single numbers of components by name: which component each belongs to, and where in it."""
    return {
        entry: (name, index)
        for name, value in components.items()
        for entry, index in entries(name, np.shape(value)).items()
    }


def _variables(dataset: xr.Dataset) -> dict[str, tuple[str, tuple[int, ...]]]:
    """The same of the variables over time of a dataset of one run, whose own axes come after it."""
    found = {str(k): v for k, v in dataset.data_vars.items() if v.dims[:1] == ("time",)}
    if not found:
        batches = {d for v in dataset.data_vars.values() if "time" in v.dims for d in v.dims}
        over = ", ".join(sorted(map(str, batches - {"time"}))) or "nothing else"
        such = "of one run, with variables over `time` first: dataset.isel(run=0) takes one of a batch"
        raise refusal(
            "solution", "a Dataset", such, but=f"whose variables are over {over} before `time`"
        )
    return _parts({k: v[0] if v.sizes["time"] else np.zeros(v.shape[1:]) for k, v in found.items()})


@jit_by_code
def _evaluate(function: Any, axes: int, system: Any, log: tuple, args: PyTree) -> Any:
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


def with_gaps(row: Series) -> np.ndarray:
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


def list_of_names(what: Mapping[str, Any]) -> str:
    """Names in a row, for messages."""
    return ", ".join(map(repr, what)) or "none"
