"""An attempt that no event function shortens: accepted, or rejected by its error estimate."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._control import control, quiet_books
from ._events import Values
from ._first import crossed_sections
from ._lane import HOLD, PLAIN, REFRESH, REJECT, Lane, Outcome, Plan, accepted, without_state
from ._status import RUNNING
from ._tree import all_finite, select


class Step(NamedTuple):
    """A Runge-Kutta step that is not yet accepted, and the event functions at its end."""

    h: Any
    y1: PyTree
    dy1: PyTree
    error: Any  # scaled error of the state, or the doubt about an event function where it is larger
    values: Values
    kept: Values  # the same by the magnitudes of the guards at the end


def advance_quietly(
    plan: Plan, lane: Lane, step: Step, t1, outputs, judged: bool
) -> tuple[Lane, Outcome]:
    """The lane after an attempt without event.

    `judged`: each lane of the batch is known to be accepted or to have ended. Each piece is one pass
    over the batch, so what no later attempt reads is not kept up to date.
    """
    once, sg = plan.execute.boundary, jax.lax.stop_gradient
    h, adaptive = step.h, plan.step_size.adaptive

    def judge(status, attempts, end, error):
        code = PLAIN
        if not judged:
            good = all_finite(end)
            if adaptive:
                good = good & (error <= 1.0)
            # The first attempt has length zero and computes the slope.
            code = jnp.where(good, jnp.where(attempts == 0, REFRESH, PLAIN), REJECT)
        return jnp.where(status == RUNNING, code, HOLD)

    end = sg((step.y1, step.dy1))
    code = once(judge, lane.status, lane.attempts, end, step.error)

    def advance(code, old, new):
        return select(accepted(code), new, old)

    t, y = once(advance, code, (lane.t, lane.y), (lane.t + h, step.y1))
    new = (step.dy1, sg(step.kept))
    if adaptive and not judged:  # a rejected lane tries again from the same slope
        old = (lane.dy, Values(lane.values, lane.rates, lane.scales))
        new = once(advance, code, old, new)
    dy, (values, rates, scales) = new
    bare = without_state(lane)
    following = control(
        plan, code, bare, h, h, h, step.error, sg(t), sg(y), sg(dy), sg(lane.size), sg(t1), sg(outputs),
        begins=not judged,
    )  # fmt: skip
    accounts = once(
        lambda *a: quiet_books(plan, *a),
        code, bare, h, sg(t), sg(step.values), following.output, following.h, sg(t1),
        sg(outputs),
    )  # fmt: skip
    if adaptive:
        accounts["error"] = once(
            lambda c, e, old: jnp.where(c == PLAIN, e, old), code, step.error, lane.error
        )
    if plan.interrupts:
        accounts["full"] = h
    after = lane._replace(
        t=t, y=y, dy=dy, values=values, rates=rates, scales=scales, h=following.h,
        h_free=following.h_free, next_output=following.output, **accounts,
    )  # fmt: skip
    guard = jnp.zeros_like(lane.mode)
    fired = crossed_sections(plan.functions, code, bare, sg(step.values))
    return after, Outcome(code, guard, following.landed, fired, step.y1, step.dy1)
