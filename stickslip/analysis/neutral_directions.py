"""Shifts of the state that change nothing: the place of what no spring and no wall holds."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from ..hybrid import AbstractHybridSystem

# Bounds on the derivatives along a shift, in parts of the largest: below the first it is one that may
# change nothing; a component with less of it has no part in it.
WEAK, NONE = 1e-8, 1e-7
# Sizes of the motion by which a state is shifted to see whether anything changes, and the largest
# change, in parts of what is largest along the motion, that is rounding.
SHIFTS, SAME = (0.37, -31.7, 1234.5), 1e-7


def neutral_shifts(
    system: AbstractHybridSystem,
    args: PyTree,
    ts: Float[Array, " sample"],
    states: Float[Array, "sample size"],
    modes: Any,
    unravel: Any,
    size: Float[Array, " size"],
) -> Float[Array, "size size"]:
    r"""Constant shifts $n$ of the state with $f(t, y + sn) = f(t, y)$, and guards alike, in columns.

    In parts of the size of each component; columns that are zero are none. They are the common kernel
    of the derivatives along a motion, of `ts`, `states`, `modes`, if nothing changes far away either: a
    wall that the motion does not reach holds a place. Transitions are not asked.
    """

    def acting(t, flat, mode):
        y, mode = unravel(flat), jnp.maximum(mode, 0)
        slope = system.vector_field(t, y, mode, args)
        guards = [jnp.asarray(g, jnp.float64) for g in system.guards(t, y, mode, args)]
        return jnp.concatenate([ravel_pytree(slope)[0], *(jnp.ravel(g) for g in guards)])

    values = jax.vmap(acting)
    rows = jax.vmap(jax.jacfwd(acting, argnums=1))(ts, states, modes) * size[None, None, :]
    rows = jnp.where(jnp.isfinite(rows), rows, 0.0)
    strongest = jnp.max(jnp.sum(jnp.abs(rows), axis=2), axis=0)
    rows = rows / jnp.where(strongest > 0.0, strongest, 1.0)[None, :, None]
    count = size.shape[0]
    rows = jnp.concatenate([rows.reshape(-1, count), jnp.zeros((count, count))])
    _, strength, right = jnp.linalg.svd(rows, full_matrices=False)
    columns = echelon(jnp.where(strength[None, :] <= WEAK, right.T, 0.0) @ right)

    now = values(ts, states, modes)
    known = jnp.isfinite(now)
    largest = jnp.max(jnp.where(known, jnp.abs(now), 0.0), axis=0)

    def nothing_changes(column):
        moved = (
            states[None] + jnp.asarray(SHIFTS)[:, None, None] * (column * size)[None, None]
        ).reshape(-1, count)
        times, where = jnp.tile(ts, len(SHIFTS)), jnp.tile(modes, len(SHIFTS))
        away = jnp.abs(values(times, moved, where) - jnp.tile(now, (len(SHIFTS), 1)))
        return jnp.all((away <= SAME * largest[None, :]) | ~jnp.tile(known, (len(SHIFTS), 1)))

    kept = jax.lax.map(nothing_changes, columns.T) & jnp.all(jnp.isfinite(states))
    return jnp.where(kept[None, :], columns, 0.0)


def echelon(projection: Float[Array, "size size"]) -> Float[Array, "size size"]:
    """Columns that span what a projection leaves, of few components each; the others are zero."""

    def step(i, carry):
        left, columns = carry
        column = left[:, i]
        new = column[i] > NONE
        part = jnp.where(new, jnp.outer(column, column) / jnp.where(new, column[i], 1.0), 0.0)
        column = column / jnp.where(new, jnp.max(jnp.abs(column)), 1.0)
        column = jnp.where(new & (jnp.abs(column) > NONE), column, 0.0)
        return left - part, columns.at[:, i].set(column)

    size = projection.shape[0]
    return jax.lax.fori_loop(0, size, step, (projection, jnp.zeros((size, size))))[1]


def projection_on(columns: Float[Array, "size size"]) -> Float[Array, "size size"]:
    """Orthogonal projection on what columns span, of which some may be zero."""
    left, strength, _ = jnp.linalg.svd(columns)
    return jnp.where(strength[None, :] > NONE, left, 0.0) @ left.T
