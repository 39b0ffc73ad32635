"""Shifts of the state that change nothing: the place of what no spring and no wall holds."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from ..hybrid import AbstractHybridSystem
from ._accuracy import ACCURACY


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
    columns = echelon(jnp.where(strength[None, :] <= ACCURACY.unchanged, right.T, 0.0) @ right)

    now = values(ts, states, modes)
    known = jnp.isfinite(now)
    largest = jnp.max(jnp.where(known, jnp.abs(now), 0.0), axis=0)

    shifts, number = jnp.asarray(ACCURACY.shifts), len(ACCURACY.shifts)

    def nothing_changes(column):
        moved = (states[None] + shifts[:, None, None] * (column * size)[None, None]).reshape(-1, count)
        times, where = jnp.tile(ts, number), jnp.tile(modes, number)
        away = jnp.abs(values(times, moved, where) - jnp.tile(now, (number, 1)))
        same = away <= ACCURACY.unchanged * largest[None, :]
        return jnp.all(same | ~jnp.tile(known, (number, 1)))

    kept = jax.lax.map(nothing_changes, columns.T) & jnp.all(jnp.isfinite(states))
    return jnp.where(kept[None, :], columns, 0.0)


def echelon(projection: Float[Array, "size size"]) -> Float[Array, "size size"]:
    """Columns that span what a projection leaves, of few components each; the others are zero."""

    def step(i, carry):
        left, columns = carry
        column = left[:, i]
        new = column[i] > ACCURACY.unchanged
        part = jnp.where(new, jnp.outer(column, column) / jnp.where(new, column[i], 1.0), 0.0)
        column = column / jnp.where(new, jnp.max(jnp.abs(column)), 1.0)
        column = jnp.where(new & (jnp.abs(column) > ACCURACY.unchanged), column, 0.0)
        return left - part, columns.at[:, i].set(column)

    size = projection.shape[0]
    return jax.lax.fori_loop(0, size, step, (projection, jnp.zeros((size, size))))[1]


def projection_on(columns: Float[Array, "size size"]) -> Float[Array, "size size"]:
    """Orthogonal projection on what columns span, of which some may be zero."""
    left, strength, _ = jnp.linalg.svd(columns)
    return jnp.where(strength[None, :] > ACCURACY.unchanged, left, 0.0) @ left.T
