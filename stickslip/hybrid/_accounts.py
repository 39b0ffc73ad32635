"""Counters, flags and the result code: the record of an attempt beside the motion."""

from typing import Any

import jax.numpy as jnp

from . import _locate
from ._control import rounding
from ._event_decision import First, is_guard
from ._loop_state import (
    COLLAPSED,
    EVENT,
    HOLD,
    PLAIN,
    REFRESH,
    REJECT,
    SECTION,
    VIOLATED,
    Lane,
    Plan,
    is_accepted,
    is_event,
    moved_on,
)
from .accuracy import ACCURACY
from .event_functions import Values
from .executor import bookkeeping
from .status import (
    CODE,
    COINCIDENT,
    EVENT_AT_START,
    FLAGS,
    GRAZING,
    RESTED,
    RUNNING,
    TOUCHED,
    flag,
    flags_with,
    of_guard,
)

_STATUS = {name: float(number) for name, number in CODE.items()}


@bookkeeping
def sections_at_zero(plan: Plan, code: Any, lane: Lane, values: Values) -> tuple:
    """Which sections are zero at an event as far as its time is known, and have no sign there.

    A section that coincides with a guard would be crossed twice or more otherwise: as its value comes
    out on the far side by rounding, and as the transition or the motion brings it back.
    """
    functions = plan.functions
    # After one event another may follow at once, and then no step says how well the first was located.
    opened = jnp.where((lane.bracket.tries == 0) & (lane.h > 0), lane.h, lane.full)
    full = jnp.maximum(opened, jnp.where(lane.h > 0, 0.0, lane.h_free))
    event = is_event(code) | ((code == REFRESH) & (lane.accepted > 0))
    return tuple(
        event & _is_zero(lane, values, i, full) for i in range(functions.num_guards, functions.count)
    )


def _is_zero(lane: Lane, values: Values, i: int, full: Any) -> Any:
    """Whether a function is zero as far as the time of an event in a step of length `full` is known."""
    known_to = ACCURACY.same_instant * (ACCURACY.solved * full + ACCURACY.rounding * jnp.abs(lane.t))
    return jnp.abs(values.value[i]) <= known_to * steepest(lane.rates[i], values.rate[i])


@bookkeeping
def without_passed(plan: Plan, code: Any, lane: Lane, h: Any, first: First, kept: Values) -> Values:
    """Values to go on with, exactly 0 for a guard that fires both ways and has just fired.

    It then has the sign that it goes to. The sign of what the location leaves of it would be that of a
    rounding, and where it is the wrong one the guard would fire again at once. A transition may take
    the guard elsewhere: then it has the sign that it has there.
    """
    value = list(kept.value)
    for i, direction in enumerate(plan.functions.directions[: plan.functions.num_guards]):
        if direction != "both":
            continue
        passed = (lane.values[i] == 0) & (h == 0) & _is_zero(lane, kept, i, lane.full)
        # Of another guard a zero is one that is still to be met: it keeps the sign that it comes from.
        met = jnp.where(value[i] == 0, ACCURACY.tiny * jnp.sign(lane.values[i]), value[i])
        met = jnp.where(passed | (first.index == i), 0.0, met)
        after = jnp.where((code == REFRESH) & passed, 0.0, value[i])
        value[i] = jnp.where(is_event(code), met, after)
    return kept._replace(value=tuple(value))


def steepest(before: Any, after: Any) -> Any:
    """The larger of two slopes, without its sign."""
    return jnp.maximum(jnp.abs(before), jnp.abs(after))


@bookkeeping
def crossed_sections(
    plan: Plan, code: Any, lane: Lane, values: Values, at_zero: tuple, *, meets: bool
) -> tuple:
    """Which sections this attempt crosses.

    `at_zero`: which are zero at an event. `meets`: whether the attempt may land on a terminal one, or
    jump over it at an event; else it crosses none of those.
    """
    functions, crossed = plan.functions, ()
    full = jnp.where(lane.bracket.tries == 0, lane.h, lane.full)
    for i in range(functions.num_guards, functions.count):
        # One that starts at zero has the sign it goes to.
        sign = functions.sign(i, jnp.where(lane.values[i] == 0, lane.rates[i], lane.values[i]))
        value, value0 = sign * values.value[i], sign * lane.values[i]
        rate, rate0 = sign * values.rate[i], sign * lane.rates[i]
        # Zero counts as crossed at the end of a step and not at its start, so that a crossing exactly
        # at the joint of two steps is counted once.
        beyond = value <= 0
        if at_zero:
            # Right after an event it is crossed if it falls: it may have crossed upwards just before.
            beyond = beyond | (at_zero[i - functions.num_guards] & ((lane.h > 0) | (rate < 0)))
        if functions.acts(i):
            if not meets:
                crossed = (*crossed, jnp.zeros_like(beyond))
                continue
            near = jnp.abs(value) <= -rate * ACCURACY.same * full
            beyond = beyond | (near & (code >= SECTION))
        begins = _locate.begins_inside(value0, rate0, rate) & ((value0 > 0) | (lane.h > 0))
        crossed = (*crossed, is_accepted(code) & begins & beyond)
    return crossed


@bookkeeping
def accounts(
    plan: Plan, code: Any, lane: Lane, h: Any, t: Any, mode: Any, first: First | None, fired: tuple,
    next_output: Any, h_next: Any, t1: Any, outputs: Any, *, judged: bool,
) -> dict[str, Any]:  # fmt: skip
    """Counters, flags and the result code, by the names of the fields of `Lane`.

    `first` is None where no event function interferes, `judged` if no lane is rejected: what cannot
    have changed then is not there.
    """
    # A lane that has ended waits for the others of its batch: that is not an attempt.
    attempts = lane.attempts + jnp.where(code == HOLD, 0.0, 1.0)
    finished = is_accepted(code) & ~is_event(code) if first is not None else is_accepted(code)
    # After an event at `t1` one more attempt computes the slope in the mode that it led to.
    finished = finished & (t1 - t <= rounding(t, t1))
    if plan.has_outputs:
        finished = finished & (next_output >= outputs.shape[0])
    kept = dict(
        attempts=attempts,
        accepted=lane.accepted + jnp.where(is_accepted(code) & (code != REFRESH), 1.0, 0.0),
    )

    # Later lines take precedence.
    status = jnp.full_like(code, float(RUNNING))
    status = jnp.where(attempts >= plan.max_steps, _STATUS["max_steps_reached"], status)
    guarded = plan.functions.num_guards > 0
    if guarded and first is not None:
        kept |= _of_events(plan, code, lane, h, t, mode, first)
        if plan.max_events is not None:
            status = jnp.where(kept["events"] > plan.max_events, _STATUS["max_events_reached"], status)
    elif guarded:
        kept["zero_events"] = jnp.where(is_accepted(code) & ~_short(h, t), 0.0, lane.zero_events)
    kept["crossings"], status = _crossing_counts(plan, lane.crossings, fired, status)
    if first is not None:
        if guarded:
            # Of bends all may be met in one instant, each of them twice.
            chatters = (
                kept["zero_events"] > ACCURACY.events_at_one_instant + 2 * plan.functions.num_bends
            )
            status = jnp.where(chatters, _STATUS["chattering"], status)
        status = jnp.where(mode < 0, _STATUS["no_admissible_mode"], status)
    if not judged:
        status = _code_of_shortest(plan, code, h_next, t, t1, status)
    status = jnp.where(finished, _STATUS["successful"], status)
    if first is not None:
        for met, section in zip(fired, plan.functions.sections, strict=True):
            if section.terminal:
                status = jnp.where(met, _STATUS["event_occurred"], status)
    return kept | dict(status=jnp.where(code == HOLD, lane.status, status))


def _of_events(plan: Plan, code, lane: Lane, h, t, mode, first: First) -> dict[str, Any]:
    """Counters and flags that only events change."""
    event, moved = is_event(code), moved_on(code)
    fires = event & ~plan.functions.is_silent(first.index) if plan.functions.num_silent else event
    kept = dict(
        fresh=jnp.where(event, 0.0, jnp.where(moved, 1.0, lane.fresh)),
        events=lane.events + jnp.where(fires, 1.0, 0.0),
    )
    # Counted as chattering only without time in between: two events at one instant are common, and
    # sixteen are a sequence of transitions that sends the lane round in circles, or a Zeno point.
    short = _short(h, t)
    zero_events = jnp.where(event & short, lane.zero_events + 1.0, lane.zero_events)
    zero_events = jnp.where((event | (code == PLAIN)) & ~short, 0.0, zero_events)
    # The slope of a crossing that is only just one is not known: it is the root of its depth.
    bend = jnp.abs(first.rate - first.rate_start)
    shallow = (lane.h > 0) & (first.rate**2 * lane.h < 2.0 * bend * plan.touching)
    grazes = (code == COLLAPSED) | ((code == EVENT) & shallow)
    marks, coincides, violated = first.marks, first.close > 1, code == VIOLATED
    mine = of_guard(first.index)
    if plan.functions.num_bends:
        # Where a force does not jump a motion may graze its bend, or meet it with anything else, and
        # has a derivative all the same, if the force has a slope there; but where it rests there, it
        # has one on each side.
        bend = plan.functions.is_bend(first.index)
        sudden = first.jumps | first.steep
        touched = ((marks & TOUCHED) != 0) & bend & sudden
        touched = touched | (((marks & RESTED) != 0) & bend & (sudden | first.bends))
        marks = marks & ~(TOUCHED | RESTED)
        marks = jnp.where(touched, (marks & FLAGS) | GRAZING | mine, marks)
        # Up to a border where a force is steep steps are short: they say nothing on the crossing.
        shallow = shallow & event & bend & first.steep
        grazes, violated = (grazes & (fires | first.jumps)) | shallow, violated & fires
        coincides = jnp.where(bend, first.jumps & (first.close > 0), coincides)
    undecided = (code == REFRESH) & _is_undecided(plan, lane, first)
    found = flag(grazes | undecided, GRAZING) | flag(event & coincides, COINCIDENT)
    found = found | flag(violated, EVENT_AT_START) | mine
    # An attempt of length zero compares the guards of two modes.
    found = jnp.where(moved & (code != REFRESH), marks, found)
    flags = flags_with(lane.flags, found, t)
    # A hash of guards and modes in their order: two runs can be compared without their logs.
    # The golden ratio of 2^32 keeps guard and mode apart, however many modes there are.
    mode = mode >> plan.functions.width if plan.functions.width else mode
    symbol = (mode + 1).astype(jnp.uint32) + first.index.astype(jnp.uint32) * jnp.uint32(2654435769)
    if jnp.asarray(mode).dtype == jnp.int64:
        symbol = symbol + (mode >> 31).astype(jnp.uint32) * jnp.uint32(2654435761)
    sequence = jnp.where(fires, lane.sequence * jnp.uint32(1000003) + symbol, lane.sequence)
    return kept | dict(zero_events=zero_events, flags=flags, sequence=sequence)


def _is_undecided(plan: Plan, lane: Lane, first: First):
    """Whether the mode that an event led to begins with a guard that cannot be distinguished from zero.

    A mode that leaves zero has its guard at zero to rounding as it begins. A value above rounding
    and below the error of the state might as well lie below zero, and another mode come next.
    """
    near = (first.value > ACCURACY.slack) & (first.value < ACCURACY.touching * plan.touching)
    near = near & is_guard(plan.functions, first)
    if plan.functions.num_bends:
        near = near & ~plan.functions.is_bend(first.index)
    return (lane.events > 0) & near


def _crossing_counts(plan: Plan, crossings, fired, status):
    """Crossings so far, and the result code where one section has more than there is room for."""
    crossings = tuple(c + jnp.where(f, 1.0, 0.0) for c, f in zip(crossings, fired, strict=True))
    for count, section in zip(crossings, plan.functions.sections, strict=True):
        if not section.terminal:
            full = count > plan.max_crossings
            status = jnp.where(full, _STATUS["max_crossings_reached"], status)
    return crossings, status


def _short(h, t):
    """A Zeno sequence ends in hops that are lost in the rounding of the time."""
    return h <= 4e-16 * jnp.maximum(jnp.abs(t), 1e-300)


def _code_of_shortest(plan: Plan, code, h_next, t, t1, status):
    """Result code where a rejected step cannot be made shorter."""
    if not plan.step_size.adaptive:
        return jnp.where(code == REJECT, _STATUS["nonfinite"], status)
    rule: Any = plan.step_size
    # Below the rounding of the time a shorter step would be the same step again, forever.
    shortest = jnp.maximum(rule.dtmin, rounding(t, t1))
    spent = (code == REJECT) & (h_next <= shortest)
    return jnp.where(spent, _STATUS["dt_min_reached"], status)
