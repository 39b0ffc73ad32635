"""Surfaces that move, on one velocity: what rests on one of them slides on the others as they go."""

from typing import Any

import jax.numpy as jnp

from stickslip._fastmath import where

from ._instant import Instant
from ._island import NOTHING, Island, Motion
from ._reserve import NO_LIMIT
from ._scalars import is_zero, over, times, total
from ._settle import Limits

APART = 1e-9  # part of all forces that surfaces which part would have to bear against each other
MOST = 1e6  # of a share; beyond it, it says no more


def beside_what_rests(
    island: Island, at: Instant, states: Any, force: list, gamma: list, limits: Limits, motion: Motion
) -> list[Any]:
    """Guards of contacts and stops of one velocity where something on it rests.

    None where no surface moves. What slides, slides as the surface of what rests has it, and may do so
    with a speed of exactly 0 from some time on, as on a cam that comes to a stand: it rests then. Near
    such a time the integrated speed errs by the steps, and that of the surface by rounding as it begins
    to move: only what both say has passed through rest. What rests together does so until the surfaces
    part, as where a cam begins to move that carries what rests on the ground too.
    """
    if all(is_zero(gamma[c]) for c in island.rows):
        return []
    (j,), (a,) = island.columns, motion.acceleration
    n = [at.directions[c][j] for c in island.rows]
    (m,) = at.mass.of(island.columns).times([1.0])
    spans = zip(n, limits.low, limits.high, strict=True)
    borne = (jnp.abs(x) * (high - low) for x, low, high in spans if high is not NO_LIMIT)
    most = APART * total((jnp.abs(jnp.asarray(force[j])), jnp.abs(m * a), *borne)) + NOTHING
    speed: Any = at.v[j]
    # As in the motion the first that rests leads, stops before contacts.
    for i in reversed([*range(island.contacts, island.m), *range(island.contacts)]):
        c = island.rows[i]
        speed = where(states[c] == 0.0, times(over(n[i]), at.surfaces[c]), speed)
    found = []
    for x, c in zip(n, island.rows, strict=True):
        apart = m * jnp.abs(a - times(over(x), gamma[c]))
        slip = times(x, speed) - at.surfaces[c]
        slides = jnp.maximum(states[c] * slip, states[c] * at.speeds[c])
        slides = where((slip == 0.0) & (apart == 0.0), -1.0, slides)
        found.append(where(states[c] == 0.0, 1.0 - jnp.minimum(apart / most, MOST), slides))
    return found


def placed(island: Island, at: Instant, q: Any, on: list) -> Any:
    """The coordinates on the stops in `on`, which have carried one velocity: its steps err."""
    (j,), places = island.columns, list(q)
    for c, rests in zip(island.rows, on, strict=True):
        if c >= len(at.contacts):
            gap = at.stops[c - len(at.contacts)].stop.gap
            places[j] = where(rests, at.q[j] - times(over(at.directions[c][j]), gap), places[j])
    return type(q)(*places)
