"""Least and greatest values along a motion that is known at some instants, with its slopes."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..hybrid import AbstractHybridSystem, EventLog, StateLog


def extremes_of(
    system: AbstractHybridSystem, args: Any, outputs: StateLog, log: EventLog, y: Any
) -> tuple[Float[Array, " size"], Float[Array, " size"]]:
    """Least and greatest value of each number of the state, of the outputs and events of a motion.

    From each instant to the next the motion is smooth: at an event it goes on from the state behind
    it. `y`: the states of both logs in the form of the system's own, as a function of theirs.
    """

    def rows(states: Any) -> Array:
        return jax.vmap(lambda state: ravel_pytree(y(state))[0])(states)

    def slopes(states: Any, modes: Any) -> Array:
        def slope(t, state, mode):
            return ravel_pytree(system.vector_field(t, y(state), jnp.maximum(mode, 0), args))[0]

        return jax.vmap(slope)(log.t, states, modes)

    at, along = rows(outputs.y), rows(outputs.dy)
    # Rows past the last event are NaN, and come last. Outputs at the time of an event are before it.
    t = jnp.concatenate([outputs.t, log.t])
    order = jnp.argsort(t)
    before = jnp.concatenate([at, rows(log.y_before)])[order]
    after = jnp.concatenate([at, rows(log.y_after)])[order]
    comes = jnp.concatenate([along, slopes(log.y_before, log.mode_before)])[order]
    goes = jnp.concatenate([along, slopes(log.y_after, log.mode_after)])[order]
    inside = between(after[:-1], before[1:], goes[:-1], comes[1:], jnp.diff(t[order])[:, None])
    values = jnp.concatenate([before, after, *inside])
    known = jnp.isfinite(values)
    low = jnp.min(jnp.where(known, values, jnp.inf), axis=0)
    return low, jnp.max(jnp.where(known, values, -jnp.inf), axis=0)


def between(y0: Array, y1: Array, slope0: Array, slope1: Array, step: Array) -> list[Array]:
    """Values at both zeros of the slope of cubics with these ends and slopes, or at an end.

    Where a motion of frequency w is smooth they are right to (w step)^4 / 384 of its size.
    """
    m0, m1 = step * slope0, step * slope1
    a, b, c = 3.0 * (2.0 * (y0 - y1) + m0 + m1), 2.0 * (3.0 * (y1 - y0) - 2.0 * m0 - m1), m0
    root = jnp.sqrt(jnp.maximum(b * b - 4.0 * a * c, 0.0))
    # By the formula that does not cancel.
    q = -0.5 * (b + jnp.where(b >= 0, root, -root))
    inside = []
    for top, below in ((q, a), (c, q)):
        s = jnp.clip(top / jnp.where(below == 0, jnp.inf, below), 0.0, 1.0)
        inside.append(y0 + s * (m0 + s * (0.5 * b + s * a / 3.0)))
    return inside
