"""States on what a mode holds: speeds of contacts that stick, gaps of closed stops."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from ..hybrid import AbstractHybridSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import first_mode
from ..hybrid.event_functions import guards_over_magnitudes
from ..hybrid.system import guard_directions, mode_type
from ..hybrid.tree import frozen


def _constraints(system: AbstractHybridSystem, t, flat, unravel, mode, args) -> Array | None:
    found = system.constraints(t, unravel(flat), mode, args)
    if found is None:
        return None
    return jnp.stack([0.0 * flat[0], *(jnp.asarray(c, flat.dtype) + 0.0 * flat[0] for c in found)])


def holds(system: AbstractHybridSystem, args: PyTree, y: PyTree) -> bool:
    """Whether a system says what its modes hold."""
    mode = jnp.zeros((), mode_type(system))
    return jax.eval_shape(lambda y: system.constraints(jnp.zeros(()), y, mode, args), y) is not None


def on_constraints(
    system: AbstractHybridSystem, t: Any, flat: Array, unravel: Any, mode: Any, args: PyTree
) -> Array:
    r"""The state moved to where the numbers $c(t, y)$ are zero that its mode holds, if these are known.

    Along the normals $c_y$, one after the other, each made orthogonal to those before. A component that
    alone is held gets its value to the last digit, which rounding of the others does not touch. The
    derivative by the state is the projection on what the mode allows, and that by parameters is theirs.
    """
    values = _constraints(system, t, flat, unravel, mode, args)
    if values is None:
        return flat
    still, time, start, given = frozen((system, t, flat, args))
    normals = jax.jacfwd(lambda z: _constraints(still, time, z, unravel, mode, given))(start)
    projection, state = jnp.eye(flat.size), flat
    for normal, value in zip(normals, values, strict=True):
        value = value + normal @ (state - flat)
        largest = jnp.max(jnp.abs(normal))
        normal = normal / jnp.where(largest > 0.0, largest, 1.0)
        left = projection @ (projection @ normal)
        length = left @ left
        # A constraint of which the others leave no more than rounding is one of them.
        new = length > ENGINE.zero**2 * (normal @ normal)
        length = jnp.where(new, length, 1.0)
        state = state - jnp.where(new, left * (value / (jnp.where(new, largest, 1.0) * length)), 0.0)
        projection = projection - jnp.where(new, jnp.outer(left, left) / length, 0.0)
    return state


def own_mode(
    system: AbstractHybridSystem, t: Any, flat: Array, unravel: Any, mode: Any, args: PyTree, size: Any
) -> Array:
    """The mode that the system gives to a state; or `mode` where the state is in it but for rounding.

    By no more than rounding a contact that sticks all the time has another speed than its surface, and
    would be taken to slip. It sticks if what its mode holds is held and no guard of it is violated.
    """
    own = first_mode(system, t, unravel(flat), args)
    values = _constraints(system, t, flat, unravel, mode, args)
    if values is None or not system.guard_names:
        return own
    normals = jax.jacfwd(lambda z: _constraints(system, t, z, unravel, mode, args))(flat)
    held = jnp.all(jnp.abs(values) <= ENGINE.solved * (jnp.abs(normals) @ size))
    guards = guards_over_magnitudes(system, t, unravel(flat), mode, args)
    sides = jnp.asarray([-1.0 if d == "rising" else 1.0 for d in guard_directions(system)])
    both = jnp.asarray([d == "both" for d in guard_directions(system)])
    falls = jnp.where(both, jnp.abs(guards), sides * guards)
    return jnp.where(held & jnp.all(falls >= -ENGINE.slack), mode, own).astype(own.dtype)
