"""Logs and solutions as text and as tables for notebooks."""

from typing import Any

import numpy as np

from .._outcome import names_of, tally
from .._show import LISTED, amount, html_table, number, value_text
from .._validation import is_concrete
from .components import components_of
from .status import RESULTS, flags_text


def log_text(name: str, log: Any, one: str, more: str) -> str:
    """One line on a log: how many rows, from when to when, and what `more` says."""
    if not is_concrete(log):
        return f"{name}(traced, with room for {amount(log.t.shape[-1], one)})"
    count = np.asarray(log.count)
    if count.ndim:
        low, high = (int(count.min()), int(count.max())) if count.size else (0, 0)
        rows = f"{low:,} to {high:,}" if low != high else f"{low:,}"
        return f"{name}: {amount(count.size, 'run')} of {rows} {one}s"
    times = np.asarray(log.t)[: int(count)]
    span = f", t = {number(times[0])} to {number(times[-1])} s" if times.size else ""
    return f"{name}: {amount(times.size, one)}{span}{f': {more}' if more and times.size else ''}"


def mode_path(log: Any) -> str:
    """The numbers of the modes that one run went through."""
    if not is_concrete(log) or np.ndim(log.count):
        return ""
    count = int(log.count)
    modes = [*np.asarray(log.mode_before)[: min(count, 1)], *np.asarray(log.mode_after)[:count]]
    shown = " > ".join(str(int(m)) for m in modes[: LISTED + 1])
    return f"modes {shown}{' > ...' if len(modes) > LISTED + 1 else ''}"


def log_html(name: str, log: Any, codes: tuple[str, ...]) -> str:
    """The first rows of the log of one run, or one line."""
    if not is_concrete(log) or np.ndim(log.count):
        return html_table(repr(log), (), ())
    states = {}
    for field in ("y", "y_before", "y_after"):
        if hasattr(log, field):
            end = field.removeprefix("y")
            states |= {f"{k}{end}": v for k, v in components_of(getattr(log, field)).items()}
    columns = {"t": log.t, **{code: getattr(log, code) for code in codes}, **states}
    count = int(log.count)
    rows = [
        [value_text(np.asarray(column)[i]) for column in columns.values()]
        for i in range(min(count, LISTED))
    ]
    if count > LISTED:
        rows.append(["..."] * len(columns))
    return html_table(f"{name}: {amount(count, 'row')}", tuple(columns), rows)


def solution_html(solution: Any) -> str:
    """A table of what a run, or a batch of runs, came to."""
    if not is_concrete(solution):
        return html_table(str(solution), (), ())
    stats = solution.stats
    if solution.t1.shape != ():
        rows = [[f"{n:,}", name] for name, n in tally(names_of(solution.result)).items()]
        return html_table(str(solution).partition(";")[0], ("runs", "outcome"), rows)
    end = components_of(solution.y1)
    rows = [
        ["time", f"{number(solution.t0)} to {number(solution.t1)} s"],
        ["outcome", RESULTS[solution.result] or "successful"],
        ["events", f"{int(stats.num_events):,}"],
        ["steps", f"{int(stats.num_accepted):,} accepted of {int(stats.num_attempts):,}"],
        ["derivative flags", flags_text(solution)],
        ["state at the end", ", ".join(f"{k} = {value_text(v)}" for k, v in end.items())],
        ["kept", _kept(solution)],
    ]
    return html_table("Solution", (), rows)


def _kept(solution: Any) -> str:
    found = []
    for name in ("outputs", "steps", "events"):
        log = getattr(solution, name)
        if log is not None:
            found.append(f"{int(log.count):,} {name}")
    found += [f"{amount(int(log.count), 'crossing')}" for log in solution.crossings]
    return ", ".join(found) or "the end alone"
