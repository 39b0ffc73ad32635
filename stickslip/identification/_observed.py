"""Data of a problem: what is observed, and the records, checked and made equally long."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

from .._argument_checks import callable_as, check_arguments, instance, known_number, or_none
from .._types import Given, Numeric
from .._validation import as_parameter, check_mapping, check_type, refusal
from ._noise_level import noise_level
from ._record import Record
from ._run import Data
from ._signal import pad_signal

Observe = Callable[[Any, Any, Any], Any]


class Observed(eqx.Module):
    """A function `(t, y, system) -> number` of time [s] and state that is measured with normal noise.

    **Arguments:** `function`; `sd`, the standard deviation of the noise, positive, or None: a `Problem`
    estimates it from its records (`noise_level`), and its `observed` tell it; `unit` of both;
    `quantum`: the smallest step of the encoder, below a twelfth of whose square no such estimate of a
    variance goes. **Raises** `TypeError`, `ValueError` for anything else.
    """

    function: Callable[..., Any] = eqx.field(static=True)
    sd: Float[Array, ""] | None
    unit: str = eqx.field(static=True)
    quantum: float | None = eqx.field(static=True)

    @check_arguments(
        function=callable_as("f(t, y, system)", 0.0, None, None),
        sd=or_none(known_number("positive")), unit=instance(str, "a text"),
        quantum=or_none(known_number("positive")),
    )  # fmt: skip
    def __init__(
        self,
        function: Given[Observe],
        sd: Numeric | None = None,
        unit: str = "",
        quantum: float | None = None,
    ):
        self.function, self.unit = function, unit
        self.sd = None if sd is None else as_parameter(sd)
        self.quantum = None if quantum is None else float(quantum)


def observed_of(observed: Any) -> dict[str, Observed]:
    found = check_mapping("observed", observed)
    if not found:
        raise refusal("observed", observed, "a mapping from names to Observed, not empty")
    for name, one in found.items():
        check_type(f"observed[{name!r}]", one, Observed, "an Observed")
    return found


def records_of(records: Any, observed: dict[str, Observed]) -> tuple[Record, ...]:
    row = (records,) if isinstance(records, Record) else records
    allowed = "a Record or a sequence of them, not empty"
    if not isinstance(row, tuple | list) or not row:
        raise refusal("records", records, allowed, TypeError)
    for i, record in enumerate(row):
        where = f"records[{i}]"
        check_type(where, record, Record, "a Record")
        for name in record.values:
            if name not in observed:
                allowed = f"of values named after one of observed, {', '.join(observed)}"
                raise refusal(where, record, allowed, but=f"with values of {name!r}")
            unit, expected = record.units.get(name), observed[name].unit
            if unit is not None and unit != expected:
                allowed = (
                    f"in {expected!r}, the unit of observed[{name!r}]; "
                    "Record.from_table(..., from_units=...) converts"
                )
                raise refusal(f"{where}.units[{name!r}]", unit, allowed)
        for kind in ("inputs", "known"):
            names, first = set(getattr(record, kind)), set(getattr(row[0], kind))
            if names != first:
                raise refusal(where, record, f"with the {kind} of records[0], {sorted(first)}",
                    but=f"with {sorted(names)}")  # fmt: skip
    return tuple(row)


def with_noise_of(observed: dict[str, Observed], records: tuple[Record, ...]) -> dict[str, Observed]:
    """The same with the noise of every quantity: where it is not stated, that of the records, weighed
    by their samples."""
    found = {}
    for name, one in observed.items():
        if one.sd is None:
            rows = [r.values[name][r.present[name]] for r in records if name in r.values]
            try:
                levels = [noise_level(row, one.quantum) for row in rows]
            except ValueError as error:
                allowed = "stated (sd=...), or a quantity whose records show it"
                raise refusal(f"observed[{name!r}].sd", None, allowed, but=f"but {error}") from None
            if not levels or not max(levels) > 0.0:
                allowed = "stated (sd=...): no record shows any noise"
                raise refusal(f"observed[{name!r}].sd", None, allowed)
            square = np.average(np.square(levels), weights=[row.size for row in rows])
            one = Observed(one.function, float(np.sqrt(square)), one.unit, one.quantum)
        found[name] = one
    return found


def data_of(records: tuple[Record, ...], observed: dict[str, Observed]) -> Data:
    """Records of one length: the last time is repeated, which costs an attempt each."""
    longest = max(record.times.size for record in records)
    shape = (len(records), len(observed), longest)
    values, present = np.zeros(shape), np.zeros(shape, bool)
    for r, record in enumerate(records):
        for i, name in enumerate(observed):
            if name in record.values:
                n = record.times.size
                values[r, i, :n], present[r, i, :n] = record.values[name], record.present[name]
    inputs = {}
    for name in records[0].inputs:
        signals = [record.inputs[name] for record in records]
        most = [max(getattr(s, a).size for s in signals) for a in ("times", "breaks")]
        inputs[name] = _stack([pad_signal(s, *most) for s in signals])
    times = [np.pad(r.times, (0, longest - r.times.size), mode="edge") for r in records]
    return Data(
        times=np.stack(times),
        begin=np.stack([r.begin for r in records]),
        values=values,
        present=present,
        keep=np.flatnonzero(present),
        deviations=np.array([float(o.sd) for o in observed.values() if o.sd is not None]),
        inputs=inputs,
        known=_stack([r.known for r in records]),
    )  # fmt: skip


def _stack(trees: list[Any]) -> Any:
    return jax.tree.map(lambda *rows: np.stack(rows), *trees)
