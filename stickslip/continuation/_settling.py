"""Whether a motion that Newton's method does not close goes to rest."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from ._accuracy import ACCURACY
from ._closing import Frame, Motion, states_and_period
from ._newton import Newton


def settles(motion: Motion, frame: Frame, found: Newton, unravel: Any, mode: Any) -> Any:
    """Whether a motion without events is nearly the linear one about a stable equilibrium.

    So near to it there is no periodic orbit. The motion has not shrunk where the plane of the first
    point does not contain the equilibrium, as a guess is in mid-swing.
    """
    carried, unit = found.carried, frame.size
    segments = carried.modes.shape[0]
    y, _ = states_and_period(found.u, frame, segments)

    def field(state):
        rates = motion.system.vector_field(frame.t0, unravel(state), mode, motion.args)
        return ravel_pytree(rates)[0] / unit

    def nearer(_, state):
        return state - unit * jnp.linalg.solve(jax.jacfwd(field)(state) * unit[None, :], field(state))

    rest = jax.lax.fori_loop(0, ACCURACY.rounds, nearer, y[0])
    begins, ends = (y - rest[None, :]) / unit[None, :], (carried.ends - rest[None, :]) / unit[None, :]
    pieces = carried.pieces
    # Within a small ball about the equilibrium the linear motion explains nearly all of the way.
    off = ends - jnp.einsum("kij,kj->ki", pieces, begins)
    linear = jnp.max(jnp.abs(off)) <= ACCURACY.swerves * jnp.max(jnp.abs(ends - begins))
    whole = jnp.eye(unit.shape[0])
    for piece in pieces:
        whole = piece @ whole
    growth = jnp.abs(jnp.linalg.eigvals(jnp.where(jnp.isfinite(whole), whole, 0.0)))
    one_mode = jnp.all(carried.num_events == 0) & jnp.all(carried.modes == mode)
    return linear & one_mode & jnp.all(growth < 1.0) & jnp.all(jnp.isfinite(rest))
