"""Growth of small deviations in a period: pieces, jumps at events, directions that a mode holds."""

import jax
import jax.numpy as jnp

from ..hybrid import saltation_matrix
from ..hybrid.accuracy import ACCURACY as ENGINE


def pieces_of(jacobian, segments: int, size: int) -> list:
    """Monodromy of each piece in parts of the size, from the Jacobian of the scaled residual."""
    pieces = []
    for k in range(segments):
        rows = slice(k * size, (k + 1) * size)
        block = jacobian[rows, rows]
        # Of one piece alone the next knot is its own first one.
        pieces.append(block + jnp.eye(size) if segments == 1 else block)
    return pieces


def through_events(system, args, log, unit):
    """Lowest rank of the saltation matrices, and the product of their determinants."""
    size = unit.shape[0]
    if not system.guard_names:
        return jnp.asarray(size, jnp.int32), jnp.ones(())

    def event(k, so_far):
        rank, product = so_far
        t, mode, guard, before = jax.tree.map(
            lambda a: a[k], (log.t, log.mode_before, log.guard, log.y_before.y)
        )
        matrix = saltation_matrix(system, t, before, jnp.maximum(mode, 0), jnp.maximum(guard, 0), args)
        matrix = matrix * unit[None, :] / unit[:, None]
        finite = jnp.where(jnp.isfinite(matrix), matrix, 0.0)
        strength = jnp.linalg.svd(finite, compute_uv=False)
        # A jump that takes a direction away does so to rounding; the others keep it.
        found = jnp.sum(strength > ENGINE.zero * strength[0], dtype=jnp.int32)
        determinant = jnp.where(found < size, 0.0, jnp.linalg.det(matrix))
        return jnp.minimum(rank, found), product * determinant

    # A loop over the events there are: the log has room for many more.
    start = jnp.asarray(size, jnp.int32), jnp.ones(())
    return jax.lax.fori_loop(0, log.count, event, start)
