"""Sets of states at which nothing moves: where contacts hold what would move."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from .._jit_by_code import jit_by_code
from ._accuracy import ACCURACY


@jit_by_code
def _still_between(system, args, unravel, t, mode, one, others):
    def way(other):
        return still_between(system, args, unravel, t, mode, one, other)

    return jax.lax.map(way, others, batch_size=64)


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


def same_set(lanes: Any, t: float, mode: int, one: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which of the states at rest belong to the set of `one`: nothing moves on the way between."""
    size = 1 << max(len(others) - 1, 0).bit_length()
    rows = np.resize(others, (size, others.shape[1]))
    number = jnp.asarray(mode, lanes.mode_type)
    found = _still_between(lanes.system, lanes.args, lanes.unravel, t, number, one, rows)
    return np.asarray(found)[: len(others)]
