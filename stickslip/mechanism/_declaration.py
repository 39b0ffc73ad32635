"""Declarations of a mechanism, read while tracing: names, directions and inertia."""

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from stickslip._validation import refusal

from ._scalars import Mass, is_zero

GIVEN = None  # a direction that `contacts` returns


class Names(NamedTuple):
    """Names that a mechanism states, in order."""

    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    contacts: tuple[str, ...]
    opening: tuple[str, ...]
    stops: tuple[str, ...] = ()
    first_order: tuple[str, ...] = ()
    cyclic: tuple[str, ...] = ()

    @property
    def places(self) -> tuple[str, ...]:
        """Fields of `q`: the coordinates, and after them the states of first order."""
        return self.coordinates + self.first_order

    @property
    def kept(self) -> tuple[str, ...]:
        """Those of them that the state has."""
        return tuple(name for name in self.places if name not in self.cyclic)


def _named_tuple(title: str, names: tuple[str, ...]) -> type:
    fields: Any = [(name, Any) for name in names]  # type checkers read literal lists only
    return NamedTuple(title, fields)


@functools.lru_cache(maxsize=256)
def coordinates_type(names: tuple[str, ...]) -> type:
    """Named tuple of the coordinates, or of their rates under the same names."""
    return _named_tuple("Coordinates", names)


def at_zero(names: Names, zero: Any = None) -> tuple[Any, Any]:
    """`q` and `v` of zeros."""
    zero = jnp.zeros(()) if zero is None else zero
    q = (None if name in names.cyclic else zero for name in names.places)
    v = (zero for _ in names.coordinates)
    return coordinates_type(names.places)(*q), coordinates_type(names.coordinates)(*v)


@functools.lru_cache(maxsize=256)
def state_type(names: tuple[str, ...]) -> type:
    """Named tuple of coordinates and velocities."""
    return _named_tuple("MechanismState", names)


def in_order(what: str, given: Any, names: Sequence[str], allowed: str) -> list[Any]:
    """One entry per name: of a mapping by name, where a missing one is 0; of a sequence; of one number.

    Raises `ValueError` naming `what` for anything else.
    """
    if isinstance(given, Mapping):
        for name in given:
            if name not in names:
                choices = ", ".join(map(repr, names))
                raise refusal(what, dict(given), f"a mapping with keys out of {choices}: {allowed}")
        return [given.get(name, 0.0) for name in names]
    if isinstance(given, tuple | list) or getattr(given, "ndim", 0) == 1:
        if len(given) != len(names):
            raise refusal(
                what, given, f"{len(names)} entries, in the order {', '.join(names)}: {allowed}"
            )
        return list(given)
    if (
        len(names) == 1
        and getattr(given, "ndim", 0) == 0
        and not isinstance(given, str)
        and given is not None
    ):
        return [given]
    raise refusal(what, given, f"a mapping by name or {len(names)} entries: {allowed}")


def mass_of(given: Any, names: Sequence[str]) -> Mass:
    """The mass matrix from what `mass_matrix` returned."""
    n, allowed = len(names), "the mass of each coordinate, or the rows of a symmetric matrix"
    if getattr(given, "ndim", None) == 2:
        if given.shape != (n, n):
            raise refusal("mass_matrix(q)", given, f"of shape ({n}, {n}): {allowed}")
        given = [[given[i, j] for j in range(n)] for i in range(n)]
    entries = in_order("mass_matrix(q)", given, names, allowed)
    # Arrays by name are numbers, one for each lane; in a sequence they are rows.
    named = isinstance(given, Mapping)
    full = [
        isinstance(x, tuple | list | Mapping) or (not named and getattr(x, "ndim", 0) == 1)
        for x in entries
    ]
    if not any(full):
        return Mass(diagonal=entries)
    if not all(full):
        raise refusal("mass_matrix(q)", given, allowed)
    rows = [
        in_order(f"mass_matrix(q)[{name!r}]", row, names, allowed)
        for name, row in zip(names, entries, strict=True)
    ]
    if all(is_zero(rows[i][j]) for i in range(n) for j in range(n) if i != j):
        return Mass(diagonal=[rows[i][i] for i in range(n)])
    return Mass(full=rows)


ROWS = (tuple, list, Mapping, np.ndarray)


def directions_of(given: Mapping[str, Any], coordinates: Sequence[str]) -> np.ndarray:
    """Directions [contact, coordinate]; NaN in the rows that depend on state or parameters."""
    rows = []
    for contact, row in given.items():
        if row is GIVEN:
            rows.append([np.nan] * len(coordinates))
            continue
        what = f"contact_directions[{contact!r}]"
        allowed = "constant numbers (None for a direction that `contacts` returns)"
        if isinstance(row, tuple | list) and any(isinstance(x, ROWS) for x in row):
            allowed += "; friction in a plane is that of two contacts, which `planar` names"
        entries = in_order(what, row, coordinates, allowed)
        try:
            numbers = [float(x) for x in entries]
        except (TypeError, ValueError):
            raise refusal(what, row, allowed) from None
        if not np.isfinite(numbers).all() or not any(numbers):
            raise refusal(what, row, "finite numbers, not all of them 0")
        rows.append(numbers)
    return np.array(rows, float).reshape(len(rows), len(coordinates))
