"""Reverse sweep through a simulation, with memory bounded by checkpoints.

Only accepted attempts carry derivatives. The motion is computed once more, its state kept every
block; then, block by block from the end, the accepted attempts of a block are dumped and walked
backwards. Each is a Runge-Kutta step, at an event followed by the Newton correction of the event
time and the transition, so its transpose is the transpose of the saltation formula.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._attempt import attempt
from ._event_time import event_delay
from ._lane import EVENT, Lane, Outcome, Plan, accepted, is_event, moved_on
from ._loop import running
from ._record import Logs, Record
from ._tree import select, shift, write_row


class Tape(NamedTuple):
    """One attempt as the reverse sweep needs it: where it started, its length, what became of it."""

    code: Any
    guard: Any
    t: Any
    y: PyTree
    dy: PyTree
    mode: Any
    h: Any
    event_number: Any
    crossing_numbers: tuple
    fired: tuple
    output_number: Any
    landed: Any
    step_number: Any


def block_length(max_steps: int) -> int:
    """Attempts between checkpoints: the root of their number balances both memories."""
    return min(256, max(16, math.isqrt(max(max_steps - 1, 1)) + 1))


def adjoint(inputs, fixed, plan: Plan, spec: Record, cotangents, make_start) -> PyTree:
    """Cotangents of `inputs = (theta, t0, y0)` for the cotangents of the smooth results."""
    theta, t0, y0 = inputs
    mode0, t1, outputs = fixed
    size = block_length(plan.max_steps)
    blocks = -(-plan.max_steps // size)
    first = make_start(plan, inputs, mode0)
    steps0 = jnp.zeros_like(mode0)

    def forward(carry):
        number, lane, steps, kept = carry
        kept = write_row(kept, (lane, steps), number)
        lane, steps = _advance(plan, theta, lane, steps, t1, outputs, size)
        return number + 1, lane, steps, kept

    kept = jax.tree.map(lambda a: jnp.zeros((blocks, *a.shape), a.dtype), (first, steps0))
    number, _, _, kept = jax.lax.while_loop(
        lambda c: running(c[1]) & (c[0] < blocks),
        forward,
        (jnp.zeros((), jnp.int32), first, steps0, kept),
    )

    varied, held = eqx.partition(theta, eqx.is_inexact_array)
    zero = jax.tree.map(jnp.zeros_like, (varied, t0, y0, y0))
    bars = (
        zero[0],
        zero[1] + cotangents.t,
        _add(zero[2], cotangents.y),
        zero[3],
    )

    def backward(carry):
        number, bars = carry
        lane, steps = jax.tree.map(lambda buffer: buffer[number - 1], kept)
        rows = _tape(plan, theta, lane, steps, t1, outputs, size)

        def sweep(varied, rows, bars, logs):
            def body(bars, row):
                return _pull(plan, spec, varied, held, row, bars, logs), None

            return jax.lax.scan(body, bars, rows, reverse=True)[0]

        bars = plan.execute.loop(sweep, varied, rows, bars, cotangents.logs)
        return number - 1, bars

    _, bars = jax.lax.while_loop(lambda c: c[0] > 0, backward, (number, bars))
    theta_bar, t_bar, y_bar, _ = bars
    return theta_bar, t_bar, y_bar


def _counted(steps, code):
    return steps + jnp.where(accepted(code), 1, 0).astype(steps.dtype)


def _advance(plan: Plan, theta, lane: Lane, steps, t1, outputs, size):
    def whole(theta, lane, steps, t1, outputs):
        def body(carry):
            count, lane, steps = carry
            lane, outcome = attempt(plan, theta, lane, t1, outputs)
            return count + 1, lane, _counted(steps, outcome.code)

        start = (jnp.zeros((), jnp.int32), lane, steps)
        return jax.lax.while_loop(lambda c: (c[0] < size) & running(c[1]), body, start)[1:]

    return plan.execute.loop(whole, theta, lane, steps, t1, outputs)


def _tape(plan: Plan, theta, lane: Lane, steps, t1, outputs, size):
    def whole(theta, lane, steps, t1, outputs):
        def body(carry, _):
            lane, steps = carry
            after, outcome = attempt(plan, theta, lane, t1, outputs)
            return (after, _counted(steps, outcome.code)), _tape_row(lane, after, outcome, steps)

        return jax.lax.scan(body, (lane, steps), None, length=size)[1]

    return plan.execute.loop(whole, theta, lane, steps, t1, outputs)


def _tape_row(before: Lane, after: Lane, outcome: Outcome, steps) -> Tape:
    return Tape(
        code=outcome.code,
        guard=outcome.guard,
        t=before.t,
        y=before.y,
        dy=before.dy,
        mode=before.mode,
        h=before.h,
        event_number=before.events,
        crossing_numbers=before.crossings,
        fired=tuple(f.astype(jnp.int32) for f in outcome.fired),
        output_number=before.next_output,
        landed=outcome.landed.astype(jnp.int32),
        step_number=steps,
    )


def _add(a, b):
    return jax.tree.map(jnp.add, a, b)


def _row_bar(log, number, present):
    """Cotangent of one row of a log, zero where this attempt wrote none."""
    size = jax.tree.leaves(log)[0].shape[0]
    place = jnp.minimum(number, size - 1).astype(jnp.int32)
    present = present & (number < size)
    return jax.tree.map(lambda a: jnp.where(present, a[place], 0.0), log)


def _pull(plan: Plan, spec: Record, varied, held, row: Tape, bars, logs: Logs):
    """Cotangents before one attempt from those after it."""
    theta_bar, t_bar, y_bar, dy_bar = bars
    once = plan.execute.boundary
    event, moved = is_event(row.code), moved_on(row.code)

    # Cotangents of the rows this attempt wrote into the logs.
    before_bar = jax.tree.map(jnp.zeros_like, y_bar)
    after_bar, time_bar = before_bar, jnp.zeros_like(t_bar)
    states = [
        (logs.outputs, row.output_number, row.landed == 1),
        (logs.steps, row.step_number, event | moved),
    ]
    for log, number, present in states:
        if log is not None and jax.tree.leaves(log):
            bar = _row_bar(log, number, present)
            time_bar = time_bar + bar.t
            before_bar = _add(before_bar, bar.y)
    if logs.events is not None:
        bar = _row_bar(logs.events, row.event_number, event)
        time_bar = time_bar + bar.t
        before_bar, after_bar = _add(before_bar, bar.y_before), _add(after_bar, bar.y_after)

    def field(varied, t, y):
        system, args = eqx.combine(varied, held)
        return system.vector_field(t, y, row.mode, args)

    zero = jax.tree.map(jnp.zeros_like, y_bar)

    def end(y1, dy1):
        """Cotangents of the end of the Runge-Kutta step, and those of parameters and time there."""
        end_t_bar = jnp.where(event | moved, t_bar + time_bar, 0.0)
        y1_bar = select(moved, _add(y_bar, before_bar), zero)
        dy1_bar = select(moved, dy_bar, zero)
        if not plan.functions.num_guards:
            return (y1_bar, dy1_bar), (jax.tree.map(jnp.zeros_like, varied), end_t_bar)
        end_theta, jump_t, jump_y1 = once(
            lambda *a: _pull_jump(plan, held, *a),
            varied, row, y1, dy1, jnp.where(event, end_t_bar, 0.0),
            select(event, before_bar, zero), select(event, _add(y_bar, after_bar), zero),
        )  # fmt: skip
        end_t_bar = jnp.where(event, jump_t, end_t_bar)
        return (select(event, jump_y1, y1_bar), dy1_bar), (end_theta, end_t_bar)

    (end_theta, end_t_bar), (step_theta, step_t, step_y, step_dy) = plan.stepper.vjp(
        field, varied, row.t, row.y, row.dy, row.h, end, plan.execute
    )
    used = event | moved
    start_t_bar = jnp.where(used, end_t_bar + step_t, t_bar)
    start_y_bar = select(used, step_y, y_bar)
    for log, number, f in zip(logs.crossings, row.crossing_numbers, row.fired, strict=True):
        if jax.tree.leaves(log):
            bar = _row_bar(log, number, f == 1)
            start_t_bar, start_y_bar = start_t_bar + bar.t, _add(start_y_bar, bar.y)
    return (
        jax.tree.map(lambda a, b, c: a + jnp.where(used, b + c, 0.0), theta_bar, end_theta, step_theta),
        start_t_bar,
        start_y_bar,
        select(moved, step_dy, select(event, _add(dy_bar, step_dy), dy_bar)),
    )


def _pull_jump(plan: Plan, held, varied, row: Tape, y1, dy1, t_bar, before_bar, after_bar):
    def end(varied, t, y1):
        system, args = eqx.combine(varied, held)
        functions = plan.functions
        values = functions.evaluate(system, t, y1, dy1, row.mode, args)
        value, rate = values.value[0], values.rate[0]
        for i in range(1, functions.num_guards):
            value = jnp.where(row.guard == i, values.value[i], value)
            rate = jnp.where(row.guard == i, values.rate[i], rate)
        dt = event_delay(value, jax.lax.stop_gradient(rate), row.code == EVENT)
        before = shift(y1, dy1, dt)
        after, _ = system.transition(t + dt, before, row.mode, row.guard, args)
        return t + dt, before, after

    _, pull = jax.vjp(end, varied, row.t + row.h, y1)
    return pull((t_bar, before_bar, after_bar))
