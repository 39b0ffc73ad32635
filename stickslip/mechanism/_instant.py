"""Numbers that a mechanism declares at one instant."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from stickslip._fastmath import where

from ._contact import Contact
from ._scalars import Mass, times, total
from ._stop import StopNow


class Instant(NamedTuple):
    """Everything that the declaration says about one instant.

    - `q`, `v`: coordinates with the states of first order after them, and rates of the coordinates.
    - `rates` of the states of first order.
    - `mass`, `force`: inertia, and all forces but those of the contacts [N].
    - `contacts`, `stops`: a `Contact` for each contact, a `StopNow` for each stop.
    - `directions`: a row for each contact and then for each stop, the gradient of its gap.
    - `surfaces`: speeds $w$ of the counter surfaces [m/s], those of moving stops too.
    - `speeds`: sliding speeds $u = n \\cdot v - w$ [m/s]; of stops the rates of their gaps.
    - `pushes`: of each contact the generalised force of a normal force of 1 N; None without one.
    """

    q: Any
    v: Any
    mass: Mass
    force: list[Any]
    contacts: list[Contact]
    directions: list[list[Any]]
    speeds: list[Any]
    stops: list[StopNow]
    surfaces: list[Any]
    rates: list[Any]
    pushes: list[list[Any] | None]

    @property
    def q_rate(self) -> Any:
        """Rates of all that `q` holds."""
        both = zip(self.q, (*self.v, *self.rates), strict=True)
        return type(self.q)(*(None if place is None else rate for place, rate in both))

    def forces_in(self, states: Any) -> list[Any]:
        """All forces but friction [N]: those declared, and normal forces of contacts not open."""
        force = list(self.force)
        for c, (contact, push) in enumerate(zip(self.contacts, self.pushes, strict=True)):
            if push is not None:
                pressed = where(states[c] == 2.0, 0.0, contact.normal_force)
                force = [total((f, times(n, pressed))) for f, n in zip(force, push, strict=True)]
        return force


def floats(numbers: Any) -> Any:
    """Numbers of a state as arrays, as `jax.jvp` wants them."""
    return jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), numbers)


def pressing(load: Any) -> Any:
    """The normal force of a contact that may be open."""
    load = jnp.asarray(load, jnp.float64)
    return where(load > 0.0, load, 0.0)
