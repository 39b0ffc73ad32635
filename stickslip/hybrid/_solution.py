"""Results of a simulation."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree, UInt

from .._outcome import names_of, tally
from .._show import amount, module_text
from .._types import Given, MaybeNone
from .._validation import check_broadcast, check_type, is_concrete, refusal
from ._labelled import events_dataframe, solution_dataset, states_dataframe
from ._shown import log_html, log_text, mode_path, solution_html
from .components import components_of
from .status import RESULTS, flags_text
from .system import AbstractHybridSystem

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


class EventLog(eqx.Module):
    """Transitions in order of time; rows past `count` are NaN, guards and modes there -1.

    Leading axes are those of the batch, then the row. `guard` numbers the system's `guard_names`,
    the modes its `mode_names`; `y_before` and `y_after` are the states on the two sides of the event.
    """

    count: Int[Array, "*batch"]
    t: Float[Array, "*batch rows"]
    guard: Int[Array, "*batch rows"]
    mode_before: Int[Array, "*batch rows"]
    mode_after: Int[Array, "*batch rows"]
    y_before: PyTree
    y_after: PyTree

    def __repr__(self) -> str:
        return log_text("EventLog", self, "event", mode_path(self))

    def _repr_html_(self) -> str:
        return log_html("EventLog", self, ("guard", "mode_before", "mode_after"))

    def to_dataframe(self, system: Given[AbstractHybridSystem]) -> "pd.DataFrame":
        """The events as a table of pandas: a row an event, guards and modes by name.

        Columns: `t` [s], `guard`, `mode_before`, `mode_after`, and for each component of the state
        `<name>_before` and `<name>_after`, of an array `<name>[0]_before` and so on, a column for each
        number; units by column in `attrs["units"]`. Of a batch the index is the number of the run along
        each batch axis, and the event. Rows past `count` are left out.

        **Raises** `TypeError` if `system` is not one and for a log that is traced; `ValueError` for a
        log with guards or modes that the system has not, or another state.
        """
        return events_dataframe(self, system)


class StateLog(eqx.Module):
    """States at output times, at crossings of a section, or at every step.

    Rows past `count` are NaN (mode -1). `dy` is the slope of the state there: an acceleration is
    `dy.v`. If the mode changes at that time, the row holds the state before the event.
    """

    count: Int[Array, "*batch"]
    t: Float[Array, "*batch rows"]
    y: PyTree
    dy: PyTree
    mode: Int[Array, "*batch rows"]

    def __repr__(self) -> str:
        return log_text("StateLog", self, "row", ", ".join(components_of(self.y)))

    def _repr_html_(self) -> str:
        return log_html("StateLog", self, ("mode",))


class Stats(eqx.Module):
    """Work done, per lane."""

    num_attempts: Int[Array, "*batch"]
    num_accepted: Int[Array, "*batch"]
    num_events: Int[Array, "*batch"]

    def __repr__(self) -> str:
        return module_text(self)


class Solution(eqx.Module):
    """Result of `simulate`; under `vmap` every array has the batch axes in front.

    - `t1`, `y1`, `dy1`, `mode1`: time, state, slope and mode at the end (earlier than asked for if
      the lane ended early).
    - `outputs`: states at `SaveAt(ts=...)`; `steps`: at every accepted step and on both sides of
      every event; `events`: the log of transitions; `crossings`: one log per section. `None` where
      not asked for.
    - `result`: a `RESULTS` item per lane.
    - `flags`: bits that say why a derivative does not exist or is not to be trusted, 0 if none: 1
      grazing, 2 coincident events, 4 a guard violated when a mode began, 8 a jump inside a step, 16 an
      absolute tolerance above the motion, 32 an equilibrium with steps too long for derivatives,
      64 a field that bends in a long loop or in too many places.
      `differentiable` is `flags == 0`.
    - `flagged_at`: when the first flagged step ends [s], NaN if none is: 16, 32 and 64 are flags of a
      whole run. `flagged_guard`: the guard there, a number of `guard_names`; -1 if it was none, or if
      something jumped. Of two guards at one instant it is that which fired.
    - `sequence`: hash of the sequence of guards and modes. Where it differs between two parameter
      values the mode sequence changed between them, and so no derivative connects them.
    """

    t0: Float[Array, "*batch"]
    t1: Float[Array, "*batch"]
    y1: PyTree
    dy1: PyTree
    mode1: Int[Array, "*batch"]
    outputs: StateLog | MaybeNone
    steps: StateLog | MaybeNone
    events: EventLog | MaybeNone
    crossings: tuple[StateLog, ...]
    result: Any
    flags: Int[Array, "*batch"]
    flagged_at: Float[Array, "*batch"]
    flagged_guard: Int[Array, "*batch"]
    sequence: UInt[Array, "*batch"]
    stats: Stats
    guard_names: tuple[str, ...] = eqx.field(static=True)

    @property
    def num_events(self) -> Int[Array, "*batch"]:
        """Number of transitions that happened, whether logged or not."""
        return self.stats.num_events

    @property
    def differentiable(self) -> Bool[Array, "*batch"]:
        """Whether derivatives of this lane exist as far as the run shows."""
        return self.flags == 0

    @property
    def successful(self) -> Bool[Array, "*batch"]:
        """Whether the lane reached its end or a terminal section."""
        return (self.result == RESULTS.successful) | (self.result == RESULTS.event_occurred)

    def __str__(self) -> str:
        """One line; of a batch, how many runs ended how."""
        if not is_concrete(self):
            return f"Solution(traced, of shape {self.t1.shape})"
        if self.t1.shape != ():
            return _batch_text(self)
        message = RESULTS[self.result] or "successful"
        return (
            f"Solution: t = {float(self.t0):g} to {float(self.t1):g} s, "
            f"{int(self.stats.num_events)} events, {int(self.stats.num_accepted)} steps accepted of "
            f"{int(self.stats.num_attempts)}; {message}; derivative flags: "
            f"{flags_text(self)}"
        )

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return solution_html(self)

    def to_dataset(
        self,
        system: Given[AbstractHybridSystem],
        *,
        batch: Given[str | Sequence[str] | Mapping[str, Any] | None] = None,
    ) -> "xr.Dataset":
        """All that was kept of the run, or of a batch of runs, as an `xarray.Dataset` with units.

        **Arguments**

        - `system`: that of the run, for its units, periods and names of modes.
        - `batch`: names of the batch axes, `"run"` or `"run_0"`, `"run_1"`, ... by default; or a
          mapping from names to their coordinates, as `{"belt_speed": speeds}`, which have the units of
          the parameter of that name.

        **Returns** a Dataset. Batch axes come first.

        - of the outputs (of the steps, where there are none) along `time`: each component of the state
          by its name, its slope as `slope_of_<name>`, `mode`. The times of a batch that differ from run
          to run are a variable `t`, along `row`.
        - of the events along `event`: `event_t`, `event_guard`, `event_mode_before`,
          `event_mode_after`, `before_<name>` and `after_<name>`.
        - of each section, by its number, along `crossing_<k>`: `crossing_<k>_t`, `crossing_<k>_<name>`.
        - of the end: `end_t`, `end_<name>`, `end_mode`, `num_events`, `flags`, `result`, whose numbers
          have names in `flag_values` and `flag_meanings`. `mode_names` and `guard_names` are
          attributes; of more than 1024 modes only those that occur, numbered in `mode_numbers`.

        Components that are arrays have axes of their own, `<name>_0`, `<name>_1`, ..., as those of
        `time_history` and `orbit_diagram`.

        **Raises** `TypeError` if `system` is not one and for a run that is traced, `ValueError` for a
        state that is not of the system, or names that do not go with the batch axes.
        """
        return solution_dataset(self, system, batch)

    def to_dataframe(self, system: Given[AbstractHybridSystem]) -> "pd.DataFrame":
        """The motion as a table of pandas: a row a time of the outputs, or a step where there are none.

        Columns: `t` [s], `mode` by name, and each component of the state by its name, of an array
        `<name>[0]` and so on; units by column in `attrs["units"]`. Of a batch the index is the number
        of the run along each batch axis, and the row. The events: `solution.events.to_dataframe`.

        **Raises** `TypeError` if `system` is not one and for a run that is traced; `ValueError` for a
        run that kept no states, or that of another system.
        """
        log = self.steps if self.outputs is None else self.outputs
        if log is None:
            kept = "a run that kept states, as with saveat=SaveAt(ts=...) or SaveAt(steps=True)"
            raise refusal("outputs", None, kept)
        return states_dataframe(log, system)


def _batch_text(solution: Any) -> str:
    """How many runs ended how, how many events they had, and how many have no derivative."""
    outcomes = names_of(solution.result)
    runs, events = np.size(outcomes), np.asarray(solution.stats.num_events)
    if not runs:
        return f"Solution: 0 runs, of shape {solution.t1.shape}"
    ends = ", ".join(f"{n:,} {name}" for name, n in tally(outcomes).items())
    low, high = int(events.min()), int(events.max())
    many = f"{low:,}" if low == high else f"{low:,} to {high:,}"
    flagged = int(np.sum(np.asarray(solution.flags) != 0))
    start, end = np.min(np.asarray(solution.t0)), np.max(np.asarray(solution.t1))
    shape = f" of shape {solution.t1.shape}" if solution.t1.ndim > 1 else ""
    return (
        f"Solution: {amount(runs, 'run')}{shape}, {ends}; t = {start:g} to {end:g} s, {many} events; "
        f"derivative flags: {f'{flagged:,} of the runs' if flagged else 'none'}"
    )


def same_mode_sequence(one: Solution, other: Solution) -> Bool[Array, "*batch"]:
    """Whether two runs went through the same events in the same order (by hash and number).

    Errors: `TypeError` if one is not a `Solution`, `ValueError` for batches that do not go together.
    """
    check_type("one", one, Solution, "a Solution")
    check_type("other", other, Solution, "a Solution")
    check_broadcast("other.t1", other.t1, "one.t1", one.t1)
    return (one.sequence == other.sequence) & (one.num_events == other.num_events)


def mask_rows(rows: PyTree, count: Any, size: int) -> PyTree:
    """`rows` with NaN (floats) or -1 (integers) past `count`."""
    valid = jnp.arange(size, dtype=jnp.int32) < count

    def mask(a):
        keep = valid.reshape((size,) + (1,) * (a.ndim - 1))
        return jnp.where(keep, a, np.nan if jnp.issubdtype(a.dtype, jnp.floating) else -1)

    return jax.tree.map(mask, rows)
