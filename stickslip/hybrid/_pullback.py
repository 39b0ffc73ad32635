"""Cotangents through one accepted attempt: the transpose of a step, at an event of its saltation.

Nothing of the step-size control is here, nor any guard but the one that fired: a step is known by where
it started, its length and its mode, and an event by the formula of its time.
"""

from typing import Any, NamedTuple

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._by_length import by_length, guard_and_slope, leaving_time, length_before, moved_to_zero
from ._crossing import land_on_section, length_of, section_and_slope
from ._loop_state import EVENT, Lane, Outcome, Plan, is_event, moved_on
from ._record import Logs
from ._section import Section
from .event_time import event_delay
from .executor import piece
from .tree import select, shift


class Tape(NamedTuple):
    """One attempt as the reverse sweep needs it: where it started, its length, what became of it.

    Places in logs are None where the log has no cotangent.
    """

    code: Any
    guard: Any
    t: Any
    y: PyTree
    dy: PyTree
    mode: Any
    h: Any
    after: Any  # `leaving_time`
    event_number: Any
    crossing_numbers: tuple
    fired: tuple
    output_number: Any
    landed: Any


def tape_row(plan: Plan, logs: Logs, before: Lane, outcome: Outcome) -> Tape:
    """The row of an attempt, with places in those `logs` that have cotangents.

    Fields that no attempt changes are left out.
    """
    crossed = [
        (None, None) if log is None else (number, fired.astype(jnp.int32))
        for log, number, fired in zip(logs.crossings, before.crossings, outcome.fired, strict=True)
    ]
    outputs, guards = logs.outputs is not None, plan.functions.num_guards > 0
    return Tape(
        code=outcome.code,
        guard=outcome.guard if guards else None,
        t=before.t,
        y=before.y,
        dy=before.dy,
        mode=before.mode if guards else None,
        h=before.h,
        after=leaving_time(plan, before) if plan.functions.roots else None,
        event_number=None if logs.events is None else before.events,
        crossing_numbers=tuple(number for number, _ in crossed),
        fired=tuple(fired for _, fired in crossed),
        output_number=before.next_output if outputs else None,
        landed=outcome.landed.astype(jnp.int32) if outputs else None,
    )


def _add(a, b):
    return jax.tree.map(jnp.add, a, b)


def _row_bar(log, number, present):
    """Cotangent of one row of a log, zero where this attempt wrote none."""
    size = jax.tree.leaves(log)[0].shape[0]
    place = jnp.minimum(number, size - 1).astype(jnp.int32)
    present = present & (number < size)
    return jax.tree.map(lambda a: jnp.where(present, a[place], 0.0), log)


def pull(
    plan: Plan, varied: PyTree, held: PyTree, row: Tape, bars: tuple, logs: Logs, near: tuple
) -> tuple:
    """Cotangents of `(problem, t, y, dy)` before one attempt from those after it; `x_bar`: of `x`.

    `near`: times of the crossings of each section.
    """
    problem_bar, t_bar, y_bar, dy_bar = bars
    event, moved = is_event(row.code), moved_on(row.code)
    logged = event & ~plan.functions.is_silent(row.guard) if plan.functions.num_silent else event

    # Cotangents of the rows this attempt wrote into the logs.
    before_bar = jax.tree.map(jnp.zeros_like, y_bar)
    after_bar, time_bar = before_bar, jnp.zeros_like(t_bar)
    used = event | moved
    if logs.outputs is not None:
        bar = _row_bar(logs.outputs, row.output_number, row.landed == 1)
        time_bar = time_bar + bar.t
        before_bar = _add(before_bar, bar.y)
    if logs.events is not None:
        bar = _row_bar(logs.events, row.event_number, logged)
        time_bar = time_bar + bar.t
        before_bar, after_bar = _add(before_bar, bar.y_before), _add(after_bar, bar.y_after)

    def field(varied, t, y):
        system, args = eqx.combine(varied, held)
        if row.after is not None:
            t, y = t + row.after, shift(y, jax.lax.stop_gradient(row.dy), row.after)
        return system.vector_field(t, y, row.mode, args)

    zero = jax.tree.map(jnp.zeros_like, y_bar)
    h, slope = row.h, None
    if plan.functions.roots:
        problem = eqx.combine(varied, held)
        look = guard_and_slope(plan, problem, row.mode, row.guard)
        h = jnp.where(event, length_before(plan, look, row.t, row.y, row.dy, h), h)
        slope = by_length(plan, problem, row, row.dy, h)

    def end(y1, dy1):
        """Cotangents of the end of the Runge-Kutta step, and those of parameters and time there."""
        end_t_bar = jnp.where(used, t_bar + time_bar, 0.0)
        y1_bar = select(moved, _add(y_bar, before_bar), zero)
        dy1_bar = select(moved, dy_bar, zero)
        if not plan.functions.num_guards:
            return (y1_bar, dy1_bar), (jax.tree.map(jnp.zeros_like, varied), end_t_bar)
        at_end, jump_t, jump_y1 = _pull_jump(
            plan, varied, row, h, y1, dy1, slope, jnp.where(event, end_t_bar, 0.0),
            select(event, before_bar, zero), select(event, _add(y_bar, after_bar), zero), held=held,
        )  # fmt: skip
        end_t_bar = jnp.where(event, jump_t, end_t_bar)
        return (select(event, jump_y1, y1_bar), dy1_bar), (at_end, end_t_bar)

    (at_end, end_t_bar), (in_step, step_t, step_y, step_dy) = plan.stepper.vjp(
        field, varied, row.t, row.y, row.dy, h, end, plan.execute
    )
    found = (
        jax.tree.map(lambda a, b, c: a + jnp.where(used, b + c, 0.0), problem_bar, at_end, in_step),
        jnp.where(used, end_t_bar + step_t, t_bar),
        select(used, step_y, y_bar),
        select(moved, step_dy, select(event, _add(dy_bar, step_dy), dy_bar)),
    )
    sections = plan.functions.sections
    rows = zip(sections, logs.crossings, row.crossing_numbers, row.fired, near, strict=True)
    for section, log, *where in rows:
        if log is not None:
            inside = _pull_crossing(plan, varied, row, section, log, *where, field=field, held=held)
            found = _add(found, inside)
    return found


def _pull_crossing(
    plan: Plan, varied, row: Tape, section: Section, log, number, fired, near, *, field, held
) -> tuple:  # fmt: skip
    """Cotangents before an attempt from those of the crossing inside it, zero where there is none."""
    bar = _row_bar(log, number, fired == 1)
    h = length_of(row, near[jnp.minimum(number, near.shape[0] - 1).astype(jnp.int32)])
    slope = None
    if plan.functions.roots:
        problem = eqx.combine(varied, held)
        look = section_and_slope(problem, section, row.mode)
        h = length_before(plan, look, row.t, row.y, row.dy, h)
        slope = by_length(plan, problem, row, row.dy, h)

    def end(y1, dy1):
        at_end, t_bar, y1_bar = _pull_landing(
            plan, varied, row, h, y1, dy1, slope, bar, section=section, held=held
        )
        return (y1_bar, jax.tree.map(jnp.zeros_like, dy1)), (at_end, t_bar)

    def inside(varied, row):
        (at_end, t_bar), (in_step, step_t, step_y, step_dy) = plan.stepper.vjp(
            field, varied, row.t, row.y, row.dy, h, end, plan.execute
        )
        return _add(at_end, in_step), t_bar + step_t, step_y, step_dy

    def outside(varied, row):
        return jax.tree.map(jnp.zeros_like, (varied, row.t, row.y, row.dy))

    return jax.lax.cond(eqxi.unvmap_any(fired == 1), inside, outside, varied, row)


@piece
def _pull_landing(plan: Plan, varied, row: Tape, h, y1, dy1, slope, bar, *, section: Section, held):
    def land(varied, t, y1):
        problem = eqx.combine(varied, held)
        found = land_on_section(problem, section, row._replace(t=t), h, y1, dy1, slope)
        return found.t, found.y, found.dy

    return jax.vjp(land, varied, row.t, y1)[1]((bar.t, bar.y, bar.dy))


@piece
def _pull_jump(plan: Plan, varied, row: Tape, h, y1, dy1, slope, t_bar, before_bar, after_bar, *, held):
    def end(varied, t, y1):
        system, args = problem = eqx.combine(varied, held)
        if slope is not None:
            look = guard_and_slope(plan, problem, row.mode, row.guard)
            t, before, _ = moved_to_zero(look, t, y1, slope, row.code == EVENT)
            return t, before, system.transition(t, before, row.mode, row.guard, args)[0]
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

    _, pull = jax.vjp(end, varied, row.t + h, y1)
    return pull((t_bar, before_bar, after_bar))
