"""Ends of steps up to a border where the field has no bounded slope, as `sqrt(d)` at d = 0.

The last stages of such a step lie beside the border by rounding, where the slope is 1e8. So large are
the derivatives of the end of a step of fixed length, and those by its length. The state at the event,
where the guard is zero, has neither: they cancel if both are those of one step as it was computed, and
if that ends before the border by so much that rounding does not change its slopes. In any other field
the end moves by the slope there, to the error of the step.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.lax import stop_gradient
from jaxtyping import PyTree

from ._loop_state import Plan
from .accuracy import ACCURACY
from .event_time import event_delay
from .tree import shift

Look = Callable[[Any, PyTree], tuple[Any, PyTree]]


def length_before(plan: Plan, look: Look, t: Any, y: PyTree, dy: PyTree, h: Any) -> Any:
    """Length of a step that is differentiated, up to the zero of `look` at `h`.

    It ends before that by a millionth, or, of a very short one, by more than the rounding of the
    function: otherwise the slope there would be one of rounding.
    """
    if not plan.functions.roots:
        return h
    t, y, dy = stop_gradient((t, y, dy))
    flat, back = ravel_pytree(y)
    # No two components alike, lest terms that cancel be none.
    terms = back(flat * (1.0 + (np.arange(flat.size) * 0.618) % 1.0))
    _, (size, _) = jax.jvp(look, (t, y), (t, terms))
    _, (rate, _) = jax.jvp(look, (t, y), (jnp.ones_like(t), dy))
    before = ACCURACY.some_roundings * jnp.abs(size / jnp.where(rate == 0.0, jnp.inf, rate))
    return h - stop_gradient(jnp.clip(jnp.nan_to_num(before), ACCURACY.same * h, 0.5 * h))


def leaving_time(plan: Plan, lane: Any) -> Any:
    """How long a motion takes to leave the rounding of a border on which an attempt of length zero
    finds it; 0 in any other attempt.

    At a depth of 1e-27, as a speed has it beside its zero, a root has a slope of 1e13 and rounding has
    as many parts. So the slope of a motion that begins there is the one of so much later.
    """
    first, end = plan.functions.num_guards - plan.functions.num_bends, plan.functions.num_guards
    after = jnp.zeros_like(lane.h)
    for value, rate in zip(lane.values[first:end], lane.rates[first:end], strict=True):
        begins = (lane.h == 0.0) & (jnp.abs(value) <= ACCURACY.some_roundings) & (rate != 0.0)
        rate = jnp.where(begins, jnp.abs(rate), 1.0)
        after = jnp.maximum(after, jnp.where(begins, ACCURACY.some_roundings / rate, 0.0))
    return stop_gradient(after)


def by_length(plan: Plan, problem: PyTree, start: Any, dy: PyTree, h: Any) -> PyTree:
    """Slope of the end of a step by its length, held.

    `start` has time, state and mode (`t`, `y`, `mode`); `dy`: the slope there.
    """
    t, y, dy, h = stop_gradient((start.t, start.y, dy, h))
    problem = jax.tree.map(lambda a: stop_gradient(a) if eqx.is_array(a) else a, problem)

    def end(h):
        return _end(plan, problem, start.mode, t, y, dy, h)

    return stop_gradient(jax.jvp(end, (h,), (jnp.ones_like(h),))[1])


def event_with_slopes(
    plan: Plan, problem: PyTree, start: Any, h: Any, guard: Any, usable: Any, dt: Any, y: PyTree
) -> tuple[Any, PyTree]:
    """Delay `dt` of an event after a step of length `h` and state `y` there, with derivatives."""
    look = guard_and_slope(plan, problem, start.mode, guard)
    h = length_before(plan, look, start.t, start.y, start.dy, stop_gradient(h))
    y1 = _end(plan, problem, start.mode, start.t, start.y, start.dy, h)
    slope = by_length(plan, problem, start, start.dy, h)
    t, moved, _ = moved_to_zero(look, start.t + h, y1, slope, usable)

    def with_slope(a, b):
        return stop_gradient(a) + (b - stop_gradient(b))

    return with_slope(dt, t - start.t), jax.tree.map(with_slope, y, moved)


def guard_and_slope(plan: Plan, problem: PyTree, mode: Any, guard: Any) -> Look:
    """One guard and the slope of the motion, of time and state."""
    system, args = problem

    def look(t, y):
        values = system.guards(t, y, mode, args)
        found = values[0]
        for i in range(1, plan.functions.num_guards):
            found = jnp.where(guard == i, values[i], found)
        return found, system.vector_field(t, y, mode, args)

    return look


def moved_to_zero(
    look: Look, t: Any, y: PyTree, slope: PyTree, usable: Any
) -> tuple[Any, PyTree, PyTree]:
    """Time, state and slope at a zero that is a little after the end of a step, with derivatives.

    `look(t, y)`: the function that is zero there, and the slope of the motion. The end moves by `slope`
    with the length of the step, so that its derivatives are those where the function has the value that
    it has now. From there to the zero it is the motion that goes on, whose derivatives change by parts
    of a million, times how fast they grow.
    """
    (found, _), (rate, _) = jax.jvp(look, (t, y), (jnp.ones_like(t), slope))
    # Right after an event a margin may have no value: its event is there.
    usable = usable & ~jnp.isnan(stop_gradient(found))
    delay = event_delay(found - stop_gradient(found), stop_gradient(rate), usable)
    t, y = t + delay, shift(y, slope, delay)
    dy = look(t, y)[1]
    _, (rate, ddy) = jax.jvp(look, (t, y), (jnp.ones_like(t), dy))
    rest = event_delay(stop_gradient(found), rate, usable)
    return t + rest, shift(y, dy, rest), shift(dy, stop_gradient(ddy), rest)


def _end(plan: Plan, problem: PyTree, mode: Any, t: Any, y: PyTree, dy: PyTree, h: Any) -> PyTree:
    system, args = problem

    def field(t, y):
        return system.vector_field(t, y, mode, args)

    return plan.stepper.step(field, t, y, dy, h, plan.execute.for_the_ends())[0]
