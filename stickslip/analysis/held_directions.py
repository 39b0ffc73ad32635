"""Which deviations a mode allows: a contact that sticks has the speed of its surface."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from ..hybrid import AbstractHybridSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY


def held_directions(
    system: AbstractHybridSystem,
    t: Any,
    y: PyTree,
    mode: Any,
    args: PyTree,
    unit: Float[Array, " size"],
    moving: Float[Array, " size"],
) -> Float[Array, "size size"]:
    r"""Projection on the deviations that a mode allows, in parts of the size.

    A block that sticks has the belt's speed: deviations of its speed are none of the motion, though the
    field of the mode would carry them on for ever. A system says which numbers $c(t, y)$ are zero in a
    mode (`constraints`): deviations allowed are those with $c_y\,\delta = 0$. Of a system that does
    not say it, the transitions are asked. Orbits with an event of this kind have the projection in
    their saltation matrices anyway.

    `unit`: the size of each component; `moving`: 1 for those that deviate, 0 for the others, which the
    projection leaves zero.
    """
    flat, unravel = ravel_pytree(y)

    def held(z):
        found = system.constraints(t, unravel(z), mode, args) or ()
        return jnp.stack([0.0 * z[0], *(jnp.asarray(c, flat.dtype) + 0.0 * z[0] for c in found)])

    asked = jax.eval_shape(lambda z: system.constraints(t, unravel(z), mode, args), flat)
    if not flat.size or asked is None:
        return moving[:, None] * _by_transitions(system, t, flat, unravel, mode, args, unit)
    normals = jax.jacfwd(held)(flat)
    return moving[:, None] * _beside(normals * (unit * moving)[None, :])


def _beside(normals: Float[Array, "constraint size"]) -> Float[Array, "size size"]:
    """Orthogonal projection on what is orthogonal to all rows, of which some may depend on others.

    By Gram and Schmidt: a component that alone is held is exactly zero afterwards.
    """

    def without(number, projection):
        normal = normals[number]
        largest = jnp.max(jnp.abs(normal))
        normal = normal / jnp.where(largest > 0.0, largest, 1.0)
        # Twice: what rounding leaves of a nearly dependent row is not orthogonal to the others.
        left = projection @ (projection @ normal)
        length = left @ left
        new = length > ENGINE.zero**2 * (normal @ normal)
        change = jnp.outer(left, left) / jnp.where(new, length, 1.0)
        return projection - jnp.where(new, change, 0.0)

    size = normals.shape[1]
    return jax.lax.fori_loop(0, normals.shape[0], without, jnp.eye(size))


def _by_transitions(system, t, flat, unravel, mode, args, unit) -> Float[Array, "size size"]:
    r"""Product of the projections that the transitions into this mode are.

    A set such as that of a stick is where transitions into the mode put the state, $y \in R(Y)$, so
    that its tangents are the range of $R_y$. All transitions that lead from anywhere to this mode, and
    leave this state where it is, are applied.
    """
    size = unit.shape[0]
    guards, modes = len(system.guard_names), len(system.mode_names)
    pairs = guards * modes

    def jump(flat, number):
        after, found = system.transition(t, unravel(flat), number // guards, number % guards, args)
        return ravel_pytree(after)[0] + 0.0 * flat, jnp.asarray(found, jnp.asarray(mode).dtype)

    def some(projection, numbers):
        after, found = jax.vmap(lambda n: jump(flat, n))(numbers)
        slopes = jax.vmap(lambda n: jax.jacfwd(lambda z: jump(z, n)[0])(flat))(numbers)
        stays = jnp.all(jnp.abs(after - flat[None, :]) <= ENGINE.zero * jnp.abs(flat)[None, :], axis=1)
        slopes = slopes * unit[None, None, :] / unit[None, :, None]
        # An impact that happens to find no speed leaves the state alone too, but it holds nothing.
        projects = jnp.max(jnp.abs(slopes @ slopes - slopes), axis=(1, 2)) <= ENGINE.zero
        used = stays & (found == mode) & projects
        slopes = jnp.where(used[:, None, None], slopes, jnp.eye(size)[None])
        return jax.lax.fori_loop(0, len(numbers), lambda n, p: slopes[n] @ p, projection), None

    if not pairs:
        return jnp.eye(size)
    width = min(pairs, ACCURACY.side_by_side)
    rows = -(-pairs // width)
    # The last ones are tried twice where they do not come out even, which changes nothing.
    numbers = jnp.minimum(jnp.arange(rows * width, dtype=jnp.int32), pairs - 1).reshape(rows, width)
    return jax.lax.scan(some, jnp.eye(size), numbers)[0]
