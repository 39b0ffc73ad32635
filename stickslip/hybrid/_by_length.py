"""How the end of a step that leads to an event moves with the length of the step.

Where a field has no bounded slope at the border that it is led to, as `sqrt(d)` at d = 0, the last
stages may lie beside the border by rounding, where the slope is 1e8. So large are then the derivatives
of the end of a step of fixed length, and those by its length. The state at the event, where the guard
is zero, has those of neither: they cancel if both are those of the step as it was computed. In any
other field the end moves by the slope there, to the error of the step.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._loop_state import Plan


def by_length(plan: Plan, problem: PyTree, start: Any, dy: PyTree, h: Any) -> PyTree | None:
    """Slope of the end of a step by its length; None where that is the slope of the motion.

    `start` has time, state and mode (`t`, `y`, `mode`); `dy`: the slope there.
    """
    if not plan.functions.roots:
        return None
    (system, args), t, y, dy = jax.lax.stop_gradient((problem, start.t, start.y, dy))

    def field(t, y):
        return system.vector_field(t, y, start.mode, args)

    def end(h):
        return plan.stepper.step(field, t, y, dy, h, plan.execute.for_the_ends())[0]

    h = jax.lax.stop_gradient(h)
    return jax.lax.stop_gradient(jax.jvp(end, (h,), (jnp.ones_like(h),))[1])


def stretch(
    plan: Plan, problem: PyTree, mode: Any, guard: Any, t: Any, y: PyTree, slopes: tuple
) -> Any:
    """Rate of a guard by the length of a step, over that along the motion: `slopes` of its end."""
    (system, args), t, y, slopes = jax.lax.stop_gradient((problem, t, y, slopes))

    def value(t, y):
        values = system.guards(t, y, mode, args)
        found = values[0]
        for i in range(1, plan.functions.num_guards):
            found = jnp.where(guard == i, values[i], found)
        return found

    return ratio_of(*(jax.jvp(value, (t, y), (jnp.ones_like(t), s))[1] for s in slopes))


def ratio_of(by_length: Any, rate: Any) -> Any:
    """Rate by the length of a step over that along the motion; 1 where there is none."""
    ratio = jax.lax.stop_gradient(by_length / jnp.where(rate == 0.0, 1.0, rate))
    return jnp.where(jnp.isfinite(ratio) & (ratio != 0.0), ratio, 1.0)
