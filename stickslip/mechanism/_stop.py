"""One rigid stop at one instant, as a mechanism declares it."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from stickslip._validation import DeclarationError, is_concrete, refusal

from ._declaration import in_order


class Stop(NamedTuple):
    r"""One rigid stop at one instant, as `AbstractMechanism.gaps` returns it.

    The gap $g(t, q)$ [m] is positive where the mechanism is off the stop. At $g = 0$ an approach
    $u = \dot g < 0$ ends in an impact by Newton's law, $u^+ = -e\,u^-$, with an impulse along the
    gradient of $g$ by the coordinates.

    - `gap` $g$ [m], a function of the coordinates and the time.
    - `restitution` $e$ [-], between 0 and 1.
    - `rest_speed` [m/s], not negative: an impact that would leave no more, under a force towards the
      stop, ends in rest. With 0 and $0 < e < 1$ such impacts accumulate.
    """

    gap: Any
    restitution: Any
    rest_speed: Any = 1e-6


class StopNow(NamedTuple):
    """A stop with its gradient: `row` by the coordinates, `rate` by the time."""

    stop: Stop
    row: list[Any]
    rate: Any


def stops_in_order(names: tuple[str, ...], given: Any) -> list[Stop]:
    """The stops in the order of their names; raises for what is not a `Stop`."""
    what = "gaps(t, q, args)"
    for name in names if isinstance(given, dict) else ():
        if name not in given:
            raise DeclarationError(str(refusal(what, sorted(given), f"a Stop for {name!r} too")))
    stops = in_order(what, given, names, "a Stop for each")
    for name, stop in zip(names, stops, strict=True):
        if not isinstance(stop, Stop):
            raise refusal(f"gaps(...)[{name!r}]", stop, "a Stop", TypeError)
        if jnp.ndim(stop.gap):
            raise refusal(f"the gap of stop {name!r}", stop.gap, "one number")
        check_numbers(name, stop)
    return stops


def check_numbers(name: str, stop: Stop) -> None:
    """Raise for a restitution or a speed of rest out of range, where it is known."""
    for what, value, most in (
        ("restitution", stop.restitution, 1.0),
        ("rest_speed", stop.rest_speed, np.inf),
    ):
        if not is_concrete(value):
            continue
        try:
            right = bool(np.all((np.asarray(value, float) >= 0.0) & (np.asarray(value) <= most)))
        except (TypeError, ValueError):
            right = False
        if not right:
            allowed = "between 0 and 1" if most == 1.0 else "a speed [m/s], not negative"
            raise refusal(f"the {what} of stop {name!r}", value, allowed)
