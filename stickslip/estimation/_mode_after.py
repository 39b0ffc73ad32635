"""The mode of a state that a measurement has moved."""

import jax.numpy as jnp

from ..hybrid.system import guard_directions


def mode_after(system, t, before, after, mode, args):
    """The same, unless the move from `before` to `after` goes through a guard, or further beyond one:
    then that which `initial_mode` says, as at a start."""
    guards = [system.guards(t, y, mode, args) for y in (before, after)]
    gone = jnp.zeros((), bool)
    for old, new, direction in zip(*guards, guard_directions(system), strict=True):
        sign = {"falling": 1.0, "rising": -1.0, "both": jnp.sign(old)}[direction]
        gone = gone | ((sign * new < 0.0) & (sign * new < sign * old))
    return jnp.where(gone, jnp.asarray(system.initial_mode(t, after, args), mode.dtype), mode)
