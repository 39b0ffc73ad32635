"""One Runge-Kutta attempt of one lane: accepted, shortened by an event, or by its error estimate."""

from typing import Any

import equinox.internal as eqxi
import jax
import jax.numpy as jnp

from . import _locate
from ._control import books, control, sudden
from ._doubt import doubt, first_below, look_inside
from ._events import Values, divided
from ._first import (
    First,
    decide,
    fired_sections,
    keep_values,
    lowest,
    newton,
    nothing_happens,
)
from ._lane import PLAIN, SHRINK, Lane, Outcome, Plan, is_event, moved_on, without_state
from ._quiet import Step, advance_quietly
from ._status import RUNNING
from ._tolerance import Ends, error_norm, grown, scales
from ._tree import all_finite, select, shift


def attempt(plan: Plan, theta, lane: Lane, t1, outputs) -> tuple[Lane, Outcome]:
    """One attempt of one lane. `theta = (system, args)`; `outputs` are the output times or None.

    The pieces are calls of `boundary`: the fused executor computes each once, and each yields few
    numbers, because the compiler recomputes what several results of one piece share.
    """
    system, args = theta
    functions, once = plan.functions, plan.execute.boundary
    sg = jax.lax.stop_gradient
    t, h = lane.t, sg(lane.h)
    if plan.follows_size:
        lane = lane._replace(size=once(grown, lane.size, sg(lane.y)))

    def field(t, y):
        return system.vector_field(t, y, lane.mode, args)

    y1, dy1, errors = plan.stepper.step(field, t, lane.y, lane.dy, h, plan.execute)
    adaptive = plan.step_size.adaptive
    error = lane.error
    if adaptive:
        rule: Any = plan.step_size
        error = once(
            lambda e, n, s, ends: error_norm(e, scales(rule, plan.atols, n, s, ends)),
            sg(errors), plan.noise, sg(lane.size), sg(Ends(h, lane.y, y1, lane.dy, dy1)),
        )  # fmt: skip
        if plan.watches_jumps:
            peak, flags = once(sudden, without_state(lane), error)
            lane = lane._replace(peak=peak, flags=flags)
    kept = values = Values((), ())
    h_seen, jumps = jnp.zeros_like(h), jnp.zeros_like(h) > 0
    if functions.count:
        values = once(
            lambda t, y, dy, size: functions.evaluate(
                system, t, y, dy, lane.mode, args,
                grown(size, jax.lax.stop_gradient(y)) if functions.learned else None,
            ),
            t + h, y1, dy1, lane.size,
        )  # fmt: skip
        kept = values
        if functions.learned:
            values, kept = once(_rescaled, lane.fresh, sg(lane.scales), values)
    if plan.looks_inside:
        inside = once(
            lambda lane, h, y1, dy1: look_inside(
                functions, system, lane, lane.t, h, y1, dy1, args, lane.scales
            ),
            sg(lane), h, sg(y1), sg(dy1),
        )  # fmt: skip
        h_seen = once(lambda *a: first_below(functions, *a), without_state(lane), sg(inside), h)
        if adaptive:
            doubts, jumps = once(
                lambda *a: doubt(plan, *a), without_state(lane), h, sg(values), sg(inside)
            )
            # Squared, because it falls with the fourth power of the step and the error with the eighth.
            error = jnp.maximum(error, doubts**2)
    step = Step(h, y1, dy1, error, values, kept)
    end = sg((y1, dy1))
    if plan.interrupts:
        first = once(
            lambda lane, values, *a: lowest(plan, lane, values, *a),
            without_state(lane), values, h_seen, jumps,
        )  # fmt: skip
        calm = once(
            lambda lane, h, first, end, e: nothing_happens(plan, lane, h, first, all_finite(end), e),
            without_state(lane), h, sg(first), end, error,
        )  # fmt: skip

        def otherwise(lane, step, t1, outputs):
            return _eventful(plan, theta, lane, step, first, t1, outputs)

    else:

        def otherwise(lane, step, t1, outputs):
            return advance_quietly(plan, lane, step, t1, outputs, judged=False)

        if plan.execute.fused:
            return otherwise(lane, step, t1, outputs)
        # Portable, the branch below keeps the compiler from computing the stages once per result.
        calm = all_finite(end) & (lane.attempts > 0)
        if adaptive:
            calm = calm & (error <= 1.0)
        calm = calm | (lane.status != RUNNING)
    # One branch for the whole batch, so that `vmap` does not make it a selection of both.
    return jax.lax.cond(
        eqxi.unvmap_all(calm),
        lambda *a: advance_quietly(plan, *a, judged=True),
        otherwise,
        lane, step, t1, outputs,
    )  # fmt: skip


def _eventful(
    plan: Plan, theta, lane: Lane, step: Step, first: First, t1, outputs
) -> tuple[Lane, Outcome]:
    system, args = theta
    functions, once = plan.functions, plan.execute.boundary
    sg = jax.lax.stop_gradient
    t, (h, y1, dy1, error, values, kept) = lane.t, step
    adaptive = plan.step_size.adaptive
    code = once(
        lambda lane, h, first, y1, dy1, e: decide(plan, lane, h, first, all_finite((y1, dy1)), e),
        without_state(lane), h, sg(first), sg(y1), sg(dy1), error,
    )  # fmt: skip

    dt, y_jump, mode_jump = jnp.zeros_like(h), lane.y, lane.mode
    if functions.num_guards:
        dt = once(newton, code, first, h)

        def jump(t, y, dy, mode, guard, dt):
            y_new, mode_new = system.transition(t + dt, shift(y, sg(dy), dt), mode, guard, args)
            return y_new, jnp.asarray(mode_new, jnp.int32)

        y_jump, mode_jump = once(jump, t + h, y1, dy1, lane.mode, first.index, dt)

    def advance(code, lane, y1, dy1, y_jump, mode_jump, t_end, dt):
        event, moved = is_event(code), moved_on(code)
        return (
            jnp.where(event | moved, t_end + dt, lane.t),
            select(event, y_jump, select(moved, y1, lane.y)),
            select(moved, dy1, lane.dy),
            jnp.where(event, mode_jump, lane.mode),
        )

    t_new, y_new, dy_new, mode_new = once(advance, code, lane, y1, dy1, y_jump, mode_jump, t + h, dt)
    fired = once(lambda *a: fired_sections(functions, *a), code, without_state(lane), sg(values))
    bracket = once(
        lambda b, code, h, f: _locate.update(
            b, code == SHRINK, h, f.value, f.rate, f.value_start, f.rate_start
        ),
        lane.bracket, code, h, sg(first),
    )  # fmt: skip
    full = once(lambda b, h, full: jnp.where(b.tries == 0, h, full), lane.bracket, h, lane.full)
    h_located = once(_locate.propose, bracket, full, t)

    following = control(
        plan, code, without_state(lane), h, h_located, first.h_dip, error, sg(t_new), sg(y_new),
        sg(dy_new), sg(lane.size), sg(t1), sg(outputs), begins=True,
    )  # fmt: skip
    accounts = once(
        lambda *a: books(plan, *a),
        code, without_state(lane), h, sg(t_new), mode_new, mode_jump, sg(first), fired,
        following.output, following.h, sg(t1), sg(outputs),
    )  # fmt: skip
    new_values, new_rates, new_scales = once(keep_values, code, without_state(lane), sg(kept))
    new = Lane(
        t=t_new, y=y_new, dy=dy_new, mode=mode_new, values=new_values, rates=new_rates,
        scales=new_scales, size=lane.size, peak=lane.peak,
        h=following.h, h_free=following.h_free, next_output=following.output, full=full,
        bracket=bracket,
        error=once(lambda c, e, old: jnp.where(c == PLAIN, e, old), code, error, lane.error)
        if adaptive else lane.error,
        **accounts,
    )  # fmt: skip
    y_before = once(lambda y, dy, dt: shift(y, sg(dy), dt), y1, dy1, dt)
    return new, Outcome(code, first.index, following.landed, fired, y_before, dy1)


def _rescaled(fresh, scales: tuple, values: Values) -> tuple[Values, Values]:
    """Values over the magnitudes at the start of the step, and over those at its end to go on with.

    Inside a step and while an event is located the magnitudes hold still. Those of another mode, which
    a lane has right after an event, are replaced at once.
    """
    used = tuple(jnp.where(fresh == 1.0, s, v) for s, v in zip(scales, values.scale, strict=True))

    def over(scales):
        return Values(divided(values.value, scales), divided(values.rate, scales), values.scale)

    return over(used), over(values.scale)
