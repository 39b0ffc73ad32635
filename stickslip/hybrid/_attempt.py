"""One Runge-Kutta attempt of one lane, from beginning to end: step, look, decide, move, account.

Whatever is computed here is computed for every step of every lane. Where the event functions leave all
lanes of a batch alone, and in systems without any, the same code runs with the events absent.
"""

import functools
from typing import Any

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from ._accounts import accounts, crossed_sections, sections_at_zero, steepest, without_passed
from ._by_length import event_with_slopes
from ._control import control
from ._event_decision import First, decide, lowest, search_bracket
from ._loop_state import (
    EVENT,
    HOLD,
    PLAIN,
    Lane,
    Outcome,
    Plan,
    is_accepted,
    is_event,
    moved_on,
    without_state,
)
from ._steep import has_no_bound
from ._step import Step, take
from .accuracy import ACCURACY
from .event_functions import Values
from .event_time import event_delay
from .executor import bookkeeping, piece
from .system import mode_type
from .tree import select, shift


def attempt(plan: Plan, problem: PyTree, lane: Lane, t1: Any, outputs: Any) -> tuple[Lane, Outcome]:
    """One attempt of one lane. `problem = (system, args)`; `outputs` are the output times or None."""
    lane, step = take(plan, problem, lane)
    # Decisions get the lane without its state, so that no gradient flows through them.
    bare = without_state(lane)
    first = None
    if plan.interrupts:
        first = lowest(plan, bare, step.values, step.h_seen, step.jumps)
    code = decide(plan, bare, step, first)

    def as_decided(lane, step, code, t1, outputs):
        return _advance(plan, problem, lane, step, code, first, t1, outputs)

    def take_plainly(lane, step, code, t1, outputs):
        return _advance(plan, problem, lane, step, code, None, t1, outputs, judged=True)

    def wait(lane, step, code, t1, outputs):
        nothing = code > HOLD
        fired = tuple(nothing for _ in plan.functions.sections)
        return lane, Outcome(code, jnp.zeros_like(lane.mode), nothing, fired, step.y1, step.dy1)

    # One branch for the whole batch, so that `vmap` does not make it a selection of both. It also
    # keeps the compiler from computing the stages of a portable program once per result.
    if first is None or not plan.locates:
        if plan.execute.fused:
            return as_decided(lane, step, code, t1, outputs)
        ended = eqxi.unvmap_all(code == HOLD)
        return jax.lax.cond(ended, wait, as_decided, lane, step, code, t1, outputs)
    # A lane that has ended is calm too: one that waits must not send the others down the long way.
    calm = ((code == PLAIN) | (code == HOLD)) & (first.marks == 0)
    return jax.lax.cond(eqxi.unvmap_all(calm), take_plainly, as_decided, lane, step, code, t1, outputs)


def _advance(
    plan: Plan, problem: PyTree, lane: Lane, step: Step, code: Any, first: First | None, t1: Any,
    outputs: Any, judged: bool = False,
) -> tuple[Lane, Outcome]:  # fmt: skip
    """The lane after its attempt.

    `first`: the event function that comes first; None where none interferes. `judged`: every lane of
    the batch is known to be accepted without an event, or to have ended. Each part is a pass over the
    batch, so fields that are not read again are then left stale.
    """
    bare = without_state(lane)
    guarded = first is not None and plan.functions.num_guards > 0
    dt, jump, y_before = None, None, step.y1
    if first is not None and guarded:
        # Computed in every lane, because a batch selects afterwards: where there is no event, `dt` is 0
        # and what the transition makes of the state is thrown away.
        dt, exact = _delay(plan, code, first, step.h), None
        y_before = _shift_state(plan, step.y1, jax.lax.stop_gradient(step.dy1), dt)
        if plan.functions.roots:
            dt, y_before = exact = event_with_slopes(
                plan, problem, lane, step.h, first.index, code == EVENT, dt, y_before
            )
        jump = _transition(
            plan, lane.mode, first.index, step, lane.t + step.h, dt, exact, problem=problem
        )
        if plan.functions.num_bends:
            jumps, bends, steep = _kick(
                plan, bare.mode, first.index, bare.t + step.h, step.y1, problem=problem
            )
            first = first._replace(jumps=jumps, bends=bends, steep=steep)

    keeps = not judged and (first is not None or plan.step_size.adaptive)
    t, y, dy, mode = _end_of_attempt(
        plan, code, lane.t, lane.y, lane.dy, lane.mode, step, dt, jump, keeps=keeps
    )
    seen, at_zero = step.values, ()
    if guarded and plan.functions.sections:
        seen = _values_at_event(plan, step.values, dt)
        at_zero = sections_at_zero(plan, code, bare, seen)
    kept = step.kept if first is None else without_passed(plan, code, bare, step.h, first, step.kept)
    known = _next_start_values(plan, code, bare, kept, at_zero, keeps=keeps)
    fired = crossed_sections(plan, code, bare, seen, at_zero, meets=first is not None)

    # The length that opened the bracket outlives the attempts inside it: tolerances are parts of it,
    # because a hop of the search may be arbitrarily short.
    search, bracket, full = None, lane.bracket, lane.full
    if first is not None:
        h_located = step.h
        if plan.locates:
            bracket, full, h_located = search_bracket(plan, bare, code, step.h, first)
        search = h_located, first.h_dip
    elif plan.locates:
        full = step.h
    # The next length is chosen from the new time: an output or the end may be nearer than the rule's
    # step, and an event has moved the time by `dt`.
    following = control(
        plan, code, bare, step.h, search, known, step.error, t, y, dy, lane.size, t1, outputs,
        begins=not judged,
    )  # fmt: skip
    counted = accounts(
        plan, code, bare, step.h, t, mode, first, fired, following.output, following.h, t1, outputs,
        judged=judged,
    )  # fmt: skip
    after = lane._replace(
        t=t, y=y, dy=dy, mode=mode, values=known.value, rates=known.rate, scales=known.scale,
        h=following.h, h_free=following.h_free, next_output=following.output, full=full,
        bracket=bracket, **counted,
    )  # fmt: skip
    if plan.step_size.adaptive:
        after = after._replace(error=_error(plan, code, step.error, lane.error))
    guard = jnp.zeros_like(lane.mode) if first is None else first.index
    return after, Outcome(code, guard, following.landed, fired, y_before, step.dy1)


@piece
def _delay(plan: Plan, code, first: First, h):
    """Newton correction of the time of the event; it carries the derivative of the event time."""
    dt = event_delay(first.value, jax.lax.stop_gradient(first.rate), code == EVENT)
    # Time does not run back beyond the start of the step, not even by rounding.
    return dt + jax.lax.stop_gradient(jnp.maximum(-h - dt, 0.0))


@piece
def _shift_state(plan: Plan, y, slope, dt):
    return shift(y, slope, dt)


@piece
def _transition(plan: Plan, mode, guard, step: Step, t_end, dt, exact, *, problem):
    """State and mode right after the event."""
    system, args = problem
    # The slope is held: its derivative would enter times `dt`, which is zero but for rounding.
    y = shift(step.y1, jax.lax.stop_gradient(step.dy1), dt) if exact is None else exact[1]
    y_new, mode_new = system.transition(t_end + dt, y, mode, guard, args)
    return y_new, jnp.asarray(mode_new, mode_type(system))


@bookkeeping
def _kick(plan: Plan, mode, index, t, y, *, problem):
    """Whether the field jumps where a bend is crossed, whether its slope does, and whether that slope
    has no bound there."""
    system, args = problem

    flat, back = ravel_pytree(y)
    # No two components alike: a force between two bodies does not change where both move as one.
    aside = back(jnp.asarray(1.0 + (np.arange(flat.size) * 0.618) % 1.0))

    def look(mode):
        return jax.jvp(lambda y: system.vector_field(t, y, mode, args), (y,), (aside,))

    # In one batch: the field is in the program once for both sides.
    modes = jnp.stack([mode, system.transition(t, y, mode, index, args)[1]])
    slopes = jax.vmap(look)(modes)
    found = tuple(
        _differs(a, level) for a, level in zip(slopes, (ACCURACY.jump, ACCURACY.zero), strict=True)
    )
    steep = has_no_bound(system, t, y, modes, index, args) if plan.functions.roots else False
    return (*found, steep)


def _differs(both: PyTree, level: float) -> Any:
    """Whether a number differs on both sides by more than a part of itself."""
    found = [
        jnp.any(jnp.abs(a[0] - a[1]) > level * (jnp.abs(a[0]) + jnp.abs(a[1])))
        for a in jax.tree.leaves(both)
    ]
    return functools.reduce(jnp.logical_or, found)


@piece
def _end_of_attempt(plan: Plan, code, t, y, dy, mode, step: Step, dt, jump, *, keeps: bool):
    """Time, state, slope and mode after the attempt."""
    t_end = t + step.h
    goes = is_accepted(code)
    if jump is None:
        t, y = select(goes, (t_end, step.y1), (t, y))
    else:
        event, goes = is_event(code), moved_on(code)
        t = jnp.where(event | goes, t_end + dt, t)
        y = select(event, jump[0], select(goes, step.y1, y))
        mode = jnp.where(event, jump[1], mode)
    # A rejected lane tries again from the same slope.
    return t, y, select(goes, step.dy1, dy) if keeps else step.dy1, mode


@bookkeeping
def _values_at_event(plan: Plan, values: Values, dt) -> Values:
    """Event functions at the time of the event, to which the attempt does not reach by `dt`."""
    moved = (v + rate * dt for v, rate in zip(values.value, values.rate, strict=True))
    return values._replace(value=tuple(moved))


@bookkeeping
def _next_start_values(
    plan: Plan, code, lane: Lane, kept: Values, at_zero: tuple, *, keeps: bool
) -> Values:
    """Event functions at the start of the next attempt, and the magnitudes behind them.

    `at_zero`: which sections are zero at an event.
    """
    if at_zero:
        guards, sections = kept.value[: -len(at_zero)], kept.value[-len(at_zero) :]
        rounded = (jnp.where(zero, 0.0, v) for v, zero in zip(sections, at_zero, strict=True))
        # In the mode after the event they are at zero if they were so at the event: by the same slope.
        event, n = is_event(code), len(guards)
        slopes = (
            jnp.where(zero & event, steepest(old, new), new)
            for old, new, zero in zip(lane.rates[n:], kept.rate[n:], at_zero, strict=True)
        )
        kept = kept._replace(value=(*guards, *rounded), rate=(*kept.rate[:n], *slopes))
    old = Values(lane.values, lane.rates, lane.scales)
    return select(is_accepted(code), kept, old) if keeps else kept


@bookkeeping
def _error(plan: Plan, code, error, last):
    return jnp.where(code == PLAIN, error, last)
