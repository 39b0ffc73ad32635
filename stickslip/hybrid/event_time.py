"""The time of an event next to the end of a step: one formula, for motion, derivatives and sections."""

from typing import Any

import jax.numpy as jnp


def event_delay(value: Any, rate: Any, usable: Any) -> Any:
    r"""Time from here to the event, $\delta t = -g/\dot g$; 0 where not `usable`.

    With the value $g$ it is a Newton correction, which removes what is left of the location error. Its
    derivative at fixed rate, $-\mathrm{d}g/\dot g$, is that of the event time, and $y + f\,\delta t$
    carries the first half of the saltation formula. Callers that differentiate by it stop the gradient
    of `rate`: the event is located, so that $g = 0$ there. A guard that rests there has no such time:
    its event is here.
    """
    usable = usable & (rate != 0.0)
    return jnp.where(usable, -value / jnp.where(usable, rate, 1.0), 0.0)
