"""Numbers of one kind side by side: one for each contact, or for each line.

For a single machine they are a vector: the program is a tenth as long as with every number spelled
out, and compiles as much faster. In a fused program of many machines each number is a vector over the
machines already, so there they stay apart, in a tuple.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip._fastmath import where
from stickslip.hybrid import current_executor

# One number a contact, or a line: a tuple of scalars, or an array with one axis.
NumberRow = tuple | jax.Array


def row(values: Any) -> NumberRow:
    """These numbers as a row; a row stays what it is."""
    if not isinstance(values, tuple | list):
        return values
    if current_executor().fused:
        return tuple(values)
    # Behind the barrier the numbers are read from memory; without it, the compiler sees through the
    # vector and computes each number anew wherever it is read.
    return lax.optimization_barrier(jnp.stack(jnp.broadcast_arrays(*values)))


def constants(values: list, dtype: Any) -> Any:
    """Constants side by side in the form that `row` makes."""
    return tuple(values) if current_executor().fused else np.array(values, dtype)


def each(function: Callable, *rows: Any) -> NumberRow:
    """`function` of the numbers at each place; anything but a row is the same at all places."""
    sizes = {len(r) for r in rows if isinstance(r, tuple)}
    if not sizes:
        return function(*rows)
    (size,) = sizes
    spread = [r if isinstance(r, tuple) else (r,) * size for r in rows]
    return tuple(function(*numbers) for numbers in zip(*spread, strict=True))


def through(table: np.ndarray, numbers: NumberRow) -> NumberRow:
    """Linear map by a constant table, `table @ numbers`. Small integers in it cost no product."""
    if not isinstance(numbers, tuple):
        return jnp.sum(jnp.asarray(table, jnp.float64) * numbers[None, :], axis=1)
    return tuple(_weighted_sum(weights, numbers) for weights in table)


def _weighted_sum(weights: np.ndarray, numbers: tuple) -> Any:
    """Equal weights are taken out of the sum."""
    total = None
    for size in sorted({abs(w) for w in weights if w}):
        terms = [n if w > 0 else -n for w, n in zip(weights, numbers, strict=True) if abs(w) == size]
        part = sum(terms[1:], terms[0])
        part = part if size == 1 else float(size) * part
        total = part if total is None else total + part
    return jnp.zeros_like(numbers[0]) if total is None else total


def any_of(flags: NumberRow) -> Any:
    """Whether one of them is true."""
    if not isinstance(flags, tuple):
        return jnp.any(flags)
    found = flags[0]
    for flag in flags[1:]:
        found = found | flag
    return found


def any_through(table: np.ndarray, flags: NumberRow) -> NumberRow:
    """For each row of a constant table whether one of the flags marked in it is true."""
    if not isinstance(flags, tuple):
        return jnp.any((np.asarray(table) != 0) & flags[None, :], axis=1)
    marked = [tuple(f for mark, f in zip(marks, flags, strict=True) if mark) for marks in table]
    return tuple(any_of(some) if some else jnp.zeros_like(flags[0]) for some in marked)


def first_greatest(values: NumberRow, floor: float, *others: NumberRow) -> tuple[Any, ...]:
    """The greatest of `values` if above `floor`, its place (0 if none is), and those of `others`."""
    if not isinstance(values, tuple):
        places = jnp.arange(len(values), dtype=jnp.int32)
        fixed = lax.stop_gradient(values)
        place = jnp.min(jnp.where(fixed == jnp.max(fixed), places, jnp.int32(len(values) - 1)))
        place = where(jnp.max(fixed) > floor, place, jnp.int32(0))
        here = places == place

        def at(numbers):
            return jnp.sum(jnp.where(here, numbers, 0.0))

        return jnp.maximum(at(values), floor), place, *map(at, others)
    best, place, found = jnp.full_like(values[0], floor), jnp.zeros_like(values[0], jnp.int32), None
    for i, value in enumerate(values):
        more = value > best
        now = [other[i] for other in others]
        found = now if found is None else [where(more, a, b) for a, b in zip(now, found, strict=True)]
        best, place = where(more, value, best), where(more, jnp.int32(i), place)
    return best, place, *(found or ())


def with_place(flags: NumberRow, place: Any) -> NumberRow:
    """`flags`, true at `place` too."""
    if not isinstance(flags, tuple):
        return flags | (jnp.arange(len(flags), dtype=jnp.int32) == place)
    return tuple(flag | (place == c) for c, flag in enumerate(flags))
