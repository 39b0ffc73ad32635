"""Solutions as labelled datasets and tables."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from .._validation import check_known, numbers, refusal, shape_refusal
from .accuracy import ACCURACY
from .arguments import the_system
from .components import components_of, entries, own_axes, per_second, period_of, second_of, unit_of
from .status import RESULTS


def mode_attributes(system: Any, *modes: Any) -> dict[str, list]:
    """Names of all modes, or of those that occur where there are many."""
    names = system.mode_names
    if len(names) <= ACCURACY.named_modes:
        return {"mode_names": list(names)}
    met = np.unique(np.concatenate([np.ravel(np.asarray(m)) for m in modes]))
    met = [int(m) for m in met if m >= 0]
    return {"mode_numbers": met, "mode_names": [names[m] for m in met]}


def _batch_axes(batch: Any, shape: tuple[int, ...], system: Any) -> dict[str, Any]:
    """Names of the batch axes, with their coordinates or None."""
    default = ["run"] if len(shape) == 1 else [f"run_{i}" for i in range(len(shape))]
    names = default if batch is None else [batch] if isinstance(batch, str) else batch
    allowed = f"{len(shape)} names of batch axes, or as many names with their coordinates"
    if not isinstance(names, Mapping | list | tuple) or not all(
        isinstance(n, str) and n for n in names
    ):
        raise refusal("batch", batch, allowed, TypeError)
    if len(set(names)) != len(shape) or len(names) != len(shape):
        raise refusal("batch", batch, allowed)
    if not isinstance(names, Mapping):
        return dict.fromkeys(names)
    found = {}
    for (name, values), size in zip(names.items(), shape, strict=True):
        row = numbers(f"batch[{name!r}]", values, "a row of numbers")
        if row.shape != (size,):
            raise shape_refusal(f"batch[{name!r}]", values, f"of shape {(size,)}, as the axis")
        found[name] = (name, row, _units(system.parameter_units.get(name)))
    return found


def _units(unit: str | None, **more: Any) -> dict[str, Any]:
    return {
        **({} if unit is None else {"units": unit}),
        **{k: v for k, v in more.items() if v is not None},
    }


def _check(name: str, given: Any, system: Any) -> None:
    """Raise for anything that is not a system, and for a log or solution that is traced."""
    the_system(system)
    check_known(name, given)


def solution_dataset(solution: Any, system: Any, batch: Any) -> Any:
    """See `Solution.to_dataset`."""
    import xarray as xr

    _check("solution", solution, system)
    shape = np.shape(solution.t1)
    axes = _batch_axes(batch, shape, system)
    log = solution.steps if solution.outputs is None else solution.outputs
    front, second = tuple(axes), second_of(system)
    coords = {name: given for name, given in axes.items() if given is not None}
    data: dict[str, Any] = {}

    def add(prefix: str, y: Any, rows: tuple[str, ...], slope: bool = False) -> None:
        for name, leaf in components_of(y).items():
            values, unit, period = np.asarray(leaf), unit_of(system, name), period_of(system, name)
            own = own_axes(name, values.ndim - len(front) - len(rows))
            if slope:
                unit, period = per_second(unit), None
            data[f"{prefix}{name}"] = ((*front, *rows, *own), values, _units(unit, period=period))

    modes = [solution.mode1]
    if log is not None:
        times, kept = _times(log, shape)
        row = "time" if times is not None else "row"
        if times is not None:
            coords["time"] = ("time", times, _units(second))
        else:
            data["t"] = ((*front, row), np.asarray(log.t)[..., :kept], _units(second))
        cut = _rows_in_use(log, kept)
        add("", cut.y, (row,))
        add("slope_of_", cut.dy, (row,), slope=True)
        data["mode"] = ((*front, row), np.asarray(cut.mode), {})
        modes.append(cut.mode)
    if solution.events is not None:
        events = _rows_in_use(
            solution.events, int(np.max(np.asarray(solution.events.count), initial=0))
        )
        rows = ("event",)
        data["event_t"] = ((*front, *rows), np.asarray(events.t), _units(second))
        for name in ("guard", "mode_before", "mode_after"):
            data[f"event_{name}"] = ((*front, *rows), np.asarray(getattr(events, name)), {})
        add("before_", events.y_before, rows)
        add("after_", events.y_after, rows)
        modes += [events.mode_before, events.mode_after]
    for k, crossing in enumerate(solution.crossings):
        found = _rows_in_use(crossing, int(np.max(np.asarray(crossing.count), initial=0)))
        rows = (f"crossing_{k}",)
        data[f"crossing_{k}_t"] = ((*front, *rows), np.asarray(found.t), _units(second))
        add(f"crossing_{k}_", found.y, rows)
    names = list(RESULTS._name_to_item)
    add("end_", solution.y1, ())
    data |= {
        "end_t": (front, np.asarray(solution.t1), _units(second)),
        "end_mode": (front, np.asarray(solution.mode1), {}),
        "num_events": (front, np.asarray(solution.num_events), {}),
        "flags": (front, np.asarray(solution.flags), {}),
        "flagged_at": (front, np.asarray(solution.flagged_at), _units(second)),
        "flagged_guard": (front, np.asarray(solution.flagged_guard), {}),
        "result": (
            front, np.asarray(solution.result._value),
            {"flag_values": list(range(len(names))), "flag_meanings": " ".join(names)},
        ),
    }  # fmt: skip
    attrs = {**mode_attributes(system, *modes), "guard_names": list(system.guard_names)}
    return xr.Dataset(data, coords, attrs)


def _times(log: Any, shape: tuple[int, ...]) -> tuple[np.ndarray | None, int]:
    """Times of the rows where all runs have the same, else None; and how many rows are in use."""
    count, t = np.asarray(log.count), np.asarray(log.t)
    kept = int(np.max(count, initial=0))
    t = t[..., :kept].reshape(-1, kept)
    if not t.shape[0]:
        return np.zeros(kept), kept
    longest = t[int(np.argmax(count))]
    # Rows past the end of a run are NaN, and say nothing against those of the others.
    same = np.isnan(t) | (t == longest[None, :])
    return (longest, kept) if same.all() else (None, kept)


def _rows_in_use(log: Any, kept: int) -> Any:
    """The rows in use; the axis of rows follows those of the batch."""
    batch = np.ndim(log.count)

    def first_rows(a: Any) -> Any:
        row = (slice(None),) * batch + (slice(0, kept),)
        return np.asarray(a) if np.ndim(a) <= batch else np.asarray(a)[row]

    return jax.tree.map(first_rows, log)


def events_dataframe(events: Any, system: Any) -> Any:
    """See `EventLog.to_dataframe`."""
    _check("events", events, system)
    modes, guards = system.mode_names, system.guard_names
    named = {"guard": guards, "mode_before": modes, "mode_after": modes}
    states = {"_before": events.y_before, "_after": events.y_after}
    return _dataframe("events", events, system, named, states, "event")


def states_dataframe(log: Any, system: Any) -> Any:
    """See `Solution.to_dataframe`."""
    _check("log", log, system)
    return _dataframe("log", log, system, {"mode": system.mode_names}, {"": log.y}, "row")


def _dataframe(
    argument: str, log: Any, system: Any, named: Mapping[str, Any], states: Mapping[str, Any], row: str
) -> Any:
    """A row for each row of a log in use: times, `named` columns of codes, components of `states`."""
    import pandas as pd

    kept = np.arange(np.shape(log.t)[-1]) < np.asarray(log.count)[..., None]
    table: dict[str, Any] = {"t": np.asarray(log.t)[kept]}
    units = {"t": second_of(system)}
    for name, known in named.items():
        table[name] = _names(f"{argument}.{name}", np.asarray(getattr(log, name))[kept], known)
    for end, y in states.items():
        for name, leaf in components_of(y).items():
            rows, unit = np.asarray(leaf)[kept], unit_of(system, name)
            for entry, index in entries(name, rows.shape[1:]).items():
                table[f"{entry}{end}"] = rows[(slice(None), *index)]
                if unit is not None:
                    units[f"{entry}{end}"] = unit
    where = np.nonzero(kept)
    if kept.ndim == 1:
        index: Any = pd.Index(where[0], name=row)
    else:
        runs = ["run"] if kept.ndim == 2 else [f"run_{i}" for i in range(kept.ndim - 1)]
        index = pd.MultiIndex.from_arrays(list(where), names=[*runs, row])
    frame = pd.DataFrame(table, index=index)
    frame.attrs["units"] = units
    return frame


def _names(argument: str, codes: np.ndarray, names: Sequence[str]) -> list[str | None]:
    """Names of modes or guards by number; None where there is none."""
    if codes.size and int(codes.max()) >= len(names):
        raise refusal(
            argument, int(codes.max()), f"below {len(names)}, the number of names of the system"
        )
    return [names[int(code)] if code >= 0 else None for code in codes]
