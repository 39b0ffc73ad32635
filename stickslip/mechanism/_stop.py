"""What a mechanism says about one rigid stop, and its direction: the gradient of its gap."""

import contextlib
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._validation import DeclarationError, is_concrete, refusal
from stickslip.hybrid.dependence import NONE, degrees

from ._abstract import abstract, numbers_of, with_numbers
from ._any_args import Looked, Sealed, with_any_args
from ._declaration import at_zero, coordinates_type, in_order
from ._first_order import refuse_gap
from ._folding import folded
from ._modes import BITS, MOST

if TYPE_CHECKING:
    from ._mechanism import AbstractMechanism


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


def check_names(machine: "AbstractMechanism") -> None:
    """Raise for stops that are not names, or that have the name of a contact."""
    names = machine.names
    if isinstance(machine.stops, str):
        raise refusal("stops", machine.stops, "a tuple of names", TypeError)
    for name in names.stops:
        if not isinstance(name, str) or not name or " / " in name:
            raise refusal("stops", name, "names of stops: texts without ' / '")
        if name in names.contacts or names.stops.count(name) > 1:
            raise refusal("stops", name, "a name that no contact and no other stop has")
    if BITS * len(names.contacts) + len(names.stops) > BITS * MOST:
        allowed = f"at most {BITS * MOST} less two for each contact: the mode is a number of 64 bits"
        raise refusal("stops", f"{len(names.stops)} stops", allowed)


def check_stops(machine: "AbstractMechanism", given: Any) -> list[Stop]:
    """The stops in order."""
    names = machine.names.stops
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


def check_without_args(machine: "AbstractMechanism") -> None:
    """Raise for wrong stops where the gaps do not look at `args`; for others a run does."""

    def gaps(t, q):
        try:
            given = machine.gaps(t, q, Sealed())
        except Exception:
            return 0.0
        check_stops(machine, given)
        return 0.0

    with contextlib.suppress(Looked):
        jax.eval_shape(gaps, jnp.zeros(()), at_zero(machine.names)[0])


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


def check_gaps(machine: "AbstractMechanism", t: Any, y: Any, args: Any) -> None:
    """Raise for wrong stops, by name, without compiling anything."""
    if machine.stops:
        n = len(machine.names.coordinates)

        def gaps(t, q, states):
            given = check_stops(machine, machine.gaps(t, type(q)(*q[:n], *states), args))
            return [jnp.asarray(stop.gap, jnp.float64) + 0.0 * t for stop in given]

        t, q = jax.tree.map(jnp.asarray, (t, machine.to_coordinates(y)[0]))
        found = degrees(gaps, (t, q, tuple(q[n:])), (False, False, True))
        for name, degree in zip(machine.stops, found, strict=True):
            if degree != NONE:
                raise refuse_gap(name)


def stops_at(machine: "AbstractMechanism", t: Any, q: Any, args: Any) -> list[StopNow]:
    """All stops and their gradients at time `t` and the coordinates `q`."""
    if not machine.stops:
        return []
    t, q = jnp.asarray(t, jnp.float64), jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), q)
    zero, one = jnp.zeros_like(t), jnp.ones_like(t)

    def gaps(t, q):
        given = check_stops(machine, machine.gaps(t, q, args))
        return [jnp.asarray(stop.gap, jnp.float64) + 0.0 * t for stop in given]

    slopes = machine.slopes  # [stop, coordinate, and time last], NaN where it varies
    stops = check_stops(machine, machine.gaps(t, q, args))
    found = [list(map(float, row)) for row in slopes]
    rows: list[list[Any]] = [list(row) for row in found]
    states = [jnp.zeros_like(x) for x in q[slopes.shape[1] - 1 :]]
    cyclic = [x is None for x in q]
    for j in range(slopes.shape[1]):
        if not np.isnan(slopes[:, j]).any():
            continue
        way = [one if i == j else zero for i in range(slopes.shape[1])]
        ways = (None if left else x for left, x in zip(cyclic, (*way[:-1], *states), strict=True))
        rates = jax.jvp(gaps, (t, q), (way[-1], type(q)(*ways)))[1]
        for row, known, rate in zip(rows, slopes[:, j], rates, strict=True):
            if np.isnan(known):
                row[j] = rate
    return [StopNow(s, row[:-1], row[-1]) for s, row in zip(stops, rows, strict=True)]


def slopes_under(machine: "AbstractMechanism", args: Any) -> set[tuple[int, int, float]]:
    """Slopes of gaps that are constant under `args`: stop, coordinate or time last, slope."""
    leaves, form = abstract(machine)
    names = machine.names
    n, others, kind = len(names.coordinates), len(names.first_order), coordinates_type(names.places)

    def columns(numbers, t, q):
        machine = jax.tree.unflatten(form, with_numbers(leaves, numbers))

        def gaps(t, q):
            found = check_stops(machine, machine.gaps(t, q, args))
            return [jnp.asarray(stop.gap, jnp.float64) + 0.0 * t for stop in found]

        ways = np.eye(n + 1)
        return [
            jax.jvp(gaps, (t, q), (jnp.float64(way[-1]), kind(*map(jnp.float64, way[:-1]))))[1]
            for way in np.insert(ways, [n] * others, 0.0, axis=1)
        ]

    scalar = jax.ShapeDtypeStruct((), jnp.float64)
    found = folded(columns, (numbers_of(leaves), scalar, kind(*[scalar] * (n + others))))
    count = len(names.stops)
    return {(i % count, i // count, x) for i, x in enumerate(found) if x is not None}


def constant_slopes(machine: "AbstractMechanism") -> set[tuple[int, int, float]]:
    """The same whatever `args` are."""
    return with_any_args(lambda args: slopes_under(machine, args)) if machine.stops else set()


def slopes(machine: "AbstractMechanism") -> np.ndarray:
    """Slopes of all gaps [stop, coordinate, and time last]; NaN where they are not constant."""
    names = machine.names
    found = np.full((len(names.stops), len(names.coordinates) + 1), np.nan)
    for k, j, slope in constant_slopes(machine):
        found[k, j] = slope
    return found
