"""The program of a problem: from values of the unknowns to what would have been observed."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._validation import as_float64
from ..hybrid import Integrator, SaveAt, WithBreaks, jit_plainly, simulate
from ._signal import Signal, breaks_of
from ._unknowns import NamedValues

SystemOf = Callable[[NamedValues, dict[str, Signal]], Any]


class Data(eqx.Module):
    """All records, one row each, made equally long by repeating their last time.

    `present`: which values were measured; `keep`: their places among all, flattened.
    """

    times: Float[Array | np.ndarray, "record time"]
    begin: Float[Array | np.ndarray, " record"]
    values: Float[Array | np.ndarray, "record observed time"]
    present: Bool[Array | np.ndarray, "record observed time"]
    keep: Int[Array | np.ndarray, " row"]
    deviations: Float[Array | np.ndarray, " observed"]
    inputs: dict[str, Signal]
    known: dict[str, Any]

    @property
    def lengths(self) -> tuple[int, ...]:
        """How many stamps each record has: they increase until the last, which is repeated."""
        return tuple((1 + np.sum(np.diff(np.asarray(self.times)) > 0.0, axis=1)).tolist())

    def begin_of(self, record: Any) -> Array:
        """Time of the initial state of a record."""
        return jnp.asarray(self.begin)[record]


def call_with_values(
    name: str, function: SystemOf, values: NamedValues, inputs: dict[str, Signal]
) -> Any:
    """Result of a function of a problem; what it asks for and nobody declared is named."""
    try:
        return function(values, inputs)
    except KeyError as error:
        missing = error.args[0] if error.args else None
        if not isinstance(missing, str) or missing in values or missing in inputs:
            raise
        told = "; ".join(
            f"{kind} {', '.join(map(repr, sorted(those))) or 'none'}"
            for kind, those in (("unknowns and known numbers are", values), ("inputs are", inputs))
        )
        raise KeyError(f"{name}(values, inputs) asks for {missing!r}: {told}") from error


@dataclasses.dataclass(frozen=True)
class Run:
    """The functions of a problem and its settings: what its compiled program depends on."""

    system: SystemOf
    initial_state: SystemOf
    observed: tuple[tuple[str, Callable[..., Any]], ...]
    integrator: Integrator | None
    delay: str | None
    shared: tuple[str, ...]
    local: tuple[tuple[str, tuple[str, ...]], ...]  # names with the names per record
    correct: Any = None  # an AbstractCorrection

    @property
    def kinds(self) -> int:
        """How many rows there are for each datum; the first is its residual."""
        return 1 if self.correct is None else self.correct.kinds

    def split(self, values: NamedValues) -> tuple[NamedValues, NamedValues]:
        """Values of all records, and rows of values of each."""
        common = {name: values[name] for name in self.shared}
        return common, {
            name: jnp.stack([jnp.asarray(values[part]) for part in parts]) for name, parts in self.local
        }

    def of_record(self, values: NamedValues, data: Data, record: Any) -> tuple[NamedValues, Any]:
        """Values of one record by name, those known of it too, and its inputs."""
        common, local = self.split(values)
        mine, known, inputs = jax.tree.map(
            lambda a: jnp.asarray(a)[record], (local, data.known, data.inputs)
        )
        return {**known, **common, **mine}, inputs

    def start(self, values: NamedValues, inputs: dict[str, Signal]) -> Any:
        """The state in which a record begins."""
        y0 = call_with_values("initial_state", self.initial_state, values, inputs)
        return as_float64("y0", y0)

    def system_of(self, values: NamedValues, inputs: dict[str, Signal]) -> tuple[Any, Array | None]:
        """The system, and the breaks of its inputs, if it has any."""
        system = call_with_values("system", self.system, values, inputs)
        return system, breaks_of(system)

    def motion(
        self, system: Any, breaks: Array | None, y0: Any, begin: Any, ts: Array, log: bool = False
    ) -> tuple[Any, Any]:
        """States of the system at the times `ts`, from `y0` at `begin`, and the `Solution`."""
        whole = system if breaks is None else WithBreaks(system, breaks)
        solution = simulate(
            whole, begin, ts[-1], y0 if breaks is None else whole.start(y0, begin),
            integrator=self.integrator,
            saveat=SaveAt(ts=ts, events=log, max_events=4096 if log else None), throw=False,
        )  # fmt: skip
        assert solution.outputs is not None
        return solution.outputs.y if breaks is None else solution.outputs.y.y, solution

    def observe(self, system: Any, times: Array, states: Any) -> Float[Array, "observed time"]:
        """Observations of the states at `times`."""
        rows = [
            jax.vmap(lambda t, y, f=f: jnp.asarray(f(t, y, system), jnp.float64))(times, states)
            for _, f in self.observed
        ]
        return jnp.stack(rows)

    def times_of(self, values: NamedValues, times: Array, begin: Any) -> Array:
        """Times of the motion at the stamps, which are late by the delay."""
        return times if self.delay is None else jnp.maximum(times - values[self.delay], begin)

    def one(self, values: NamedValues, one: tuple, log: bool) -> tuple[Array, Any]:
        """Observations of one record; with its `Solution` if `log`."""
        times, begin, inputs = one
        system, breaks = self.system_of(values, inputs)
        ts = self.times_of(values, times, begin)
        states, solution = self.motion(system, breaks, self.start(values, inputs), begin, ts, log)
        return self.observe(system, ts, states), solution

    def rows(self, values: NamedValues, data: Data) -> Float[Array, "kind record observed time"]:
        """Residuals of all records, one after the other by one program: those of the data, in standard
        deviations, and behind them what else a correction brings."""
        common, local = self.split(values)

        def one(row):
            mine, known, one, measured, present = row
            values = {**known, **common, **mine}
            if self.correct is not None:
                return self.correct.rows(self, values, one, measured, present, data.deviations)
            off = self.one(values, one, log=False)[0] - measured
            return (off / data.deviations[:, None])[None]

        ones = (data.times, data.begin, data.inputs)
        rows = (local, data.known, ones, data.values, data.present)
        if data.times.shape[0] == 1:
            return one(jax.tree.map(lambda a: jnp.asarray(a)[0], rows))[:, None]
        return jnp.moveaxis(jax.lax.map(one, rows), 1, 0)

    def __call__(self, values: NamedValues, data: Data) -> Float[Array, " row"]:
        """Residuals of what was measured, by record, observed, time; then what else there is alike."""
        rows = self.rows(values, data)
        return rows.reshape(rows.shape[0], -1)[:, data.keep].reshape(-1)


@jit_plainly
def residual_of(run: Run, values: NamedValues, data: Data) -> Float[Array, " row"]:
    """`run(values, data)`, compiled."""
    return run(values, data)


@jit_plainly
def motion_of(run: Run, values: NamedValues, data: Data, record: Int[Array, ""]) -> tuple[Array, Any]:
    """Observations of one record, with its `Solution`."""
    values, inputs = run.of_record(values, data, record)
    one = jnp.asarray(data.times)[record], data.begin_of(record), inputs
    return run.one(values, one, log=True)
