"""Which contacts stick in a mode, and from when to when."""

from typing import Any

import numpy as np

from ..hybrid import AbstractHybridSystem, Solution, WithPeriodicBreaks
from ..mechanism import AbstractMechanism
from ._shade import spans


def mechanism_of(system: Any) -> Any:
    """The system inside of whatever wraps it, such as `WithBreaks`."""
    while not isinstance(system, AbstractMechanism) and isinstance(
        getattr(system, "system", None), AbstractHybridSystem
    ):
        system = system.system
    return system


def contacts_of(system: AbstractHybridSystem) -> tuple[str, ...]:
    """Names of the contacts that may stick; one without a name where only a mode is called so."""
    inner = mechanism_of(system)
    if isinstance(inner, AbstractMechanism):
        return inner.names.contacts
    return ("",) if any("stick" in name for name in inner.mode_names[:1024]) else ()


def sticking(system: AbstractHybridSystem, modes: np.ndarray) -> dict[str, np.ndarray]:
    """Whether each contact sticks, by name, in each of a row of modes; not in mode -1."""
    inner, names = mechanism_of(system), contacts_of(system)
    known, place = np.unique(modes, return_inverse=True)
    if not names:
        return {}
    own = np.maximum(known, 0)
    while system is not inner:
        if isinstance(system, WithPeriodicBreaks):
            own = own % len(system.system.mode_names)
        system = getattr(system, "system")  # noqa: B009
    if isinstance(inner, AbstractMechanism):
        states = inner.states(own)
        rows = [np.asarray(states[c]) == 0.0 for c in range(len(names))]
    else:
        rows = [np.array(["stick" in inner.mode_names[int(m)] for m in own])]
    return {
        name: (np.broadcast_to(row, known.shape) & (known >= 0))[place]
        for name, row in zip(names, rows, strict=True)
    }


def intervals(solution: Solution, system: AbstractHybridSystem) -> dict[str, list[tuple[float, float]]]:
    """From when to when each contact sticks, by the log of events: to rounding.

    Of contacts that stick on while others change, one interval. Where there is no log, or not all of
    it, by the modes of the rows that were kept, between which nothing is known.
    """
    log = solution.events
    count = -1 if log is None else int(log.count)
    if log is None or count < int(solution.num_events):
        rows = rows_of(solution)
        if rows is None:
            return {}
        time, mode = np.asarray(rows.t)[: int(rows.count)], np.asarray(rows.mode)[: int(rows.count)]
        return {name: spans(time, held) for name, held in sticking(system, mode).items()}
    edges = np.concatenate([[solution.t0], np.asarray(log.t)[:count], [solution.t1]])
    first = log.mode_before[0] if count else solution.mode1
    modes = np.concatenate([[first], np.asarray(log.mode_after)[:count]]).astype(np.int64)
    # A stick of no duration is not seen: a contact that passes through rest, events at one instant.
    lasts = np.diff(edges) > 0.0
    begin, end, modes = edges[:-1][lasts], edges[1:][lasts], modes[lasts]
    return {name: spans(begin, held, end) for name, held in sticking(system, modes).items()}


def intervals_of(source: Any) -> dict[str, list[tuple[float, float]]]:
    """The same of a `Source`; of a dataset by the modes of its rows."""
    if not source.dataset:
        return intervals(source.solution, source.system)
    attrs = source.solution.attrs
    if "mode" not in source.solution or (source.system is None and "mode_names" not in attrs):
        return {}
    mode, time = np.asarray(source.solution["mode"]), source.time
    if source.system is not None:
        found = sticking(source.system, mode)
    else:
        names = list(attrs["mode_names"])
        numbers = list(attrs.get("mode_numbers", range(len(names))))
        stick = [number for number, name in zip(numbers, names, strict=True) if "stick" in name]
        found = {"": np.isin(mode, stick)}
    return {name: spans(time, row) for name, row in found.items()}


def rows_of(solution: Solution) -> Any:
    """Rows of the motion that a run kept: outputs, else steps, else None."""
    return solution.steps if solution.outputs is None else solution.outputs
