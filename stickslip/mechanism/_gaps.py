"""Gaps of the stops of a mechanism: their gradients, and the slopes that are constant."""

import contextlib
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._validation import DeclarationError, is_concrete, refusal
from stickslip.hybrid.dependence import NONE, degrees_in

from ._abstract import abstract, numbers_of, with_numbers
from ._abstract_declaration import AbstractDeclaration
from ._any_args import Looked, Sealed, with_any_args
from ._declaration import at_zero, coordinates_type
from ._folding import constants_of
from ._known import kept_trace, numbers_known
from ._modes import BITS, MOST
from ._stop import Stop, StopNow, check_numbers, stops_in_order


def check_stop_names(declaration: AbstractDeclaration) -> None:
    """Raise for stops that are not names, or that have the name of a contact."""
    names = declaration.names
    if isinstance(declaration.stops, str):
        raise refusal("stops", declaration.stops, "a tuple of names", TypeError)
    for name in names.stops:
        if not isinstance(name, str) or not name or " / " in name:
            raise refusal("stops", name, "names of stops: texts without ' / '")
        if name in names.contacts or names.stops.count(name) > 1:
            raise refusal("stops", name, "a name that no contact and no other stop has")
    if BITS * len(names.contacts) + len(names.stops) > BITS * MOST:
        allowed = f"at most {BITS * MOST} less two for each contact: the mode is a number of 64 bits"
        raise refusal("stops", f"{len(names.stops)} stops", allowed)


def _stops_of(declaration: AbstractDeclaration, t: Any, q: Any, args: Any) -> list[Stop]:
    return stops_in_order(declaration.names.stops, declaration.gaps(t, q, args))


def check_without_args(declaration: AbstractDeclaration) -> None:
    """Raise for wrong stops where the gaps do not look at `args`; for others a run does."""

    def gaps(t, q):
        try:
            given = declaration.gaps(t, q, Sealed())
        except Exception:
            return 0.0
        stops_in_order(declaration.names.stops, given)
        return 0.0

    with contextlib.suppress(Looked):
        jax.eval_shape(gaps, jnp.zeros(()), at_zero(declaration.names)[0])


def check_gaps(declaration: AbstractDeclaration, t: Any, y: Any, args: Any) -> None:
    """Raise for wrong stops, by name, without compiling anything."""
    if not declaration.stops:
        return
    q, _ = declaration.to_coordinates(y)
    states = tuple(q[len(declaration.names.coordinates) :])
    for name, degree in zip(
        declaration.stops, _degrees(_gap_values, (states,), (t, q, declaration, args)), strict=True
    ):
        if degree != NONE:
            raise _gap_of_first_order(name)
    if is_concrete((declaration, t, y, args)):
        found = numbers_known(_stop_numbers, t, q, declaration, args) or []
        fixed = _degrees(_stop_numbers, (t, q), (declaration, args))
        # One that depends on the place may be out of range while the stop is far away.
        known = [x if degree == NONE else 0.0 for x, degree in zip(found, fixed, strict=False)]
        for name, *numbers in zip(declaration.stops, known[::2], known[1::2], strict=False):
            check_numbers(name, Stop(0.0, *numbers))


def _degrees(function: Callable, asked: tuple, others: tuple) -> list[int]:
    """Degree of each result of `function(*asked, *others)` in the numbers of `asked`."""
    program, numbers = kept_trace(function, *asked, *others)
    count = len(jax.tree.leaves(asked))
    return degrees_in(program, [i < count for i in range(len(numbers))])


def _gap_values(
    states: tuple, t: Any, q: Any, declaration: AbstractDeclaration, args: Any
) -> list[Any]:
    """Gaps of the stops; `states` are the states of first order."""
    n = len(declaration.names.coordinates)
    given = _stops_of(declaration, t, type(q)(*q[:n], *states), args)
    return [jnp.asarray(stop.gap, jnp.float64) + 0.0 * t for stop in given]


def _stop_numbers(t: Any, q: Any, declaration: AbstractDeclaration, args: Any) -> list[Any]:
    """Restitution and speed of rest of each stop."""
    given = _stops_of(declaration, t, q, args)
    return [jnp.asarray(x, jnp.float64) for stop in given for x in (stop.restitution, stop.rest_speed)]


def _gap_of_first_order(stop: str) -> DeclarationError:
    allowed = "a function of the time and the coordinates only"
    return DeclarationError(
        str(refusal(f"the gap of stop {stop!r}", "a function of a first-order state", allowed))
    )


def stops_at(
    declaration: AbstractDeclaration, slopes: np.ndarray, t: Any, q: Any, args: Any
) -> list[StopNow]:
    """All stops and their gradients at time `t` and the coordinates `q`.

    `slopes`: those that are constant `[stop, coordinate, and time last]`, NaN where one varies.
    """
    if not declaration.stops:
        return []
    t, q = jnp.asarray(t, jnp.float64), jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), q)
    zero, one = jnp.zeros_like(t), jnp.ones_like(t)

    def gaps(t, q):
        given = _stops_of(declaration, t, q, args)
        return [jnp.asarray(stop.gap, jnp.float64) + 0.0 * t for stop in given]

    stops = _stops_of(declaration, t, q, args)
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


def slopes_under(declaration: AbstractDeclaration, args: Any) -> set[tuple[int, int, float]]:
    """Slopes of gaps that are constant under `args`: stop, coordinate or time last, slope."""
    leaves, form = abstract(declaration)
    names = declaration.names
    n, others, kind = len(names.coordinates), len(names.first_order), coordinates_type(names.places)

    def columns(numbers, t, q):
        declaration = jax.tree.unflatten(form, with_numbers(leaves, numbers))

        def gaps(t, q):
            found = _stops_of(declaration, t, q, args)
            return [jnp.asarray(stop.gap, jnp.float64) + 0.0 * t for stop in found]

        ways = np.eye(n + 1)
        return [
            jax.jvp(gaps, (t, q), (jnp.float64(way[-1]), kind(*map(jnp.float64, way[:-1]))))[1]
            for way in np.insert(ways, [n] * others, 0.0, axis=1)
        ]

    scalar = jax.ShapeDtypeStruct((), jnp.float64)
    found = constants_of(columns, (numbers_of(leaves), scalar, kind(*[scalar] * (n + others))))
    count = len(names.stops)
    return {(i % count, i // count, x) for i, x in enumerate(found) if x is not None}


def constant_slopes(declaration: AbstractDeclaration) -> set[tuple[int, int, float]]:
    """The same whatever `args` are."""
    return with_any_args(lambda args: slopes_under(declaration, args)) if declaration.stops else set()


def slope_table(declaration: AbstractDeclaration) -> np.ndarray:
    """Slopes of all gaps [stop, coordinate, and time last]; NaN where they are not constant."""
    names = declaration.names
    found = np.full((len(names.stops), len(names.coordinates) + 1), np.nan)
    for k, j, slope in constant_slopes(declaration):
        found[k, j] = slope
    return found
