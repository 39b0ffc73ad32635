"""Which event function comes first, and what that makes of the attempt."""

import functools
import operator
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient

from . import _locate
from ._locate import Bracket
from ._loop_state import (
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
    knows_slope,
)
from ._step import Step
from .accuracy import ACCURACY
from .event_functions import STALE, EventFunctions, Values
from .executor import bookkeeping, piece
from .status import DISCONTINUOUS, GRAZING, RESTED, RUNNING, TOUCHED, flag, of_guard
from .tree import all_finite


class First(NamedTuple):
    """The lowest of all event functions that act, with the sign in which it crosses downwards."""

    index: Any
    value: Any
    rate: Any
    value_start: Any
    rate_start: Any
    close: Any  # number of guards within rounding of zero at which something jumps
    h_dip: Any  # where a function may have gone, or was seen, through zero and back; else far away
    marks: Any  # flags of a step in which nothing fires: a guard nearly touched, something jumped
    # Of a bend of a force that comes first: whether the force jumps there, or at least its slope does;
    # whether that has no bound there.
    jumps: Any = None
    bends: Any = None
    steep: Any = None


def _no_event(lane: Lane) -> First:
    zero, izero = jnp.zeros_like(lane.h), jnp.zeros_like(lane.mode)
    # Far above zero, so that any function is lower; positive at the start, so that none has crossed.
    return First(
        izero, zero + ACCURACY.far, zero, zero + ACCURACY.far, zero, izero, zero + ACCURACY.far, izero
    )


@piece
def lowest(plan: Plan, lane: Lane, values: Values, h_seen: Any, jumps: Any) -> First:
    """The event function with the lowest scaled value, its sign chosen so that it crosses downwards.

    `h_seen`: where a function was seen beyond zero inside the step (0: nowhere); `jumps`: whether one
    jumps in it.
    """
    functions = plan.functions
    best = _no_event(lane)._replace(marks=flag(jumps, DISCONTINUOUS))
    best = best._replace(h_dip=jnp.where(h_seen > 0, h_seen, best.h_dip))
    brushed = jumps & False  # bends of a force
    touched = best.index - 1  # the last such guard, -1 for none
    free = lane.bracket.tries == 0
    full = jnp.where(free, lane.h, lane.full)
    beside = -ACCURACY.zero * full
    at_start = ~free & (lane.h == 0)
    rounding = -2.0 * ACCURACY.lowest / lane.h
    arrived = jnp.zeros_like(brushed)
    for i in range(functions.count):
        is_guard = i < functions.num_guards
        acts = functions.acts(i)
        if not acts and not plan.detect_dips:
            continue
        if i in functions.scheduled:
            continue  # below, when it is known whether anything else comes before
        side = start_value = lane.values[i]
        # A section or guard that fires both ways and starts at zero has the sign it goes to.
        if not is_guard or functions.directions[i] == "both":
            goes = jnp.where(lane.rates[i] == 0, stop_gradient(values.value[i]), lane.rates[i])
            side = jnp.where(start_value == 0, goes, start_value)
            if is_guard:  # in a new mode it is wherever the transition has taken it
                side = jnp.where(lane.fresh == 1.0, side, stop_gradient(values.value[i]))
        # For sections, both crossings of a short excursion count, from either side.
        sign = functions.sign(i, side) if acts else jnp.sign(side)
        value, value0 = sign * values.value[i], sign * start_value
        rate = stop_gradient(sign * values.rate[i])
        rate0 = sign * lane.rates[i]
        close = best.close
        bend = is_guard and functions.is_bend(i)
        if bend:
            # A margin held by an outcome still moves beyond the border of that alone, which is met
            # first.
            held = (rate == 0) & (rate0 == 0) & (lane.h > 0) & (value0 >= 0)
            value = jnp.where(held & (stop_gradient(value) < 2.0 * STALE), ACCURACY.far, value)
        if plan.detect_dips:
            dips, place = _locate.dip(value0, rate0, stop_gradient(value), rate, lane.h)
            sooner = dips & (place < best.h_dip)
            best = best._replace(h_dip=jnp.where(sooner, place, best.h_dip))
        if not acts:
            continue
        # It turned back above zero, by less than what the tolerance of the state can decide. Of one
        # that begins at zero, as a guard that has just fired, a fall by rounding is not a turn.
        judged = is_guard and i not in functions.continuous
        if judged:
            low = (jnp.minimum(value0, stop_gradient(value)) < plan.touching) & (value0 > 0)
            turned = low & _turns(rate0, rate, rounding)
            if bend:
                brushed = brushed | turned
            else:
                touched = jnp.where(turned, i, touched)
        # One at which nothing jumps has no say in what another does to derivatives, whichever is first.
        if judged and functions.num_guards > 1 and not bend:
            near = jnp.abs(stop_gradient(value)) < rate * beside
            close = close + near.astype(close.dtype)
        if is_guard and functions.count > 1:
            # No other is located beside a guard that rests on zero, or has just fired and is below it
            # by rounding. Of bends, which may have a twin, a hop that is lost in the rounding of the
            # state changes nothing on that.
            rounded = at_start
            if bend:
                near = stop_gradient(value) > -ACCURACY.slack
                rounded = rounded | (~free & near & (lane.bracket.beyond != i))
            value = jnp.where(rounded & (rate >= 0), ACCURACY.far, value)
        if i in functions.continuous and functions.count > 1:
            idle = _stays(plan, value, rate) & (lane.bracket.beyond != i)
            value = jnp.where(idle, ACCURACY.far, value)
        found = best._replace(
            index=i, value=value, rate=rate, value_start=value0, rate_start=rate0, close=close
        )
        if i == 0 and is_guard:
            best = found._replace(index=best.index)
            continue
        # Values are scaled by the magnitudes of the guards, which makes them comparable. Of two that
        # are below zero the lower one was, as a rule, crossed first; if not, the other is met next.
        lower = stop_gradient(value) < stop_gradient(best.value)
        if not is_guard:
            lower = lower & _locate.begins_inside(value0, rate0, rate)
        chosen = [jnp.where(lower, new, old) for new, old in zip(found[:5], best[:5], strict=True)]
        best = best._replace(close=close, **dict(zip(First._fields, chosen, strict=False)))
    if not functions.num_guards:
        return best
    for i in functions.scheduled:
        value, rate = values.value[i], stop_gradient(values.rate[i])
        arrives = stop_gradient(value) <= -rate * _same_time(lane)
        first = arrives & ~arrived & ~(stop_gradient(best.value) < -ACCURACY.slack)
        chosen = (jnp.full_like(best.index, i), value, rate, lane.values[i], lane.rates[i])
        chosen = [jnp.where(first, new, old) for new, old in zip(chosen, best[:5], strict=True)]
        best = best._replace(**dict(zip(First._fields, chosen, strict=False)))
        arrived = arrived | arrives
    if functions.scheduled:
        best = best._replace(close=best.close + arrived.astype(best.close.dtype))
    # A guard without a value would never fire: the step that ends there is none.
    every = stop_gradient(functools.reduce(operator.add, values.value[: functions.num_guards]))
    best = best._replace(value=jnp.where(jnp.isnan(every), jnp.nan, best.value))
    bend = functions.is_bend(best.index) if functions.num_bends else None
    if functions.count > 1:
        # One that rests on zero is not what another is located beside.
        other = ~free & (lane.bracket.beyond != best.index)
        idle = other & _stays(plan, stop_gradient(best.value), best.rate)
        idle = idle if bend is None else idle & ~bend
        best = best._replace(value=jnp.where(idle, ACCURACY.far, best.value))
    rests = _rests_at_zero(plan, lane, best)
    marks = best.marks
    if bend is not None:
        marks = marks | flag(brushed, TOUCHED) | flag(rests & bend, RESTED)
        rests = rests & ~bend
    touched = jnp.where(rests, best.index, touched)
    return best._replace(marks=marks | flag(touched >= 0, GRAZING) | of_guard(touched))


def _same_time(lane: Lane) -> Any:
    """Difference of two times that are one by rounding [s]."""
    return ACCURACY.rounding * (jnp.abs(lane.t) + lane.h)


def _turns(rate0: Any, rate: Any, rounding: Any) -> Any:
    """Whether a function is at its lowest inside the step or at its end, by its slopes at the ends.

    A parabola with these slopes falls by `h rate^2 / 2 (rate - rate0)` from an end to its lowest point.
    A guard that has just fired and leaves zero without a slope may fall by rounding: it does not turn.
    `rounding`: of twice the fall, by the length of the step.
    """
    # By the signs of the slopes, so that what falls is negative. It turns if the bend is positive.
    least = rounding * (rate - rate0)
    return (rate * jnp.abs(rate) >= least) & (rate0 * jnp.abs(rate0) < ACCURACY.was_lowest * least)


def _rests_at_zero(plan: Plan, lane: Lane, first: First) -> Any:
    """Whether the lowest guard cannot be distinguished from zero, and its slopes keep it there."""
    value = stop_gradient(first.value)
    slope = jnp.maximum(jnp.abs(first.rate), jnp.abs(first.rate_start))
    leads_nowhere = slope * plan.resolution <= ACCURACY.resolution * jnp.maximum(value, ACCURACY.slack)
    low = jnp.maximum(value, stop_gradient(first.value_start)) < plan.touching
    rests = leads_nowhere & ~_leaves(value, first.rate, lane.h)
    for i in plan.functions.continuous:
        rests = rests & (first.index != i)
    return low & rests & (lane.h > 0) & is_guard(plan.functions, first)


def _stays(plan: Plan, value: Any, rate: Any) -> Any:
    """Whether a function would not be violated within a whole run at this slope."""
    # `plan.resolution` is a known part of the run.
    return jnp.abs(rate) * plan.resolution <= ACCURACY.resolution * (value + ACCURACY.slack)


def _leaves(value: Any, rate: Any, h: Any) -> Any:
    """Whether a function has just left zero, be it without a slope.

    It then has one of at least twice its value in the time that it took.
    """
    return (value > 0) & (rate * h > 1.5 * value)


def is_guard(functions: EventFunctions, first: First):
    """Whether the lowest event function is a guard."""
    n = functions.num_guards
    if n == 0:
        return first.index < 0
    if n == functions.count:
        return first.index >= 0
    return first.index < n


@bookkeeping
def decide(plan: Plan, lane: Lane, step: Step, first: First | None) -> Any:
    """Code of the attempt; later lines take precedence. `first` is None without event functions."""
    # The first attempt in a mode has length zero and computes the slope.
    fresh = knows_slope(plan, lane)
    code = jnp.where(fresh, PLAIN, REFRESH)
    if first is not None:
        code = _what_fires(plan, lane, step.h, first, fresh, code)
    # A step into a pole is tried again shorter, where steps adapt, until its length ends the lane.
    bad = ~all_finite((step.y1, step.dy1))
    if first is not None and plan.functions.num_guards:
        bad = bad | jnp.isnan(first.value)
    if plan.step_size.adaptive:
        largest: Any = 1.0
        if first is not None and plan.functions.roots:
            # The slope of `max(d, 0)**1.5`, by which derivatives move, is a root of `d`: up to its zero
            # a step has fewer digits of them than of the state, and so has one that ends just before,
            # beside its length. A rejected one ends before it.
            rule: Any = plan.step_size
            beside = (code == PLAIN) & (first.value < -0.25 * first.rate * step.h)
            at_bend = ((code == EVENT) | beside) & plan.functions.is_bend(first.index)
            largest = jnp.where(at_bend, rule.rtol**0.5, largest)
        inaccurate = ~(step.error <= largest)
        # Inside a bracket the steps are parts of one whose error was accepted; the first attempt in a
        # mode, of length zero, still has the slope of the mode before. But that error has not seen what
        # bends at the event alone, as a friction law does at rest: the step that ends there has.
        if first is not None:
            ends = (lane.bracket.tries == 0) | ((code >= SECTION) & (code < COLLAPSED))
            inaccurate = inaccurate & ends & fresh
        bad = bad | inaccurate
    code = jnp.where(bad, REJECT, code)
    return jnp.where(lane.status == RUNNING, code, HOLD)


def _what_fires(plan: Plan, lane: Lane, h: Any, first: First, fresh: Any, code: Any) -> Any:
    if not plan.locates:
        return jnp.where(fresh & (first.h_dip < ACCURACY.far), DIP, code)
    functions, b = plan.functions, lane.bracket
    free = b.tries == 0
    guards = is_guard(functions, first)
    rate = first.rate
    tolerance = jnp.where(guards, ACCURACY.solved, ACCURACY.same)
    full = jnp.where(free, h, lane.full)
    # A short step late in a run cannot be divided further than the time can be told. The correction
    # must be small against the step that led here too: a hop may be tiny.
    fine = jnp.maximum(tolerance * full, ACCURACY.rounding * jnp.abs(lane.t))
    # But what is within the rounding of the time is near: a step may have ended on the very zero, at a
    # time asked for, and the next one begins there.
    least = jnp.maximum(ACCURACY.reach * h, ACCURACY.rounding * jnp.abs(lane.t))
    reach = jnp.where(h == 0, tolerance * full, jnp.minimum(fine, least))
    near = jnp.abs(first.value) <= -rate * reach
    if functions.num_guards:
        # Where a guard is flat it is not near: a load that was 0 for a while begins after that. A
        # margin that an outcome holds at zero is flat and is there.
        flat = guards & (rate == 0.0)
        near = near & ~(flat & ~functions.is_bend(first.index) if functions.num_bends else flat)
    # Guards at rest lie at zero to rounding; only what is clearly beyond fires.
    hit = first.value < jnp.where(guards, -ACCURACY.slack, 1e-300)
    # A jump through zero ends on its far side, where the new mode is what it will be.
    collapsed = _locate.is_collapsed(b, lane.t, full) & (first.value < 0)
    arrives = functions.is_scheduled(first.index) & (first.value < ACCURACY.far)
    shrink = fresh & (hit | ~free)
    # An attempt inside a bracket is never accepted for being on the near side of the zero: it goes on
    # until it is near enough for the Newton correction, or the bracket has no width left.
    code = jnp.where(shrink, SHRINK, code)
    # A step may end on a guard that is below zero by rounding only, as at a time asked for: its zero
    # lies before the next step, and its bracket collapses, however steep it is. So it does in a step so
    # short that the rounding of the guard is longer than that of the time.
    landed = jnp.where(_falls_clearly(plan, lane, first), EVENT, COLLAPSED)
    code = jnp.where(shrink & collapsed & ~free, jnp.where(guards, landed, SECTION), code)
    code = jnp.where(shrink & near, jnp.where(guards, EVENT, SECTION), code)
    code = jnp.where(fresh & arrives, EVENT, code)
    # A dip of one function may lie before the crossing of another: it is looked at first. And the zero
    # that was located may be the last of several.
    code = jnp.where(fresh & (first.h_dip < ACCURACY.far) & (free | near), DIP, code)
    return jnp.where(~fresh & hit & guards & ~arrives, VIOLATED, code)


def _falls_clearly(plan: Plan, lane: Lane, first: First):
    """Whether the guard falls at one slope over the whole of a short step, does not jump, and falls
    over the step that was asked by more than the tolerance of the state can decide.

    Steps up to a bend of a force may be shorter than that, and say nothing on it.
    """
    steady = (first.rate < 0) & (jnp.abs(first.rate - first.rate_start) < -0.5 * first.rate)
    off = jnp.abs(first.value - first.value_start - first.rate * lane.h)
    steep = -first.rate * lane.full > plan.touching
    if plan.functions.num_bends:
        steep = steep | plan.functions.is_bend(first.index)
    return steady & steep & (off < ACCURACY.slack - 0.5 * first.rate * lane.h)


def search_bracket(plan: Plan, lane: Lane, code: Any, h: Any, first: First) -> tuple[Bracket, Any, Any]:
    """Bracket around the event after the attempt, length of the one that opened it, where to look."""
    bracket = _bracket(plan, lane.bracket, code, h, first)
    full = _full(plan, lane.bracket, h, lane.full)
    return bracket, full, _propose_length(plan, bracket, full, lane.t)


@bookkeeping
def _bracket(plan: Plan, bracket: Bracket, code, h, first: First) -> Bracket:
    return _locate.update(
        bracket, code == SHRINK, h, first.value, first.rate, first.value_start, first.rate_start,
        first.index,
    )  # fmt: skip


@bookkeeping
def _full(plan: Plan, bracket: Bracket, h, full):
    return jnp.where(bracket.tries == 0, h, full)


@bookkeeping
def _propose_length(plan: Plan, bracket: Bracket, full, t):
    return _locate.propose(bracket, full, t)
