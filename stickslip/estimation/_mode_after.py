"""The mode of a state that a measurement has moved."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import PyTree

from ..hybrid import AbstractHybridSystem
from ..hybrid.system import guard_directions


def mode_after(
    system: AbstractHybridSystem, t: Any, before: PyTree, after: PyTree, mode: Any, args: PyTree
) -> Any:
    """The same, unless the move goes through a guard, or further beyond one: then that which
    `initial_mode` says, as at a start."""
    guards = [system.guards(t, y, mode, args) for y in (before, after)]
    gone = [jnp.zeros((), bool)]
    for old, new, direction in zip(*guards, guard_directions(system), strict=True):
        sign = {"falling": 1.0, "rising": -1.0, "both": jnp.sign(old)}[direction]
        gone.append((sign * new < 0.0) & (sign * new < sign * old))
    anew = jnp.asarray(system.initial_mode(t, after, args), mode.dtype)
    return jnp.where(jnp.any(jnp.stack(gone)), anew, mode)
