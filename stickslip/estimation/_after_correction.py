"""The state and its mode where a measurement has moved it."""

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from ..hybrid.system import guard_directions
from ._with_spread import Spread, WithSpread


def after_correction(spread: WithSpread, t, lasts, before, after, mode, args):
    r"""State, matrix by which its deviations are changed, and mode.

    All stay as they are unless the move from `before` to `after` goes through a guard $g$, or further
    beyond one. The event was then $s = g/\dot g$ ago: the state flows back to it, through the
    transition and on again, and the matrix is that of saltation. An event that would have been more
    than `lasts` ago, or never, did not happen: the mode is that which `initial_mode` says.
    """
    system, signs = spread.system, guard_directions(spread.system)
    flat, unravel = ravel_pytree(after)
    still = jnp.eye(flat.size)
    if not signs:
        return flat, still, mode

    def guards(t, z):
        return jnp.stack([jnp.asarray(g, z.dtype) for g in system.guards(t, unravel(z), mode, args)])

    def field(y, mode):
        return ravel_pytree(system.vector_field(t, y, mode, args))[0]

    old, flow = guards(t, ravel_pytree(before)[0]), field(after, mode)
    new, rate = jax.jvp(guards, (t, flat), (jnp.ones_like(t), flow))
    sense = {"falling": 1.0, "rising": -1.0}
    sign = jnp.stack([sense.get(word, jnp.sign(old[i])) for i, word in enumerate(signs)])
    gone = (sign * new < 0.0) & (sign * new < sign * old)
    since = jnp.where(gone & (sign * rate < 0.0), new / jnp.where(rate == 0.0, 1.0, rate), -1.0)
    guard = jnp.argmax(since).astype(jnp.int32)
    happened = (since[guard] > 0.0) & (since[guard] <= lasts)
    ago = jnp.where(happened, since[guard], 0.0)
    start = Spread(unravel(flat - ago * flow), still, jnp.zeros_like(still), still)
    jumped, new_mode = spread.transition(t - ago, start, mode, guard, args)
    on = ravel_pytree(jumped.y)[0] + ago * field(jumped.y, new_mode)
    anew = jnp.where(jnp.any(gone), jnp.asarray(system.initial_mode(t, after, args), mode.dtype), mode)
    return (
        jnp.where(happened, on, flat),
        jnp.where(happened, jumped.transition, still),
        jnp.where(happened, jnp.asarray(new_mode, mode.dtype), anew),
    )
