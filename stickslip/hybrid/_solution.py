"""What a simulation returns."""

from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree, UInt

from .._types import Given
from .._validation import check_broadcast, check_type, is_concrete, refusal
from ._status import RESULTS, describe_flags

ResultT = TypeVar("ResultT", bound=eqx.Module)


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


class StateLog(eqx.Module):
    """States at output times, at crossings of a section, or at every step.

    Rows past `count` are NaN (mode -1). `dy` is the slope of the state there: an acceleration is
    `dy.v`. If the mode changes at that time, the row holds the state before the
    event.
    """

    count: Int[Array, "*batch"]
    t: Float[Array, "*batch rows"]
    y: PyTree
    dy: PyTree
    mode: Int[Array, "*batch rows"]


class Stats(eqx.Module):
    """Work done, per lane."""

    num_attempts: Int[Array, "*batch"]
    num_accepted: Int[Array, "*batch"]
    num_events: Int[Array, "*batch"]


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
      absolute tolerance above the motion, 32 an equilibrium with steps too long for derivatives.
      `differentiable` is `flags == 0`.
    - `sequence`: hash of the sequence of guards and modes. Where it differs between two parameter
      values the mode sequence changed between them, and so no derivative connects them.
    """

    t0: Float[Array, "*batch"]
    t1: Float[Array, "*batch"]
    y1: PyTree
    dy1: PyTree
    mode1: Int[Array, "*batch"]
    outputs: StateLog | None
    steps: StateLog | None
    events: EventLog | None
    crossings: tuple[StateLog, ...]
    result: Any
    flags: Int[Array, "*batch"]
    sequence: UInt[Array, "*batch"]
    stats: Stats

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
        if self.t1.shape != () or isinstance(self.t1, jax.core.Tracer):
            return f"Solution(batch of shape {self.t1.shape})"
        message = RESULTS[self.result] or "successful"
        return (
            f"Solution: t = {float(self.t0):g} to {float(self.t1):g} s, "
            f"{int(self.stats.num_events)} events, {int(self.stats.num_accepted)} steps accepted of "
            f"{int(self.stats.num_attempts)}; {message}; derivative flags: "
            f"{describe_flags(int(self.flags))}"
        )


def raise_failures(solution: ResultT, successful: Given[bool | np.ndarray | Array]) -> ResultT:
    """`solution`, or the error of its `result` where a lane of it was not `successful`.

    For whoever builds a `simulate` of their own on this one: to be called outside of its jit, with what
    was found inside. Under a transformation the error is raised when the program runs.

    Errors: `TypeError` for a `solution` that has no `result`, and for flags that are not booleans.
    """
    if not isinstance(solution, eqx.Module) or not hasattr(solution, "result"):
        raise refusal("solution", solution, "a module with a field `result` of RESULTS", TypeError)
    array = isinstance(successful, np.ndarray | jax.Array) and successful.dtype == np.bool_
    if not (array or isinstance(successful, bool)):
        raise refusal("successful", successful, "True or False, or an array of them", TypeError)
    result: Any = solution
    if is_concrete(successful) and np.asarray(successful).all():
        return solution
    return result.result.error_if(solution, ~jnp.asarray(successful))


def same_mode_sequence(one: Solution, other: Solution) -> Bool[Array, "*batch"]:
    """Whether two runs went through the same events in the same order (by hash and number).

    Errors: `TypeError` if one is not a `Solution`, `ValueError` for batches that do not go together.
    """
    check_type("one", one, Solution, "a Solution")
    check_type("other", other, Solution, "a Solution")
    check_broadcast("other.t1", other.t1, "one.t1", one.t1)
    return (one.sequence == other.sequence) & (one.num_events == other.num_events)


def masked(rows: PyTree, count: Any, size: int) -> PyTree:
    """`rows` with NaN (floats) or -1 (integers) past `count`."""
    valid = jnp.arange(size, dtype=jnp.int32) < count

    def mask(a):
        keep = valid.reshape((size,) + (1,) * (a.ndim - 1))
        return jnp.where(keep, a, np.nan if jnp.issubdtype(a.dtype, jnp.floating) else -1)

    return jax.tree.map(mask, rows)
