"""Measurements of one run."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

import equinox as eqx
import numpy as np

from .._argument_checks import check_arguments, choice, instance
from .._show import amount, number
from .._types import Given, Named, NamedRows, Numeric, Row
from .._validation import (
    check_finite,
    check_increasing,
    check_mapping,
    check_that,
    check_type,
    is_concrete,
    numbers,
    one_concrete,
    one_row,
    refusal,
    shape_refusal,
)
from ._record_summary import RecordSummary, summary_of
from ._si import is_unit, to_si
from ._signal import KINDS, Signal

EVERY: dict[str, np.ndarray] = {}  # in place of masks: every NaN is missing


class Record(eqx.Module):
    """A record: time stamps, values measured there, inputs, and what else is known of this run.

    >>> record = Record([0.0, 0.1, 0.3], {"position": [0.0, 0.2, float("nan")]}, missing="nan")
    >>> record.present["position"].tolist()
    [True, True, False]

    **Arguments**

    - `times` [s]: increasing, in any steps, at least two.
    - `values`: by name one row of measurements, as many as `times`, in the unit of what is observed.
    - `inputs`: by name a `Signal`, or a row sampled at `times`, interpolated as `interpolation` says:
      `"hold"`, `"linear"` or `"cubic"`.
    - `missing`: `None` if no value is missing; `"nan"` if every NaN marks one that is; or by name a row
      that is true where a value is missing. NaN anywhere else raises an error.
    - `known`: numbers by name that are known of this record, such as its load; a `Problem` hands them
      to its functions beside the unknowns.
    - `begin` [s]: the time of the initial state, not after the first stamp; by default that stamp.
    - `units`: of values and inputs by name; a `Problem` compares them with the units it was given.
    - `name`: of the record, in reports.

    **Raises** `ValueError`, `TypeError` for rows that are not as long as `times`, times that do not
    increase, NaN where none is marked, an input that ends before the record.
    """

    times: np.ndarray
    values: dict[str, np.ndarray]
    present: dict[str, np.ndarray]
    inputs: dict[str, Signal]
    known: dict[str, Any]
    begin: np.ndarray
    units: dict[str, str] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    @check_arguments(interpolation=choice(KINDS), name=instance(str, "a text"))
    def __init__(
        self,
        times: Row,
        values: NamedRows,
        *,
        inputs: Named | None = None,
        missing: Given[str | Mapping[str, Any] | None] = None,
        known: Named | None = None,
        begin: Numeric | None = None,
        interpolation: str = "hold",
        units: Given[Mapping[str, str] | None] = None,
        name: str = "",
    ):
        if not is_concrete((times, values, inputs)):
            raise refusal("times", times, "known: make a Record outside of jit and vmap", TypeError)
        check_finite("times", times)
        check_increasing("times", one_row("times", times, least=2))
        self.times = np.asarray(times, np.float64)
        self.name = name
        values = check_mapping("values", values)
        if not values:
            raise refusal("values", values, "a mapping from names to rows, not empty")
        lost = _missing(missing, tuple(values), self.times.size)
        self.values, self.present = {}, {}
        for key, row in values.items():
            array = _row(f"values[{key!r}]", row, self.times.size)
            away = lost.get(key, np.isnan(array) & (lost is EVERY))
            bad = np.flatnonzero(~np.isfinite(array) & ~away)
            if bad.size:
                at = int(bad[0])
                allowed = f"finite (row {at}, time {self.times[at].item()} s), or said to be `missing`"
                raise refusal(f"values[{key!r}][{at}]", array[at].item(), allowed)
            self.values[key], self.present[key] = np.where(away, 0.0, array), ~away
        self.inputs = {
            key: self._input(f"inputs[{key!r}]", given, interpolation)
            for key, given in check_mapping("inputs", inputs).items()
        }
        self.known = {
            key: np.asarray(check_finite(f"known[{key!r}]", value), np.float64)
            for key, value in check_mapping("known", known).items()
        }
        self.begin = _begin(begin, self.times)
        self.units = _units(units, {*self.values, *self.inputs})

    def __repr__(self) -> str:
        if not is_concrete(self):
            return f"Record(traced, of {', '.join(self.values)})"
        name = f" {self.name!r}" if self.name else ""
        rows = [f"{amount(self.times.size, 'sample')}, t = {number(self.times[0])} to "
                f"{number(self.times[-1])} s"]  # fmt: skip
        for key, there in self.present.items():
            unit, lost = self.units.get(key), int(np.sum(~there))
            rows.append(f"{key}{f' [{unit}]' if unit else ''}{f', {lost:,} missing' if lost else ''}")
        inputs = [f"inputs {', '.join(self.inputs)}"] if self.inputs else []
        return f"Record{name}: {'; '.join([*rows, *inputs])}"

    @classmethod
    def from_table(
        cls,
        table: Given[Any],
        *,
        time: str = "time",
        values: Given[Iterable[str] | Mapping[str, str]],
        inputs: Given[Iterable[str] | Mapping[str, str]] = (),
        from_units: Given[Mapping[str, str] | None] = None,
        **options: Any,
    ) -> "Record":
        """From the columns of a `read_table`, a pandas frame, or the variables of an xarray dataset.

        >>> table = {"t": [0.0, 100.0, 200.0], "angle": [0.0, 9.0, 18.0]}
        >>> record = Record.from_table(
        ...     table, time="t", values={"phi": "angle"}, from_units={"time": "ms", "phi": "deg"}
        ... )
        >>> record.units, float(record.times[-1])
        ({'phi': 'rad'}, 0.2)

        **Arguments:** `table`; `time` [s], the column of the stamps; `values` and `inputs`: columns, or
        a mapping from names of the `Problem` to columns; `from_units`: by these names, and `time`, the
        unit of a column that is to be converted to SI, as `"ms"`, `"deg"`, `"mm/s"`, `"rpm"`; `options`
        as for `Record`. Units that the columns carry (`attrs["units"]`, or as in the name `Weg [mm]`)
        are taken as they are where none is stated; a `Problem` raises `ValueError` for others than its
        own. **Raises** as `Record`, `ValueError` for an unknown column or unit.
        """
        values, inputs = _columns("values", values), _columns("inputs", inputs)
        units = dict(check_mapping("units", options.pop("units", None)))
        columns = {"time": time, **values, **inputs}
        stored = check_mapping("from_units", from_units)
        for name, unit in stored.items():
            if name not in columns:
                allowed = f"named after one of {', '.join(columns)}"
                raise refusal(f"from_units[{name!r}]", unit, allowed)
        rows = {}
        for role, names in (("time", {"time": time}), ("values", values), ("inputs", inputs)):
            rows[role] = {}
            for name, column in names.items():
                row, unit = _column(table, role, column)
                if name in stored:
                    row, unit = to_si(f"from_units[{name!r}]", row, stored[name])
                elif role == "time" and unit not in ("", "s"):
                    allowed = f"in s; from_units={{'time': {unit!r}}} converts it"
                    raise refusal("time", column, allowed, but=f"in {unit!r}")
                if unit and role != "time":
                    units.setdefault(name, unit)
                rows[role][name] = row
        return cls(
            rows["time"]["time"], rows["values"], inputs=rows["inputs"], units=units or None, **options
        )

    def summary(self) -> RecordSummary:
        """Rate and gaps of the stamps, range, noise, quantum and saturation."""
        return summary_of(self.name, self.times, self.values, self.present, self.units)

    def _input(self, name: str, given: Any, kind: str) -> Signal:
        if isinstance(given, Signal):
            signal = given
        else:
            array = _row(name, given, self.times.size)
            bad = np.flatnonzero(~np.isfinite(array))
            if bad.size:
                at = int(bad[0])
                allowed = f"finite (row {at}, time {self.times[at].item()} s): inputs have no gaps"
                raise refusal(f"{name}[{at}]", array[at].item(), allowed)
            signal = Signal(self.times, array, kind)
        slack = 1e-9 * (self.times[-1] - self.times[0])
        if signal.end < self.times[-1] - slack:
            allowed = f"as long as the record, which ends at {self.times[-1].item()} s"
            raise refusal(name, given, allowed, but=f"which ends at {signal.end.item()} s")
        return signal


def _row(name: str, row: Any, count: int) -> np.ndarray:
    array = numbers(name, row)
    if array.shape != (count,):
        raise shape_refusal(name, row, f"one row of {count}, as many as times")
    return np.asarray(array, np.float64)


def _missing(missing: Any, names: tuple[str, ...], count: int) -> dict[str, np.ndarray]:
    if isinstance(missing, str) and missing == "nan":
        return EVERY
    if missing is None:
        return {}
    found = {}
    allowed = "None, 'nan', or a mapping from names of values to rows of booleans"
    if not isinstance(missing, Mapping):
        raise refusal("missing", missing, allowed, TypeError)
    for key, mask in check_mapping("missing", missing, allowed).items():
        if key not in names:
            raise refusal(f"missing[{key!r}]", mask, f"named after one of values, {', '.join(names)}")
        mask = np.asarray(mask)
        if mask.dtype != np.bool_ or mask.shape != (count,):
            raise refusal(f"missing[{key!r}]", mask, f"one row of {count} booleans")
        found[key] = mask
    return found


def _begin(begin: Any, times: np.ndarray) -> np.ndarray:
    if begin is None:
        return np.asarray(times[0])
    one_concrete("begin", begin)
    check_that("begin", begin, lambda t: t <= times[0], f"at most times[0] = {times[0].item()}")
    return np.asarray(begin, np.float64)


def _units(units: Any, names: set[str]) -> dict[str, str]:
    units = check_mapping("units", units)
    for key, unit in units.items():
        if key not in names:
            raise refusal(f"units[{key!r}]", unit, f"named after one of {', '.join(sorted(names))}")
        check_type(f"units[{key!r}]", unit, str, "a text")
    return units


def _columns(name: str, given: Any) -> dict[str, str]:
    if isinstance(given, Mapping):
        return check_mapping(name, given)
    if isinstance(given, str) or not isinstance(given, tuple | list):
        raise refusal(name, given, "a tuple of columns, or a mapping from names to columns", TypeError)
    for column in given:
        check_type(name, column, str, "a tuple of names of columns")
    return dict(zip(given, given, strict=True))


def _column(table: Any, role: str, column: Any) -> tuple[np.ndarray, str]:
    check_type(role, column, str, "the name of a column")
    if isinstance(table, type):
        raise refusal("table", table, "a table: a frame, a dataset or a mapping", TypeError)
    try:
        found = table[column]
    except Exception:
        raise refusal(role, column, "a column of the table") from None
    attributes = getattr(found, "attrs", None) or {}
    named = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", column)
    unit = attributes.get("units") or (named[1].strip() if named and is_unit(named[1]) else "")
    return np.asarray(found), str(unit)
