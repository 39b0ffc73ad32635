"""The time of an event next to the end of a step: one formula, for motion, derivatives and sections."""

from typing import Any

import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import PyTree

from .tree import shift


def event_delay(value: Any, rate: Any, usable: Any, stretch: Any = None) -> Any:
    r"""Time from here to the event, $\delta t = -g/\dot g$; 0 where not `usable`.

    With the value $g$ it is a Newton correction, which removes what is left of the location error. Its
    derivative at fixed rate, $-\mathrm{d}g/\dot g$, is that of the event time, and $y + f\,\delta t$
    carries the first half of the saltation formula. Callers that differentiate by it stop the gradient
    of `rate`: the event is located, so that $g = 0$ there. A guard that rests there has no such time:
    its event is here. `stretch`: rate of the guard by the length of the step, over `rate`, where they
    differ; it enters the derivative alone.
    """
    usable = usable & (rate != 0.0)
    dt = jnp.where(usable, -value / jnp.where(usable, rate, 1.0), 0.0)
    return dt if stretch is None else stop_gradient(dt) + (dt - stop_gradient(dt)) / stretch


def at_event(y: PyTree, dy: PyTree, dt: Any, by_length: PyTree | None = None) -> PyTree:
    """State at the event from that at the end of a step and the slope there, which is held: its
    derivative would enter times `dt`, which is zero but for rounding.

    `by_length`: slope by the length of the step, where it differs; it enters the derivative alone.
    """
    dy = stop_gradient(dy)
    if by_length is None:
        return shift(y, dy, dt)
    return shift(shift(y, dy, stop_gradient(dt)), by_length, dt - stop_gradient(dt))
