"""What a period does to small deviations: pieces, jumps at events, directions that a mode holds."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from ..hybrid import AbstractHybridSystem, saltation_matrix

# A jump that takes a direction away does so to rounding; the others keep it.
LOST_AT_EVENT = 1e-9
# Modes times guards, up to which it is tried which transitions lead to a mode.
MOST_TRANSITIONS = 128
SAME = 1e-9  # of the motion's size: a transition that moves the state by less leaves it where it is


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
        found = jnp.sum(strength > LOST_AT_EVENT * strength[0], dtype=jnp.int32)
        determinant = jnp.where(found < size, 0.0, jnp.linalg.det(matrix))
        return jnp.minimum(rank, found), product * determinant

    # A loop over the events there are: the log has room for many more.
    start = jnp.asarray(size, jnp.int32), jnp.ones(())
    return jax.lax.fori_loop(0, log.count, event, start)


def held_directions(
    system: AbstractHybridSystem, t: Any, y: PyTree, mode: Any, args: PyTree, unit: Array
) -> Float[Array, "size size"]:
    r"""Projection on the deviations that a mode allows, in parts of the size.

    A block that sticks has the belt's speed: deviations of its speed are none of the motion, though the
    field of the mode would carry them on for ever. Such a set is where transitions into the mode put
    the state, $y \in R(Y)$, so that its tangents are the range of $R_y$. All transitions that lead from
    anywhere to this mode, and leave this state where it is, are applied. Orbits with an event of this
    kind have the projection in their saltation matrices anyway. Not tried with more than 128 pairs of
    modes and guards, nor for a system that chooses its next mode in Python.
    """
    size = unit.shape[0]
    flat, unravel = ravel_pytree(y)
    guards, modes = len(system.guard_names), len(system.mode_names)
    projection = jnp.eye(size)
    if not guards or guards * modes > MOST_TRANSITIONS:
        return projection

    def jump(flat, number):
        after, found = system.transition(t, unravel(flat), number // guards, number % guards, args)
        return ravel_pytree(after)[0] + 0.0 * flat, jnp.asarray(found)

    numbers = jnp.arange(guards * modes, dtype=jnp.int32)
    after, found = jax.vmap(lambda n: jump(flat, n))(numbers)
    slopes = jax.vmap(lambda n: jax.jacfwd(lambda z: jump(z, n)[0])(flat))(numbers)
    stays = jnp.max(jnp.abs(after - flat[None, :]) / unit[None, :], axis=1) <= SAME
    used = stays & (found == mode) & jnp.all(jnp.isfinite(slopes), axis=(1, 2))
    slopes = slopes * unit[None, None, :] / unit[None, :, None]
    slopes = jnp.where(used[:, None, None], slopes, jnp.eye(size)[None])
    return jax.lax.fori_loop(0, guards * modes, lambda n, p: slopes[n] @ p, projection)
