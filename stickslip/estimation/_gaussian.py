"""A state that is known with a covariance."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, whole_state
from .._types import Given, Mode
from .._validation import (
    as_float64,
    check_nonnegative,
    is_concrete,
    leaves_of,
    numbers,
    refusal,
    shape_refusal,
)
from ..hybrid.accuracy import ACCURACY as ENGINE


class Gaussian(eqx.Module):
    """A normal distribution of states, to begin a filter with.

    **Arguments**

    - `mean`: the state, as `simulate` takes it.
    - `spread`: a state of standard deviations, of independent components; or a covariance matrix
      `[n, n]` in the order of the flattened state (`jax.flatten_util.ravel_pytree`), which of a
      mechanism has coordinates, states of first order, velocities.
    - `mode`: name or number; by default that of the mean. Deviations that the mode does not allow, as
      of the speed of a contact that sticks, are taken out of the covariance.

    **Raises** `TypeError`, `ValueError` for anything else.
    """

    mean: PyTree
    covariance: Float[Array, "n n"]
    mode: Any

    @check_arguments(mean=whole_state)
    def __init__(self, mean: PyTree, spread: PyTree, mode: Given[Mode | None] = None):
        self.mean, self.mode = as_float64("mean", mean), mode
        size = sum(np.size(leaf) for leaf in jax.tree.leaves(self.mean))
        allowed = f"a state like mean, of standard deviations, or a matrix of shape {(size, size)}"
        if shapes_of(spread) == shapes_of(self.mean):
            deviations = check_not_negative("spread", as_float64("spread", spread))
            self.covariance = jnp.diag(ravel_pytree(deviations)[0] ** 2)
            return
        if is_concrete(spread):
            spread = as_float64("spread", numbers("spread", spread, allowed))
        if np.shape(spread) != (size, size):
            raise shape_refusal("spread", spread, allowed)
        if is_concrete(spread):
            # Each component in a unit of its own, so that a small one counts as much as the others.
            unit = np.sqrt(np.maximum(np.diag(spread), ENGINE.tiny))
            matrix = spread / np.outer(unit, unit)
            symmetric = np.max(np.abs(matrix - matrix.T)) <= ENGINE.zero
            if not symmetric or np.linalg.eigvalsh(matrix)[0] < -ENGINE.zero * size:
                raise refusal("spread", spread, "symmetric, and positive semidefinite")
        self.covariance = jnp.asarray(spread)


def shapes_of(tree: PyTree) -> Any:
    """Structure of a state and shapes of its components: what two states have in common."""
    return jax.tree.structure(tree), [np.shape(leaf) for leaf in jax.tree.leaves(tree)]


def check_not_negative(name: str, state: PyTree) -> PyTree:
    """A state of numbers from zero on."""
    for where, leaf in leaves_of(name, state):
        check_nonnegative(where, leaf)
    return state
