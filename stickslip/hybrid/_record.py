"""Recording: each attempt of a block leaves a row, from which what happened is moved into logs.

The inner loop of a block cannot scatter (not available inside a fused loop), and a scatter per
attempt would cost more than the attempt. So each attempt writes one row of running counts and
states; after the block the rows that matter are found by their counts.
"""

from typing import Any, NamedTuple

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._loop import run, run_block, running
from ._loop_state import REFRESH, Lane, Outcome, Plan, is_accepted
from .accuracy import ACCURACY
from .tree import select


class Capacities(eqx.Module):
    """Rows that are recorded and the room for them; static."""

    events: int | None = eqx.field(static=True)  # capacity, or None
    crossings: tuple[int, ...] = eqx.field(static=True)  # capacity per section
    outputs: int = eqx.field(static=True)  # number of output times
    steps: int | None = eqx.field(static=True)  # capacity, or None

    @property
    def nothing(self) -> bool:
        return self.events is None and not self.crossings and not self.outputs and self.steps is None


class States(NamedTuple):
    """Rows of times and states; leading axis: row."""

    t: Any
    y: PyTree
    mode: Any
    jump: Any  # whether the row was reached by a jump at an event, not by motion


class Starts(NamedTuple):
    """Rows of accepted steps in which a section is crossed: where they start; leading axis: row."""

    t: Any
    y: PyTree
    mode: Any
    h: Any  # length of the step; not differentiated


class Crossed(NamedTuple):
    """Rows of crossings of a section: what is found from their `Starts`; leading axis: row."""

    t: Any
    y: PyTree
    dy: PyTree
    mode: Any


class Events(NamedTuple):
    """Rows of events; leading axis: row."""

    t: Any
    guard: Any
    mode_before: Any
    mode_after: Any
    y_before: PyTree
    y_after: PyTree


class Logs(NamedTuple):
    """All logs of one lane; rows past the count are zero."""

    events: Events | None
    crossings: tuple  # of each section its `Starts`, from which its `Crossed` are found
    outputs: States | None
    steps: States | None


class LogRow(NamedTuple):
    """The row of one attempt; None where the run has no use for it, because writing rows costs time."""

    code: Any
    guard: Any
    t: Any
    y: PyTree
    y_before: PyTree  # None without guards: it is then `y`
    mode: Any
    mode_before: Any
    events: Any
    crossings: tuple
    next_output: Any


def record(
    plan: Plan, capacities: Capacities, problem, lane: Lane, t1, outputs
) -> tuple[Lane, Logs, Any]:
    """Run to the end; the lane at the end, its logs, and the number of recorded steps."""
    none = jnp.zeros_like(lane.mode)
    # Without logs there are no blocks either: the loop ends with the attempt that ends the last lane.
    if capacities.nothing and plan.progress is None:
        return run(plan, problem, lane, t1, outputs), Logs(None, (), None, None), none
    logs = no_rows(capacities, lane)

    guards = plan.functions.num_guards > 0
    # Bends of a force, and known instants, are guards that are not logged.
    logged = capacities.events is not None and plan.functions.num_guards > plan.functions.num_silent
    rowwise = capacities.steps is not None
    starts = bool(capacities.crossings)  # then the rows say where the next attempt starts
    ends = guards and (logged or rowwise or capacities.outputs > 0)

    def row_of(before: Lane, after: Lane, outcome: Outcome) -> LogRow:
        return LogRow(
            code=outcome.code if guards or rowwise else None,
            guard=outcome.guard if logged else None,
            t=after.t,
            y=after.y if logged or starts or not guards else None,
            y_before=outcome.y_before if ends else None,
            mode=after.mode if guards and (logged or starts) else None,
            mode_before=before.mode if ends else None,
            events=after.events if logged else None,
            crossings=after.crossings,
            next_output=after.next_output if capacities.outputs else None,
        )

    def body(carry):
        before, logs, steps = carry
        after, rows = run_block(plan, problem, before, t1, outputs, ACCURACY.rows_at_once, row_of)
        logs, steps = _collect(capacities, logs, steps, before, after, rows)
        if plan.progress is not None:
            plan.progress.report(lane.t, after.t, t1, after.status)
        return after, logs, steps

    return jax.lax.while_loop(lambda c: running(c[0]), body, (lane, logs, none))


def no_rows(capacities: Capacities, lane: Lane) -> Logs:
    """Logs with room for all rows, before the first of them."""

    def rows(capacity, tree):
        return jax.tree.map(lambda a: jnp.zeros((capacity, *jnp.shape(a)), jnp.asarray(a).dtype), tree)

    state = States(lane.t, lane.y, lane.mode, lane.mode)
    begun = Starts(lane.t, lane.y, lane.mode, lane.t)
    event = Events(lane.t, lane.mode, lane.mode, lane.mode, lane.y, lane.y)
    return Logs(
        events=None if capacities.events is None else rows(capacities.events, event),
        crossings=tuple(rows(capacity, begun) for capacity in capacities.crossings),
        outputs=rows(capacities.outputs, state) if capacities.outputs else None,
        steps=None if capacities.steps is None else rows(capacities.steps, state),
    )


def _collect(capacities: Capacities, logs: Logs, steps, before: Lane, after: Lane, rows: LogRow):
    def at(index) -> LogRow:
        return jax.tree.map(lambda a: a[index], rows)

    def start(index) -> Starts:
        # A row says where its attempt ended, which is where the next one started; the first of a block
        # started where the block did.
        last = at(jnp.maximum(index - 1, 0))
        mode = before.mode if last.mode is None else last.mode
        t, y, mode = select(index == 0, (before.t, before.y, before.mode), (last.t, last.y, mode))
        return Starts(t, y, mode, jax.lax.stop_gradient(rows.t[index] - t))

    def state(row: LogRow) -> States:
        if row.mode_before is None:
            return States(row.t, row.y, before.mode, jnp.zeros_like(before.mode))
        # The attempt of length zero right after an event is the one whose row stands behind the jump.
        jump = (row.code == REFRESH).astype(jnp.int32)
        return States(row.t, row.y_before, row.mode_before, jump)

    def event(row: LogRow) -> Events:
        return Events(row.t, row.guard, row.mode_before, row.mode, row.y_before, row.y)

    events, crossings, outputs, stepped = logs
    if events is not None and rows.events is not None:
        events = _move(events, rows.events, before.events, after.events, lambda index: event(at(index)))
    crossings = tuple(
        _move(log, rows.crossings[i], before.crossings[i], after.crossings[i], start)
        for i, log in enumerate(crossings)
    )
    if outputs is not None:
        outputs = _move(
            outputs, rows.next_output, before.next_output, after.next_output,
            lambda index: state(at(index)),
        )  # fmt: skip
    if stepped is not None:
        keep = is_accepted(rows.code)
        # Rows that are not kept are written past the end, where `mode="drop"` drops them.
        place = jnp.where(keep, steps + jnp.cumsum(keep, dtype=jnp.int32) - 1, stepped.t.shape[0])
        stepped = jax.tree.map(
            lambda log, row: log.at[place].set(row, mode="drop"), stepped, jax.vmap(state)(rows)
        )
        steps = steps + jnp.sum(keep, dtype=jnp.int32)
    return Logs(events, crossings, outputs, stepped), steps


def _move(log, counts, first, last, pick):
    """Write `pick(row)` into `log` for each row at which the `counts` went up, `first` to `last`."""
    counts, first, last = jax.lax.stop_gradient((counts, first, last))
    # As many passes as the busiest lane of the batch needs; the others write past the end of their log.
    most = eqxi.unvmap_max(last - first)

    def body(carry):
        slot, log = carry
        number = first + slot
        # The first row at which the count is beyond `number`. A sum and no bisection: the compiler
        # computes it once, and the bisection again for every number of the row.
        index = jnp.sum(counts <= number, dtype=jnp.int32)
        row = pick(jnp.minimum(index, ACCURACY.rows_at_once - 1))
        size = jax.tree.leaves(log)[0].shape[0]
        place = jnp.where(number < last, number.astype(jnp.int32), size)
        log = jax.tree.map(lambda a, r: a.at[place].set(r, mode="drop"), log, row)
        return slot + 1, log

    return jax.lax.while_loop(lambda carry: carry[0] < most, body, (jnp.zeros((), first.dtype), log))[1]
