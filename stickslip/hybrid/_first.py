"""Which event function comes first, and what that makes of the attempt."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from . import _locate
from ._events import FAR, SLACK, EventFunctions, Values
from ._lane import (
    COLLAPSED,
    DIP,
    EVENT,
    HOLD,
    PLAIN,
    REFRESH,
    REJECT,
    SECTION,
    SHRINK,
    VIOLATED,
    Lane,
    Plan,
    accepted,
)  # fmt: skip
from ._status import DISCONTINUOUS, GRAZING, RUNNING, flag

REACH = 1e-3  # part of the step to an event that the Newton correction may be
COINCIDENCE = 1e-9  # fraction of a full step within which two guards fire "at the same instant"


class First(NamedTuple):
    """The lowest of all event functions that act, turned so that its crossing is a fall."""

    index: Any
    value: Any
    rate: Any  # 0 where no exact rate is known
    value_start: Any
    rate_start: Any
    exact: Any  # 1 if the rate is known exactly; not kept up to date where all are
    close: Any  # number of guards within rounding of zero
    h_dip: Any  # where a function may have gone, or was seen, through zero and back; 0 if none
    marks: Any  # flags of a step in which nothing fires: a guard nearly touched, something jumped


def no_event(lane: Lane) -> First:
    zero, izero = jnp.zeros_like(lane.h), jnp.zeros_like(lane.mode)
    return First(izero, zero + FAR, zero, zero + FAR, zero, izero + 1, izero, zero, izero)


def lowest(plan: Plan, lane: Lane, values: Values, h_seen: Any, jumps: Any) -> First:
    """The event function with the lowest scaled value, its sign chosen so that it crosses downwards.

    `h_seen`: where a function was seen beyond zero inside the step (0: nowhere); `jumps`: whether one
    jumps in it.
    """
    functions, sg = plan.functions, jax.lax.stop_gradient
    best = no_event(lane)._replace(h_dip=h_seen, marks=flag(jumps, DISCONTINUOUS))
    full = jnp.where(lane.bracket.tries == 0, lane.h, lane.full)
    for i in range(functions.count):
        is_guard, known = i < functions.num_guards, values.rate[i] is not None
        acts = functions.acts(i)
        if not acts and not plan.looks_into(i):
            continue
        start_value = lane.values[i]
        if is_guard and functions.directions[i] == "both":
            start_value = jnp.where(start_value == 0, sg(values.value[i]), start_value)
        # Of a section both halves of a short excursion count, whichever side it starts on.
        sign = functions.sign(i, start_value) if acts else jnp.sign(start_value)
        value, value0 = sign * values.value[i], sign * start_value
        rate = sg(sign * values.rate[i]) if known else jnp.zeros_like(lane.h)
        rate0 = sign * lane.rates[i] if known else jnp.zeros_like(lane.h)
        h_dip, close, exact = best.h_dip, best.close, best.exact
        if plan.looks_into(i):
            dips, place = _locate.dip(value0, rate0, sg(value), rate, lane.h)
            h_dip = jnp.where(dips & ((h_dip == 0) | (place < h_dip)), place, h_dip)
        if not acts:
            best = best._replace(h_dip=h_dip)
            continue
        marks = best.marks
        if is_guard:
            touched = (rate0 < 0) & (rate > 0) & (jnp.minimum(value0, sg(value)) < plan.touching)
            marks = marks | flag(touched, GRAZING)
        if is_guard and functions.num_guards > 1:
            near = jnp.abs(sg(value)) <= -rate * COINCIDENCE * full
            close = close + jnp.where(near, 1, 0)
        found = (value, rate, value0, rate0)
        if i == 0 and is_guard:
            best = First(best.index, *found, exact, close, h_dip, marks)
            continue
        lower = sg(value) < sg(best.value)
        if not is_guard:
            lower = lower & (value0 > 0)
        if not all(functions.exact_rate):
            exact = jnp.where(lower, int(known), exact)
        chosen = [jnp.where(lower, new, old) for new, old in zip(found, best[1:5], strict=True)]
        best = First._make([jnp.where(lower, i, best.index), *chosen, exact, close, h_dip, marks])
    return best


def _is_guard(functions: EventFunctions, first: First):
    n = functions.num_guards
    if n == 0:
        return first.index < 0
    if n == functions.count:
        return first.index >= 0
    return first.index < n


def _hit(first: First, is_guard):
    return first.value < jnp.where(is_guard, -SLACK, 1e-300)


def nothing_happens(plan: Plan, lane: Lane, h, first: First, finite, error):
    """Whether `decide` would say `PLAIN` or `HOLD`, at a fraction of its price."""
    hit = _hit(first, _is_guard(plan.functions, first))
    plain = (lane.fresh == 1.0) & (lane.bracket.tries == 0) & ~hit & (first.h_dip <= 0) & finite
    plain = plain & (first.marks == 0)
    if plan.step_size.adaptive:
        plain = plain & (error <= 1.0)
    return plain | (lane.status != RUNNING)


def decide(plan: Plan, lane: Lane, h, first: First, finite, error):
    """Code of the attempt; later lines take precedence."""
    functions = plan.functions
    free, fresh = lane.bracket.tries == 0, lane.fresh == 1.0
    code = jnp.where(fresh, PLAIN, REFRESH)
    if functions.count:
        b, is_guard = lane.bracket, _is_guard(functions, first)
        rate = first.rate
        if not all(functions.exact_rate):
            # Secant through the other end of the bracket where the exact rate is unknown.
            high = (first.value > 0) & ~free
            other_h = jnp.where(free, 0.0, jnp.where(high, b.high, b.low))
            low_value = jnp.where(free, first.value_start, b.value_low)
            other = jnp.where(high, b.value_high, low_value)
            span = h - other_h
            secant = (first.value - other) / jnp.where(span == 0, 1.0, span)
            rate = jnp.where(first.exact == 1, rate, secant)
        tolerance = jnp.where(is_guard, _locate.TOLERANCE, _locate.TOLERANCE_SECTION)
        full = jnp.where(free, h, lane.full)
        # The correction must be small against the step that led here too: a hop may be tiny.
        reach = jnp.where(h == 0, tolerance * full, jnp.minimum(tolerance * full, REACH * h))
        near = jnp.abs(first.value) <= -rate * reach
        hit = _hit(first, is_guard)
        # A jump through zero ends on its far side, where the new mode is what it will be.
        collapsed = _locate.is_collapsed(b, lane.t) & (first.value < 0)
        shrink = fresh & (hit | ~free)
        code = jnp.where(fresh & (first.h_dip > 0) & free, DIP, code)
        code = jnp.where(shrink, SHRINK, code)
        code = jnp.where(shrink & collapsed & ~free, jnp.where(is_guard, COLLAPSED, SECTION), code)
        code = jnp.where(shrink & near, jnp.where(is_guard, EVENT, SECTION), code)
        code = jnp.where(~fresh & hit & is_guard, VIOLATED, code)
    bad = ~finite
    if plan.step_size.adaptive:
        bad = bad | (~(error <= 1.0) & free & fresh)
    code = jnp.where(bad, REJECT, code)
    return jnp.where(lane.status == RUNNING, code, HOLD)


def newton(code, first: First, h):
    """Newton correction of the time of the event: `dt = -g/(dg/dt)`.

    Its value removes what is left of the location error; its derivative is that of the event time,
    and `y + f dt` then carries the first half of the saltation formula.
    """
    sg = jax.lax.stop_gradient
    usable = code == EVENT
    dt = jnp.where(usable, -first.value / jnp.where(usable, sg(first.rate), 1.0), 0.0)
    return dt + sg(jnp.maximum(-h - dt, 0.0))  # time does not run back, not even by rounding


def crossed_sections(functions: EventFunctions, code, lane: Lane, values: Values):
    """Which sections this attempt crosses; of terminal ones none."""
    crossed = ()
    for i in range(functions.num_guards, functions.count):
        sign = functions.sign(i, lane.values[i])
        value, value0 = sign * values.value[i], sign * lane.values[i]
        fires = accepted(code) & (value0 > 0) & (value <= 0)
        crossed = (*crossed, jnp.zeros_like(fires) if functions.acts(i) else fires)
    return crossed


def fired_sections(functions: EventFunctions, code, lane: Lane, values: Values):
    """Which sections this attempt crosses; it lands on terminal ones or jumps over them at an event."""
    fired = ()
    full = jnp.where(lane.bracket.tries == 0, lane.h, lane.full)
    for i, fires in enumerate(
        crossed_sections(functions, code, lane, values), start=functions.num_guards
    ):
        if not functions.acts(i):
            fired = (*fired, fires)
            continue
        sign = functions.sign(i, lane.values[i])
        value, value0 = sign * values.value[i], sign * lane.values[i]
        rate = values.rate[i]
        if rate is None:
            slope = (value - value0) / jnp.where(lane.h > 0, lane.h, 1.0)
        else:
            slope = sign * rate
        near = jnp.abs(value) <= -slope * _locate.TOLERANCE_SECTION * full
        crossed = (value <= 0) | (near & (code >= SECTION))
        fired = (*fired, accepted(code) & (value0 > 0) & crossed)
    return fired


def keep_values(code, lane: Lane, values: Values):
    """Event functions at the start of the next attempt, and the magnitudes behind them."""
    old = Values(lane.values, lane.rates, lane.scales)
    return jax.tree.map(lambda new, old: jnp.where(accepted(code), new, old), values, old)
