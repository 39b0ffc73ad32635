"""Sets of states at which nothing moves: where contacts hold what would move."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from .._jit_by_code import jit_by_code
from ._accuracy import ACCURACY


def still_between(system, args, unravel, t, mode, one, other):
    """Whether nothing moves, in the same mode, anywhere on the way from a state to another."""
    part = jnp.linspace(0.0, 1.0, ACCURACY.many)[1:-1, None]

    def at(y):
        state = unravel(y)
        slope = ravel_pytree(system.vector_field(t, state, mode, args))[0]
        return jnp.all(slope == 0.0) & (
            jnp.asarray(system.initial_mode(t, state, args), mode.dtype) == mode
        )

    return jnp.all(jax.vmap(at)(one[None, :] + part * (other - one)[None, :]))


@jit_by_code
def _still_at(system, args, unravel, t, mode, y):
    return still_between(system, args, unravel, t, mode, y, y)


def rests_at(lanes: Any, mode: int, y: np.ndarray) -> bool:
    """Whether nothing moves at a state."""
    given = lanes.system, lanes.args, lanes.unravel, jnp.asarray(0.0)
    return bool(_still_at(*given, jnp.asarray(mode, lanes.mode_type), y))
