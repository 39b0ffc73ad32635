"""What comes after an attempt: the next step length, counters, flags and the result code."""

from typing import Any, NamedTuple

import equinox.internal as eqxi
import jax
import jax.numpy as jnp

from ._events import Values
from ._first import First, crossed_sections
from ._lane import (
    COLLAPSED,
    DIP,
    EVENT,
    HOLD,
    PLAIN,
    REFRESH,
    REJECT,
    SHRINK,
    VIOLATED,
    Lane,
    Plan,
    accepted,
    is_event,
    moved_on,
)
from ._status import CODE, COINCIDENT, DISCONTINUOUS, EVENT_AT_START, GRAZING, RUNNING, flag
from ._tolerance import Ends, scales

_STATUS = {name: float(number) for name, number in CODE.items()}
MAX_ZERO_LENGTH = 16  # events without time passing before the lane is called chattering
# A step this much shorter than those before it, accepted only because its error is small now, holds a
# jump of the field: what is smooth is resolved long before.
SUDDEN = 1e-5
FORGETS = 0.95  # part of the longest step that is remembered after one more


def _target(plan: Plan, next_output, t1, outputs):
    """Time the lane must land on next, and whether that is the end rather than an output time."""
    if not plan.has_outputs:
        return t1, jnp.ones_like(next_output) > 0
    n = outputs.shape[0]
    is_last = next_output >= n
    return jnp.where(is_last, t1, outputs[jnp.minimum(next_output, n - 1)]), is_last


def _rounding(t, t1):
    return 4e-16 * jnp.maximum(jnp.abs(t), jnp.abs(t1))


def _short(h, t):
    """A Zeno sequence ends in hops that are lost in the rounding of the time."""
    return h <= 4e-16 * jnp.maximum(jnp.abs(t), 1e-300)


class Next(NamedTuple):
    """The next attempt: its length, what the step-size rule alone would take, the output aimed at."""

    h: Any
    h_free: Any
    output: Any
    landed: Any  # whether this attempt landed on an output time


def control(
    plan: Plan, code, lane: Lane, h, h_located, h_dip, error, t, y, dy, size, t1, outputs, begins: bool
) -> Next:
    """What to attempt next; `begins`: whether a lane may just have computed its first slope."""
    rule: Any = plan.step_size
    once = plan.execute.boundary
    landed, next_output = code < HOLD, lane.next_output
    if plan.has_outputs:
        landed, next_output = once(lambda *a: _landed(plan, *a), code, next_output, t, t1, outputs)
    h_free, h_take, h_rejected = lane.h_free, None, h
    if rule.adaptive:
        order = plan.stepper.order()
        error = jnp.where(error < 1e10, error, 1e10)
        factor = factor_rejected = once(lambda e, last: rule.factor(e, last, order), error, lane.error)
        if rule.pcoeff:
            factor_rejected = once(lambda e: rule.factor(e, 1.0, order), error)
        first = h_free
        if begins:
            first = jax.lax.cond(
                eqxi.unvmap_any(h_free == 0),
                lambda y, dy, size, h_free: jnp.where(
                    h_free == 0,
                    rule.initial(
                        y, dy, scales(rule, plan.atols, plan.noise, size, Ends(h, y, y, dy, dy))
                    ),
                    h_free,
                ),
                lambda y, dy, size, h_free: h_free,
                y, dy, size, h_free,
            )  # fmt: skip

        def free(code, h, h_free, first, factor, factor_rejected, tries, landed):
            grown = h * factor
            grown = jnp.where(landed | (tries != 0), jnp.maximum(grown, h_free), grown)
            taken = jnp.where(code == PLAIN, grown, first)
            rejected = h * jnp.minimum(factor_rejected, 0.9)
            return jnp.minimum(jnp.where(code == REJECT, rejected, taken), rule.dtmax)

        h_free = once(free, code, h, h_free, first, factor, factor_rejected, lane.bracket.tries, landed)
        h_take = h_rejected = h_free

    def length(code, h_take, h_rejected, h_located, h_dip, next_output, t, t1, outputs):
        target = _target(plan, next_output, t1, outputs)[0] if plan.has_outputs else t1
        h_take = rule.initial(y, dy, None) if h_take is None else h_take
        remaining = target - t
        h_next = jnp.where(remaining <= h_take * (1.0 + 1e-9), jnp.maximum(remaining, 0.0), h_take)
        h_next = jnp.where(is_event(code), 0.0, h_next)
        h_next = jnp.where(code == SHRINK, h_located, h_next)
        h_next = jnp.where(code == DIP, h_dip, h_next)
        return jnp.where(code == REJECT, h_rejected, h_next)

    h_next = once(length, code, h_take, h_rejected, h_located, h_dip, next_output, t, t1, outputs)
    return Next(h_next, h_free, next_output, landed)


def _landed(plan: Plan, code, next_output, t, t1, outputs):
    target, is_last = _target(plan, next_output, t1, outputs)
    landed = (code == PLAIN) | (code == REFRESH)
    landed = landed & (target - t <= _rounding(t, t1)) & ~is_last
    return landed, next_output + jnp.where(landed, 1, 0)


def books(
    plan: Plan, code, lane: Lane, h, t, mode, mode_jump, first: First, fired, next_output, h_next, t1,
    outputs,
):  # fmt: skip
    """Counters, flags and the result code."""
    event, moved = is_event(code), moved_on(code)
    one = jnp.where(event, 1.0, 0.0)
    finished = moved & (t1 - t <= _rounding(t, t1))
    if plan.has_outputs:
        finished = finished & (next_output >= outputs.shape[0])
    events = lane.events + one
    attempts = lane.attempts + jnp.where(code == HOLD, 0.0, 1.0)
    flags, sequence, zero_events = lane.flags, lane.sequence, lane.zero_events
    if plan.functions.num_guards:
        short = _short(h, t)
        zero_events = jnp.where(event & short, zero_events + 1.0, zero_events)
        zero_events = jnp.where((event | (code == PLAIN)) & ~short, 0.0, zero_events)
        # The slope of a crossing that is only just one is not known: it is the root of its depth.
        bend = jnp.abs(first.rate - first.rate_start)
        grazes = (lane.h > 0) & (first.rate**2 * lane.h < 2.0 * bend * plan.touching)
        grazes = (code == COLLAPSED) | ((code == EVENT) & grazes)
        flags = flags | jnp.where(grazes, GRAZING, 0)
        # An attempt of length zero compares the guards of two modes.
        flags = flags | jnp.where(moved & (code != REFRESH), first.marks, 0)
        flags = flags | jnp.where(event & (first.close > 1), COINCIDENT, 0)
        flags = flags | jnp.where(code == VIOLATED, EVENT_AT_START, 0)
        letter = (first.index * 64 + mode_jump + 1).astype(jnp.uint32)
        sequence = jnp.where(event, sequence * jnp.uint32(1000003) + letter, sequence)

    status = jnp.full_like(code, float(RUNNING))
    status = jnp.where(attempts >= plan.max_steps, _STATUS["max_steps_reached"], status)
    if plan.max_events is not None:
        status = jnp.where(events > plan.max_events, _STATUS["max_events_reached"], status)
    crossings, status = _counted(plan, lane.crossings, fired, status)
    status = jnp.where(zero_events > MAX_ZERO_LENGTH, _STATUS["chattering"], status)
    status = jnp.where(mode < 0, _STATUS["no_admissible_mode"], status)
    status = _exhausted(plan, code, h_next, t, t1, status)
    status = jnp.where(finished, _STATUS["successful"], status)
    for f, section in zip(fired, plan.functions.sections, strict=True):
        if section.terminal:
            status = jnp.where(f, _STATUS["event_occurred"], status)
    fresh = jnp.where(event, 0.0, jnp.where(moved, 1.0, lane.fresh))
    return dict(
        fresh=fresh,
        zero_events=zero_events,
        events=events,
        attempts=attempts,
        accepted=lane.accepted + jnp.where((code >= PLAIN) & (code != REFRESH), 1.0, 0.0),
        crossings=crossings,
        flags=flags,
        sequence=sequence,
        status=jnp.where(code == HOLD, lane.status, status),
    )


def _counted(plan: Plan, crossings, fired, status):
    """Crossings so far, and the result code where one section has more than there is room for."""
    crossings = tuple(c + jnp.where(f, 1.0, 0.0) for c, f in zip(crossings, fired, strict=True))
    for count, section in zip(crossings, plan.functions.sections, strict=True):
        if not section.terminal:
            full = count > plan.max_crossings
            status = jnp.where(full, _STATUS["max_crossings_reached"], status)
    return crossings, status


def quiet_books(
    plan: Plan, code, lane: Lane, h, t, values: Values, next_output, h_next, t1, outputs
):  # fmt: skip
    """`books` after an attempt without event: what can have changed."""
    attempts = lane.attempts + jnp.where(code == HOLD, 0.0, 1.0)
    status = jnp.where(attempts >= plan.max_steps, _STATUS["max_steps_reached"], lane.status)
    fired = crossed_sections(plan.functions, code, lane, values)
    crossings, status = _counted(plan, lane.crossings, fired, status)
    if not plan.interrupts:
        status = _exhausted(plan, code, h_next, t, t1, status)
    finished = accepted(code) & (t1 - t <= _rounding(t, t1))
    if plan.has_outputs:
        finished = finished & (next_output >= outputs.shape[0])
    status = jnp.where(finished, _STATUS["successful"], status)
    accounts = dict(
        attempts=attempts,
        accepted=lane.accepted + jnp.where(code == PLAIN, 1.0, 0.0),
        crossings=crossings,
        status=jnp.where(code == HOLD, lane.status, status),
    )
    if plan.functions.num_guards:
        accounts["zero_events"] = jnp.where(accepted(code) & ~_short(h, t), 0.0, lane.zero_events)
    return accounts


def sudden(lane: Lane, error) -> tuple[Any, Any]:
    """Longest of the last steps, and the flag of one that had to become short all at once.

    A field that jumps inside a step has an error in proportion to the length, whatever the order of
    the method: attempts collapse onto the jump until it no longer matters. The motion is right, but
    its derivative by the time of the jump is lost.
    """
    fits = (lane.status == RUNNING) & (lane.h > 0) & (lane.bracket.tries == 0) & (error <= 1.0)
    jumps = fits & (lane.h < SUDDEN * lane.peak) & (error > 1e-3)
    peak = jnp.where(fits, jnp.maximum(lane.h, FORGETS * lane.peak), lane.peak)
    return peak, lane.flags | flag(jumps, DISCONTINUOUS)


def _exhausted(plan: Plan, code, h_next, t, t1, status):
    """Result code where a rejected step cannot be made shorter."""
    if not plan.step_size.adaptive:
        return jnp.where(code == REJECT, _STATUS["nonfinite"], status)
    rule: Any = plan.step_size
    spent = (code == REJECT) & (h_next <= jnp.maximum(rule.dtmin, _rounding(t, t1)))
    return jnp.where(spent, _STATUS["dt_min_reached"], status)
