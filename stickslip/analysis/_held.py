"""Which deviations a mode allows: a contact that sticks has the speed of its surface."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from ..hybrid import AbstractHybridSystem

# Modes times guards, up to which it is tried which transitions lead to a mode.
MOST_TRANSITIONS = 512
SAME = 1e-9  # of its size: a transition that moves the state by less leaves it where it is


def held_directions(
    system: AbstractHybridSystem, t: Any, y: PyTree, mode: Any, args: PyTree, unit: Array
) -> Float[Array, "size size"]:
    r"""Projection on the deviations that a mode allows, in parts of the size.

    A block that sticks has the belt's speed: deviations of its speed are none of the motion, though the
    field of the mode would carry them on for ever. Such a set is where transitions into the mode put
    the state, $y \in R(Y)$, so that its tangents are the range of $R_y$. All transitions that lead from
    anywhere to this mode, and leave this state where it is, are applied. Orbits with an event of this
    kind have the projection in their saltation matrices anyway. Not tried with more than 512 pairs of
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
        return ravel_pytree(after)[0] + 0.0 * flat, jnp.asarray(found, jnp.asarray(mode).dtype)

    numbers = jnp.arange(guards * modes, dtype=jnp.int32)
    after, found = jax.vmap(lambda n: jump(flat, n))(numbers)
    slopes = jax.vmap(lambda n: jax.jacfwd(lambda z: jump(z, n)[0])(flat))(numbers)
    stays = jnp.all(jnp.abs(after - flat[None, :]) <= SAME * jnp.abs(flat)[None, :], axis=1)
    slopes = slopes * unit[None, None, :] / unit[None, :, None]
    # An impact that happens to find no speed leaves the state alone too, but it holds nothing.
    projects = jnp.max(jnp.abs(slopes @ slopes - slopes), axis=(1, 2)) <= SAME
    used = stays & (found == mode) & projects
    slopes = jnp.where(used[:, None, None], slopes, jnp.eye(size)[None])
    return jax.lax.fori_loop(0, guards * modes, lambda n, p: slopes[n] @ p, projection)
