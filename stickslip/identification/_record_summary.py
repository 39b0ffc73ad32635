"""A record at a glance: what an instrument has done to the numbers."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .._show import amount, columns_aligned, html_table, number
from ._noise_level import noise_level, quantum_of


class SeriesSummary(NamedTuple):
    """Of one series, in its `unit`: least and largest value, `noise` by `noise_level` (NaN where it
    cannot be told), `quantum` of an encoder if there is one, samples `missing`, and the part of the
    samples that is `saturated`: several in a row at the least or at the largest value."""

    unit: str
    low: float
    high: float
    noise: float
    quantum: float | None
    missing: int
    saturated: float


class RecordSummary(NamedTuple):
    """A record at a glance; `print` shows it.

    `name`, and number of `samples`; `rate` [Hz], of the median step; `duration` [s]; `gaps`: how many
    steps are longer than one and a half of it, the longest of them `longest` [s]; `jitter` [s]:
    standard deviation of the other steps; `series` by name.
    """

    name: str
    samples: int
    rate: float
    duration: float
    gaps: int
    longest: float
    jitter: float
    series: dict[str, SeriesSummary]

    def __repr__(self) -> str:
        head, rows = self._table()
        return "\n".join([self._stamps(), *columns_aligned([head, *rows])])

    def _repr_html_(self) -> str:
        head, rows = self._table()
        return html_table(self._stamps(), head, rows)

    def _stamps(self) -> str:
        gaps = (
            f"{amount(self.gaps, 'gap')}, the longest {number(self.longest)} s"
            if self.gaps
            else "no gaps"
        )
        name = f"{self.name}: " if self.name else ""
        return (
            f"{name}{amount(self.samples, 'sample')} in {number(self.duration)} s at "
            f"{number(self.rate)} Hz (jitter {number(self.jitter)} s), {gaps}"
        )

    def _table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        head = ("series", "unit", "range", "noise", "quantum", "missing", "saturated")
        rows = [
            (name, s.unit or "-", f"{number(s.low)} to {number(s.high)}", number(s.noise),
             "-" if s.quantum is None else number(s.quantum), f"{s.missing:,}", f"{s.saturated:.1%}")
            for name, s in self.series.items()
        ]  # fmt: skip
        return head, rows


def summary_of(
    name: str,
    times: np.ndarray,
    values: Mapping[str, np.ndarray],
    present: Mapping[str, np.ndarray],
    units: Mapping[str, str],
) -> RecordSummary:
    """The summary of a record's stamps and values."""
    steps = np.diff(times)
    step = float(np.median(steps))
    long = steps > 1.5 * step
    series = {
        name: _series(row[present[name]], units.get(name, ""), int(np.sum(~present[name])))
        for name, row in values.items()
    }
    jitter = float(np.std(steps[~long]))
    jitter = jitter if jitter > 1e-9 * float(np.abs(times).max()) else 0.0  # stamps are rounded
    return RecordSummary(
        name, times.size, 1.0 / step, float(times[-1] - times[0]), int(long.sum()), float(steps.max()),
        jitter, series,
    )  # fmt: skip


def _series(row: np.ndarray, unit: str, missing: int) -> SeriesSummary:
    if not row.size:
        return SeriesSummary(unit, np.nan, np.nan, np.nan, None, missing, 0.0)
    quantum = quantum_of(row)
    told = row.size >= 8 and np.ptp(row) > 0.0
    noise: Any = noise_level(row, quantum) if told else np.nan
    return SeriesSummary(
        unit, float(row.min()), float(row.max()), noise, quantum, missing, _saturation(row, quantum)
    )


def _saturation(row: np.ndarray, quantum: float | None) -> float:
    """Part of the samples in runs of five or more at an extreme value that are entered or left at
    speed, as where an amplifier clips, and not where a motion comes to rest or turns."""
    steps = np.abs(np.diff(row))
    if not steps.any():
        return 0.0
    fast = max(0.2 * np.median(steps[steps > 0.0]), 3.0 * (quantum or 0.0))
    lost = 0
    for end in (row.min(), row.max()):
        there = np.concatenate([[False], row == end, [False]])
        edges = np.flatnonzero(np.diff(there.astype(int)))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            # Not the steps into and out of the run, which the limit has cut short.
            beside = (*steps[max(a - 2, 0) : max(a - 1, 0)], *steps[b : b + 1])
            if b - a >= 5 and max(beside, default=0.0) > fast:
                lost += int(b - a)
    return lost / row.size
