"""Gaps of the stops of a mechanism: their gradients, and the slopes that are constant."""

import contextlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._validation import DeclarationError, refusal
from stickslip.hybrid.dependence import NONE, degrees

from ._abstract import abstract, numbers_of, with_numbers
from ._abstract_declaration import AbstractDeclaration
from ._any_args import Looked, Sealed, with_any_args
from ._declaration import at_zero, coordinates_type
from ._folding import constants_of
from ._modes import BITS, MOST
from ._stop import Stop, StopNow, stops_in_order


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
    if declaration.stops:
        n = len(declaration.names.coordinates)

        def gaps(t, q, states):
            given = _stops_of(declaration, t, type(q)(*q[:n], *states), args)
            return [jnp.asarray(stop.gap, jnp.float64) + 0.0 * t for stop in given]

        t, q = jax.tree.map(jnp.asarray, (t, declaration.to_coordinates(y)[0]))
        found = degrees(gaps, (t, q, tuple(q[n:])), (False, False, True))
        for name, degree in zip(declaration.stops, found, strict=True):
            if degree != NONE:
                raise _gap_of_first_order(name)


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
