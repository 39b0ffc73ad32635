"""Least and greatest values along a motion that is known at some instants, with its slopes."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float


def extremes(
    y: Float[Array, "instant size"], slope: Float[Array, "instant size"], step: Any
) -> tuple[Float[Array, " size"], Float[Array, " size"]]:
    """Least and greatest value of each column, between the instants by the cubic through both ends.

    Where a motion of frequency w is smooth they are right to (w step)^4 / 384 of its size. Values that
    are not finite do not count.
    """
    y0, y1, m0, m1 = y[:-1], y[1:], step * slope[:-1], step * slope[1:]
    a, b, c = 3.0 * (2.0 * (y0 - y1) + m0 + m1), 2.0 * (3.0 * (y1 - y0) - 2.0 * m0 - m1), m0
    root = jnp.sqrt(jnp.maximum(b * b - 4.0 * a * c, 0.0))
    # Both zeros of the slope, by the formula that does not cancel.
    q = -0.5 * (b + jnp.where(b >= 0, root, -root))
    inside = []
    for top, below in ((q, a), (c, q)):
        s = top / jnp.where(below == 0, jnp.inf, below)
        s = jnp.clip(s, 0.0, 1.0)
        cubic = y0 + s * (m0 + s * (0.5 * b + s * a / 3.0))
        inside.append(cubic)
    values = jnp.concatenate([y, *inside])
    finite = jnp.isfinite(values)
    low = jnp.min(jnp.where(finite, values, jnp.inf), axis=0)
    return low, jnp.max(jnp.where(finite, values, -jnp.inf), axis=0)
