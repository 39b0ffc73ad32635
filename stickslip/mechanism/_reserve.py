"""How far contacts and stops that bear together are from giving way, as a force."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where

from ._group import lower_of
from ._laws import NO_LIMIT, Bounds
from ._rows import NumberRow
from ._scalars import any_of, is_zero, minus, times, total


def least_reserve(
    bounds: Bounds, rest: NumberRow, along: list[list], loads: list
) -> tuple[Any, NumberRow]:
    r"""Force that is left to the contacts in `rest` until they give way [N], and how they would.

    Each contact bears a force within `bounds` around 0, a stop from 0 to `NO_LIMIT`. `loads`: what they
    bear together along each of the lines on which they may give way; `along`: directions on these.
    Infinite where nothing rests. Returns the senses too, 0 for those that stay.
    """
    left = [lower_of(*_left_along(bounds, rest, *line)) for line in zip(along, loads, strict=True)]
    least = jnp.full_like(jnp.asarray(left[0][0], jnp.float64), jnp.inf)
    sense, number = jnp.zeros_like(least), jnp.zeros_like(least, jnp.int32)
    for i, (slopes, (reserve, way)) in enumerate(zip(along, left, strict=True)):
        on = any_of(r for r, n in zip(rest, slopes, strict=True) if not is_zero(n))
        first = on & (reserve < least)
        least, sense = where(first, reserve, least), where(first, way, sense)
        number = where(first, jnp.int32(i), number)
    if len(along) == 1:
        signs: Any = [jnp.sign(jnp.asarray(n)) for n in along[0]]
    else:
        signs = jnp.asarray(np.sign(np.array(along)))[number]
    return least, tuple(where(r, sense * signs[c], 0.0) for c, r in enumerate(rest))


def _left_along(bounds: Bounds, rest: NumberRow, slopes: list, load: Any) -> tuple[Any, Any]:
    """Force beyond `load` that the contacts in `rest` bear along a line, upwards and downwards."""
    most: list[Any] = []
    least: list[Any] = []
    any_more = any_less = rest[0] & False
    for r, n, low, high in zip(rest, slopes, bounds.lower, bounds.high, strict=True):
        if is_zero(n):
            continue
        forwards = jnp.asarray(n) > 0.0
        down = where(r, low, 0.0)
        if high is NO_LIMIT:
            # Apart from the sums: derivatives of what is infinite would be no numbers.
            any_more, any_less = any_more | (r & forwards), any_less | (r & ~forwards)
            up: Any = 0.0
        else:
            up = where(r, high, 0.0)
        most.append(times(n, where(forwards, up, down)))
        least.append(times(n, where(forwards, down, up)))
    more, less = minus(total(most), load), minus(load, total(least))
    return where(any_more, jnp.inf, more), where(any_less, jnp.inf, less)
