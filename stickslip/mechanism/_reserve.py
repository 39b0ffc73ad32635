"""How far the contacts of an island with stops are from giving way, as a force."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where

from ._island import Island, Motion
from ._scalars import Mass, any_of, dot, is_zero, minus, times, total

NO_LIMIT = math.inf  # what a stop can bear, a constant that the program knows


def least_reserve(
    island: Island, low: list, high: list, J: list[list], rest: list, motion: Motion
) -> tuple[Any, list[Any]]:
    r"""Force that is left to the contacts in `rest` until they give way [N], and how they would.

    Each contact bears a force between `low` and `high`, an interval around 0, a stop from 0 to
    `NO_LIMIT`: as `Island.onset`, where the share of what can be borne has no meaning, since it is 0 or
    infinite. Infinite where nothing rests. Returns the senses too, 0 for those that stay.
    """
    least = jnp.full_like(jnp.asarray(motion.acceleration[0], jnp.float64), jnp.inf)
    sense, number = jnp.zeros_like(least), jnp.zeros_like(least, jnp.int32)
    if not island.dependent:
        for c, r in enumerate(rest):
            more, less = _of_contact(low[c], high[c], motion.force[c])
            reserve, way = _lower(more, less)
            first = r & (reserve < least)
            least, sense = where(first, reserve, least), where(first, way, sense)
            number = where(first, jnp.int32(c), number)
        return least, [where(r & (number == c), sense, 0.0) for c, r in enumerate(rest)]
    along = [[J[c][0] for c in range(island.m)]] if island.shut else island.along.tolist()
    lines = [[1.0]] if island.shut else island.lines.tolist()
    for i, (line, slopes) in enumerate(zip(lines, along, strict=True)):
        load = dot(line, motion.reaction)
        on = any_of(r for r, n in zip(rest, slopes, strict=True) if not is_zero(n))
        reserve, way = _lower(*_left_along(low, high, rest, slopes, load))
        first = on & (reserve < least)
        least, sense = where(first, reserve, least), where(first, way, sense)
        number = where(first, jnp.int32(i), number)
    signs = [
        jnp.sign(along[0][c]) if island.shut else jnp.asarray(np.sign(island.along))[number][c]
        for c in range(island.m)
    ]
    return least, [where(r, sense * n, 0.0) for r, n in zip(rest, signs, strict=True)]


def _of_contact(low: Any, high: Any, borne: Any) -> tuple[Any, Any]:
    return (high if high is NO_LIMIT else high - borne), minus(borne, low)


def _lower(more: Any, less: Any) -> tuple[Any, Any]:
    """The lower of what is left upwards and downwards, and the sense of giving way there."""
    if more is NO_LIMIT:
        return less, 1.0
    # The reaction pushes back: they give way against it.
    return jnp.minimum(more, less), where(more < less, -1.0, 1.0)


def _left_along(low: list, high: list, rest: list, slopes: list, load: Any) -> tuple[Any, Any]:
    """What the contacts in `rest` can bear more than `load` along a line, upwards and downwards."""
    most: list[Any] = []
    least: list[Any] = []
    any_more = any_less = rest[0] & False
    for c, n in enumerate(slopes):
        if is_zero(n):
            continue
        forwards = jnp.asarray(n) > 0.0
        down = where(rest[c], low[c], 0.0)
        if high[c] is NO_LIMIT:
            # Apart from the sums: derivatives of what is infinite would be no numbers.
            any_more, any_less = any_more | (rest[c] & forwards), any_less | (rest[c] & ~forwards)
            up: Any = 0.0
        else:
            up = where(rest[c], high[c], 0.0)
        most.append(times(n, where(forwards, up, down)))
        least.append(times(n, where(forwards, down, up)))
    more, less = minus(total(most), load), minus(load, total(least))
    return where(any_more, jnp.inf, more), where(any_less, jnp.inf, less)


def stops_alone(
    island: Island, M: Mass, F: list, J: list[list], gamma: list, states: list, standing: list
) -> list[Any]:
    """The law of stops that bear the load one at a time: what pulls leaves."""
    motion = island.motion(M, F, J, standing, gamma)
    after = []
    for c, s in enumerate(states):
        off = lone_reaction(island, J, motion, c) < 0.0
        after.append(where((s == 0.0) & off, 1.0, s))
    return after


def lone_reaction(island: Island, J: list[list], motion: Motion, c: int) -> Any:
    """Force of stop `c` on the mechanism, along its gradient, if it bears all that rests [N]."""
    if island.shut:
        return times(1.0 / J[c][0], motion.reaction[0])
    return motion.force[c]
