"""One Runge-Kutta attempt of one lane: accepted, shortened by an event, or by its error estimate."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from . import _locate
from ._events import FAR, SLACK, EventFunctions, Values
from ._execute import Executor
from ._locate import Bracket
from ._progress import ProgressMeter
from ._status import CODE, COINCIDENT, EVENT_AT_START, GRAZING, RUNNING
from ._step_size import AbstractStepSize
from ._stepper import AbstractStepper, error_norm
from ._tree import all_finite, select, shift

MAX_ZERO_LENGTH = 16  # events without time passing before the lane is called chattering
COINCIDENCE = 1e-9  # fraction of a full step within which two guards fire "at the same instant"
GRAZING_RATIO = 1e-6  # slope at the event over the change of slope within the step

# What became of an attempt. The decision is one number, computed once; everything else selects on it.
HOLD = 0  # the lane had ended
PLAIN = 1  # accepted, no event
REFRESH = 2  # accepted, of length zero: slope and event functions in the new mode
SECTION = 3  # accepted, ends on a section
EVENT = 4  # accepted, ends on a guard
COLLAPSED = 5  # accepted, ends on a guard that has no slope there
VIOLATED = 6  # a guard was violated before the first step of the mode
SHRINK = 7  # an event function changed sign: try shorter
DIP = 8  # an event function may have gone through zero and back: look there
REJECT = 9  # error estimate too large


class Lane(NamedTuple):
    """Everything one lane carries from attempt to attempt; scalars but for arrays in the state."""

    t: Any
    y: PyTree
    dy: PyTree  # slope at (t, y, mode); stale right after an event, until an attempt of length zero
    mode: Any
    fresh: Any  # whether `dy` and `values` belong to the present mode
    values: tuple  # event functions at (t, y); 0 for a section that has just fired
    rates: tuple
    h: Any  # length of the next attempt
    h_free: Any  # what the step-size rule alone would take
    error: Any  # last accepted scaled error
    bracket: Bracket
    full: Any  # length of the attempt that opened the bracket
    next_output: Any
    t_event: Any
    zero_events: Any
    status: Any
    flags: Any
    sequence: Any  # hash of the events so far: equal hashes mean equal mode sequences
    attempts: Any
    accepted: Any
    events: Any
    crossings: tuple  # per section


class Outcome(NamedTuple):
    """What one attempt did, for the recorder and for the reverse sweep."""

    code: Any
    guard: Any
    landed: Any  # on an output time
    fired: tuple  # per section
    y_before: PyTree  # at the event, before the transition; else the end of the attempt
    dy: PyTree


class Plan(eqx.Module):
    """Static choices of a run, and its numbers that are not differentiated."""

    stepper: AbstractStepper
    step_size: AbstractStepSize
    functions: EventFunctions
    execute: Executor
    max_events: int | None = eqx.field(static=True)
    max_crossings: int = eqx.field(static=True)
    max_steps: int = eqx.field(static=True)
    has_outputs: bool = eqx.field(static=True)
    detect_dips: bool = eqx.field(static=True)
    progress: ProgressMeter | None = None


def is_event(code: Any) -> Any:
    """Whether the attempt ended in a transition."""
    return (code >= EVENT) & (code <= VIOLATED)


def moved_on(code: Any) -> Any:
    """Whether the attempt was accepted without a transition."""
    return (code >= PLAIN) & (code <= SECTION)


def start(plan: Plan, t0, y0, dy_like, mode0) -> Lane:
    """Lane at `t0`, before its first attempt, which has length zero and computes the slope."""
    zero = jnp.zeros_like(t0)
    izero = jnp.zeros(jnp.shape(t0), jnp.int32)
    n = plan.functions.count
    status = jnp.where(mode0 < 0, CODE["no_admissible_mode"], RUNNING).astype(jnp.int32)
    return Lane(
        t=t0,
        y=y0,
        dy=jax.tree.map(jnp.zeros_like, dy_like),
        mode=mode0,
        fresh=izero,
        values=(zero,) * n,
        rates=tuple(zero if exact else None for exact in plan.functions.exact_rate),
        h=zero,
        h_free=zero,
        error=zero + 1.0,
        bracket=_locate.empty(zero),
        full=zero,
        next_output=izero,
        t_event=zero - jnp.inf,
        zero_events=izero,
        status=status,
        flags=izero,
        sequence=izero.astype(jnp.uint32),
        attempts=izero,
        accepted=izero,
        events=izero,
        crossings=(izero,) * len(plan.functions.sections),
    )


def attempt(plan: Plan, theta, lane: Lane, t1, outputs) -> tuple[Lane, Outcome]:
    """One attempt of one lane. `theta = (system, args)`; `outputs` are the output times or None.

    The pieces are calls of `boundary`: the fused executor computes each once, and each yields few
    numbers, because the compiler recomputes what several results of one piece share.
    """
    system, args = theta
    functions, once = plan.functions, plan.execute.boundary
    sg = jax.lax.stop_gradient
    t, h = lane.t, sg(lane.h)

    def field(t, y):
        return system.vector_field(t, y, lane.mode, args)

    y1, dy1, errors = plan.stepper.step(field, t, lane.y, lane.dy, h, plan.execute)
    adaptive = plan.step_size.adaptive
    error = lane.error
    if adaptive:
        rule: Any = plan.step_size
        error = once(
            lambda e, y0, y1: error_norm(e, y0, y1, rule.rtol, rule.atol),
            sg(errors), sg(lane.y), sg(y1),
        )  # fmt: skip
    if functions.count:
        values = once(
            lambda t, y, dy: functions.evaluate(system, t, y, dy, lane.mode, args), t + h, y1, dy1
        )
        first = once(lambda lane, values: _lowest(plan, lane, values), _without_state(lane), values)
    else:
        values, first = Values((), ()), _nothing(lane)
    code = once(
        lambda lane, h, first, y1, dy1, error: _decide(plan, lane, h, first, all_finite((y1, dy1)), error),
        _without_state(lane), h, sg(first), sg(y1), sg(dy1), error,
    )  # fmt: skip

    t_end, y_before, y_jump, mode_jump = t + h, y1, lane.y, lane.mode
    if functions.num_guards:
        t_end, y_before = once(_newton, code, first, t + h, h, y1, dy1)

        def jump(t, y, mode, guard):
            y_new, mode_new = system.transition(t, y, mode, guard, args)
            return y_new, jnp.asarray(mode_new, jnp.int32)

        y_jump, mode_jump = once(jump, t_end, y_before, lane.mode, first.index)

    def advance(code, lane, y1, dy1, y_jump, mode_jump, t_end):
        event, moved = is_event(code), moved_on(code)
        return (
            jnp.where(event | moved, t_end, lane.t),
            select(event, y_jump, select(moved, y1, lane.y)),
            select(moved, dy1, lane.dy),
            jnp.where(event, mode_jump, lane.mode),
        )

    t_new, y_new, dy_new, mode_new = once(advance, code, lane, y1, dy1, y_jump, mode_jump, t_end)
    fired = once(lambda *a: _fired(functions, *a), code, _without_state(lane), sg(values))
    bracket, full = lane.bracket, lane.full
    h_located = h
    if functions.count:
        bracket = once(
            lambda b, code, h, f: _locate.update(
                b, code == SHRINK, h, f.value, f.rate, f.value_start, f.rate_start
            ),
            lane.bracket, code, h, sg(first),
        )  # fmt: skip
        full = once(lambda b, h, full: jnp.where(b.tries == 0, h, full), lane.bracket, h, lane.full)
        h_located = once(_locate.propose, bracket, full)

    control = once(
        lambda *a: _control(plan, *a),
        code, _without_state(lane), h, h_located, first.h_dip, error, sg(t_new), sg(y_new), sg(dy_new),
        sg(t1), sg(outputs),
    )  # fmt: skip
    h_next, h_free, next_output, landed, finished, exhausted = control
    books = once(
        lambda *a: _books(plan, *a),
        code, _without_state(lane), sg(t_new), mode_new, mode_jump, sg(first), fired, finished, exhausted,
    )  # fmt: skip
    new_values, new_rates = once(lambda *a: _keep(functions, *a), code, lane, sg(values), fired)
    new = Lane(
        t=t_new, y=y_new, dy=dy_new, mode=mode_new, values=new_values, rates=new_rates,
        h=h_next, h_free=h_free, bracket=bracket, full=full, next_output=next_output,
        error=once(lambda c, e, old: jnp.where(c == PLAIN, e, old), code, error, lane.error)
        if adaptive else lane.error,
        **books,
    )  # fmt: skip
    return new, Outcome(code, first.index, landed, fired, y_before, dy1)


def _without_state(lane: Lane) -> Lane:
    """The lane's bookkeeping alone, free of derivatives."""
    bare = lane._replace(y=None, dy=None)
    return jax.tree.map(jax.lax.stop_gradient, bare)


class _First(NamedTuple):
    """The lowest of all event functions that can fire, turned so that its crossing is a fall."""

    index: Any
    value: Any
    rate: Any  # 0 where no exact rate is known
    value_start: Any
    rate_start: Any
    exact: Any  # whether the rate is known exactly
    close: Any  # number of guards within rounding of zero
    h_dip: Any  # where a function may have gone through zero and back; 0 if none


def _nothing(lane: Lane) -> _First:
    zero, izero = jnp.zeros_like(lane.h), jnp.zeros_like(lane.mode)
    return _First(izero, zero + FAR, zero, zero + FAR, zero, izero, izero, zero)


def _lowest(plan: Plan, lane: Lane, values: Values) -> _First:
    functions, sg = plan.functions, jax.lax.stop_gradient
    best = _nothing(lane)
    full = jnp.where(lane.bracket.tries == 0, lane.h, lane.full)
    for i in range(functions.count):
        is_guard, known = i < functions.num_guards, values.rate[i] is not None
        start_value = lane.values[i]
        if is_guard and functions.directions[i] == "both":
            start_value = jnp.where(start_value == 0, sg(values.value[i]), start_value)
        sign = functions.sign(i, start_value)
        value, value0 = sign * values.value[i], sign * start_value
        rate = sg(sign * values.rate[i]) if known else jnp.zeros_like(lane.h)
        rate0 = sign * lane.rates[i] if known else jnp.zeros_like(lane.h)
        lower = sg(value) < sg(best.value)
        if not is_guard:
            lower = lower & (value0 > 0)
        h_dip, close = best.h_dip, best.close
        if known and plan.detect_dips:
            dips, place = _locate.dip(value0, rate0, sg(value), rate, lane.h)
            h_dip = jnp.where(dips & ((h_dip == 0) | (place < h_dip)), place, h_dip)
        if is_guard and functions.num_guards > 1:
            near = jnp.abs(sg(value)) <= -rate * COINCIDENCE * full
            close = close + jnp.where(near, 1, 0)
        best = _First(
            index=jnp.where(lower, i, best.index),
            value=jnp.where(lower, value, best.value),
            rate=jnp.where(lower, rate, best.rate),
            value_start=jnp.where(lower, value0, best.value_start),
            rate_start=jnp.where(lower, rate0, best.rate_start),
            exact=jnp.where(lower, int(known), best.exact),
            close=close,
            h_dip=h_dip,
        )
    return best


def _decide(plan: Plan, lane: Lane, h, first: _First, finite, error):
    """Code of the attempt; later lines take precedence."""
    functions = plan.functions
    free, fresh = lane.bracket.tries == 0, lane.fresh == 1
    code = jnp.where(fresh, PLAIN, REFRESH)
    if functions.count:
        n, b = functions.num_guards, lane.bracket
        if n == 0:
            is_guard = jnp.zeros_like(fresh)
        elif n == functions.count:
            is_guard = jnp.ones_like(fresh)
        else:
            is_guard = first.index < n
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
        reach = jnp.where(h == 0, tolerance * full, jnp.minimum(tolerance * full, 1e-3 * h))
        near = jnp.abs(first.value) <= -rate * reach
        hit = first.value < jnp.where(is_guard, -SLACK, 1e-300)
        collapsed = b.high - b.low <= 4e-16 * jnp.maximum(jnp.abs(lane.t), b.high)
        shrink = fresh & (hit | ~free)
        code = jnp.where(fresh & (first.h_dip > 0) & free, DIP, code)
        code = jnp.where(shrink, SHRINK, code)
        code = jnp.where(shrink & collapsed & ~free, jnp.where(is_guard, COLLAPSED, SECTION), code)
        code = jnp.where(shrink & near, jnp.where(is_guard, EVENT, SECTION), code)
        code = jnp.where(~fresh & hit & is_guard, VIOLATED, code)
    bad = ~finite
    if plan.step_size.adaptive:
        bad = bad | ((error > 1.0) & free & fresh)
    code = jnp.where(bad, REJECT, code)
    return jnp.where(lane.status == RUNNING, code, HOLD).astype(jnp.int32)


def _newton(code, first: _First, t, h, y, dy):
    """Newton correction at the event: `dt = -g/(dg/dt)`.

    Its value removes what is left of the location error; its derivative is that of the event time,
    and the derivative of the corrected state is the saltation formula's first half.
    """
    sg = jax.lax.stop_gradient
    usable = code == EVENT
    dt = jnp.where(usable, -first.value / jnp.where(usable, sg(first.rate), 1.0), 0.0)
    dt = dt + sg(jnp.maximum(-h - dt, 0.0))  # time does not run back, not even by rounding
    return t + dt, shift(y, sg(dy), dt)


def _fired(functions: EventFunctions, code, lane: Lane, values: Values):
    """Which sections this attempt crosses, landing on them or jumping over them at an event."""
    fired = ()
    full = jnp.where(lane.bracket.tries == 0, lane.h, lane.full)
    for i in range(functions.num_guards, functions.count):
        sign = functions.sign(i, lane.values[i])
        value, value0 = sign * values.value[i], sign * lane.values[i]
        rate = values.rate[i]
        if rate is None:
            slope = (value - value0) / jnp.where(lane.h > 0, lane.h, 1.0)
        else:
            slope = sign * rate
        near = jnp.abs(value) <= -slope * _locate.TOLERANCE_SECTION * full
        crossed = (value <= 0) | (near & (code >= SECTION))
        fired = (*fired, (moved_on(code) | is_event(code)) & (value0 > 0) & crossed)
    return fired


def _target(plan: Plan, next_output, t1, outputs):
    """Time the lane must land on next, and whether that is the end rather than an output time."""
    if not plan.has_outputs:
        return t1, jnp.ones_like(next_output) > 0
    n = outputs.shape[0]
    is_last = next_output >= n
    return jnp.where(is_last, t1, outputs[jnp.minimum(next_output, n - 1)]), is_last


def _control(plan: Plan, code, lane: Lane, h, h_located, h_dip, error, t, y, dy, t1, outputs):
    """Next step length, and whether the lane has arrived."""
    rule: Any = plan.step_size
    tiny = 4e-16 * jnp.maximum(jnp.abs(t), jnp.abs(t1))
    moved = moved_on(code)
    target, is_last = _target(plan, lane.next_output, t1, outputs)
    landed = (code == PLAIN) | (code == REFRESH)
    landed = landed & (target - t <= tiny) & ~is_last
    next_output = lane.next_output + jnp.where(landed, 1, 0)
    finished = moved & (t1 - t <= tiny)
    if plan.has_outputs:
        finished = finished & (next_output >= outputs.shape[0])
        target, _ = _target(plan, next_output, t1, outputs)
    h_rejected, exhausted = h, jnp.zeros_like(landed)
    if rule.adaptive:
        order = plan.stepper.order()
        safe = jnp.where(error < 1e10, error, 1e10)
        grown = h * rule.factor(safe, lane.error, order)
        grown = jnp.where(landed | (lane.bracket.tries != 0), jnp.maximum(grown, lane.h_free), grown)
        first = jnp.where(lane.h_free == 0, rule.initial(y, dy), lane.h_free)
        h_rejected = h * jnp.minimum(rule.factor(safe, 1.0, order), 0.9)
        h_free = jnp.where(code == PLAIN, grown, first)
        h_free = jnp.minimum(jnp.where(code == REJECT, h_rejected, h_free), rule.dtmax)
        exhausted = (code == REJECT) & (h_rejected <= jnp.maximum(rule.dtmin, tiny))
    else:
        h_free = rule.initial(y, dy) + jnp.zeros_like(h)
        exhausted = code == REJECT
    remaining = target - t
    h_next = jnp.where(remaining <= h_free * (1.0 + 1e-9), jnp.maximum(remaining, 0.0), h_free)
    h_next = jnp.where(is_event(code), 0.0, h_next)
    h_next = jnp.where(code == SHRINK, h_located, h_next)
    h_next = jnp.where(code == DIP, h_dip, h_next)
    h_next = jnp.where(code == REJECT, h_rejected, h_next)
    return h_next, h_free, next_output, landed, finished, exhausted


def _books(plan: Plan, code, lane: Lane, t, mode, mode_jump, first: _First, fired, finished, exhausted):
    """Counters, flags and the result code."""
    event = is_event(code)
    one = jnp.where(event, 1, 0)
    # A Zeno sequence ends in intervals that are lost in the rounding of the time.
    short = t - lane.t_event <= 4e-16 * jnp.maximum(jnp.abs(t), 1e-300)
    zero_events = jnp.where(event, jnp.where(short, lane.zero_events + 1, 0), lane.zero_events)
    events = lane.events + one
    attempts = lane.attempts + jnp.where(code == HOLD, 0, 1)
    crossings = tuple(c + jnp.where(f, 1, 0) for c, f in zip(lane.crossings, fired, strict=True))
    flags, sequence = lane.flags, lane.sequence
    if plan.functions.num_guards:
        bend = jnp.abs(first.rate - first.rate_start) * lane.full
        grazes = (lane.h > 0) & (jnp.abs(first.rate) * lane.h < GRAZING_RATIO * bend)
        grazes = (code == COLLAPSED) | ((code == EVENT) & grazes)
        flags = flags | jnp.where(grazes, GRAZING, 0)
        flags = flags | jnp.where(event & (first.close > 1), COINCIDENT, 0)
        flags = flags | jnp.where(code == VIOLATED, EVENT_AT_START, 0)
        letter = (first.index * 64 + mode_jump + 1).astype(jnp.uint32)
        sequence = jnp.where(event, sequence * jnp.uint32(1000003) + letter, sequence)

    status = jnp.full_like(code, RUNNING)
    status = jnp.where(attempts >= plan.max_steps, CODE["max_steps_reached"], status)
    if plan.max_events is not None:
        status = jnp.where(events > plan.max_events, CODE["max_events_reached"], status)
    for count, section in zip(crossings, plan.functions.sections, strict=True):
        if not section.terminal:
            full = count > plan.max_crossings
            status = jnp.where(full, CODE["max_crossings_reached"], status)
    status = jnp.where(zero_events > MAX_ZERO_LENGTH, CODE["chattering"], status)
    status = jnp.where(mode < 0, CODE["no_admissible_mode"], status)
    failure = CODE["dt_min_reached"] if plan.step_size.adaptive else CODE["nonfinite"]
    status = jnp.where(exhausted, failure, status)
    status = jnp.where(finished, CODE["successful"], status)
    for f, section in zip(fired, plan.functions.sections, strict=True):
        if section.terminal:
            status = jnp.where(f, CODE["event_occurred"], status)
    fresh = jnp.where(event, 0, jnp.where(moved_on(code), 1, lane.fresh))
    return dict(
        fresh=fresh,
        t_event=jnp.where(event, t, lane.t_event),
        zero_events=zero_events,
        events=events,
        attempts=attempts,
        accepted=lane.accepted + jnp.where((code == PLAIN) | (code == SECTION) | event, 1, 0),
        crossings=crossings,
        flags=flags,
        sequence=sequence,
        status=jnp.where(code == HOLD, lane.status, status).astype(jnp.int32),
    )


def _keep(functions: EventFunctions, code, lane: Lane, values: Values, fired):
    """Event functions at the start of the next attempt."""
    keep = moved_on(code) | is_event(code)
    kept = [jnp.where(keep, v, old) for v, old in zip(values.value, lane.values, strict=True)]
    for i, f in enumerate(fired, start=functions.num_guards):
        # A section that has just fired must not fire again by rounding. One that fires both ways is
        # on its other side now, however little.
        other_side = 0.0
        if functions.directions[i] == "both":
            other_side = -1e-300 * jnp.sign(lane.values[i])
        kept[i] = jnp.where(f, other_side, kept[i])
    rates = tuple(
        None if r is None else jnp.where(keep, r, old)
        for r, old in zip(values.rate, lane.rates, strict=True)
    )
    return tuple(kept), rates
