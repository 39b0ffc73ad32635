"""What a finite sequence of points tells about the attractor: its period, and whether it is reached."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int


def period_of(
    points: Float[Array, "point observable"],
    count: Int[Array, ""],
    *,
    tolerance: Any,
    max_period: int,
) -> tuple[Int[Array, ""], Bool[Array, ""]]:
    r"""Period of a sequence of points, 0 if none, and whether it still approaches its attractor.

    The period is the smallest $p$ for which the last points repeat: $|z_i - z_{i-p}|$ stays below
    `tolerance` times the largest $|z|$ of that observable over the last quarter of the points, at
    least over $p$ and over 3 of them. Rows past `count` are ignored.

    The approach is slow if for some $p$ that difference was above the tolerance over the first quarter
    and has shrunk at least tenfold until the last one: the points of the first quarter are then not
    those of the attractor, and more time should be dropped.
    """
    size = points.shape[0]
    index = jnp.arange(size, dtype=count.dtype)
    valid = (index < count)[:, None]
    scale = jnp.max(jnp.where(valid, jnp.abs(points), 0.0), axis=0)
    scale = jnp.where(scale > 0, scale, 1.0)
    scaled = jnp.where(valid, points, 0.0) / scale[None, :]
    quarter = jnp.maximum(count // 4, 3)
    period, slow = jnp.zeros_like(count), jnp.zeros((), bool)
    for p in range(min(max_period, size // 2), 0, -1):
        gap = jnp.max(jnp.abs(scaled - jnp.roll(scaled, p, axis=0)), axis=1)
        compared = (index >= p) & (index < count)
        window = jnp.maximum(quarter, p)
        last = jnp.max(jnp.where(compared & (index >= count - window), gap, 0.0))
        enough = (count >= 2 * p) & (count >= p + 3)
        period = jnp.where(enough & (last <= tolerance), p, period)
        first = jnp.max(jnp.where(compared & (index < p + quarter), gap, 0.0))
        slow = slow | ((count >= 4 * p) & (count >= 12) & (first > tolerance) & (last < 0.1 * first))
    return period, slow
