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
    as_parameter,
    check_finite,
    check_nonnegative,
    is_concrete,
    leaves_of,
    refusal,
    shape_refusal,
)
from ..hybrid.accuracy import ACCURACY as ENGINE


class Gaussian(eqx.Module):
    """A normal distribution of states, to begin a filter with.

    **Arguments**

    - `mean`: the state, as `simulate` takes it.
    - `spread`: a state of standard deviations, not negative, of independent components; or a
      covariance matrix `[n, n]`, symmetric and not negative, in the order of the flattened state
      (`jax.flatten_util.ravel_pytree`): that of a mechanism has coordinates, states of first order,
      velocities.
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
        size = ravel_pytree(self.mean)[0].size
        if shapes_of(spread) == shapes_of(self.mean):
            for where, deviation in leaves_of("spread", spread):
                check_nonnegative(where, deviation)
            deviations = ravel_pytree(jax.tree.map(as_parameter, spread))[0]
            self.covariance = jnp.diag(deviations**2)
            return
        check_finite("spread", spread)
        if np.shape(spread) != (size, size):
            allowed = f"a state of standard deviations, or a matrix of shape {(size, size)}"
            raise shape_refusal("spread", spread, allowed)
        if is_concrete(spread):
            _check_covariance(np.asarray(spread, float))
        self.covariance = as_parameter(spread)


def shapes_of(tree: PyTree) -> Any:
    """Structure of a state and the shapes of its components: what two states have in common."""
    return jax.tree.structure(tree), [np.shape(leaf) for leaf in jax.tree.leaves(tree)]


def _check_covariance(matrix: np.ndarray) -> None:
    # Each component in a unit of its own, so that a small one counts as much as the others.
    deviations = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    unit = np.where(deviations > 0.0, deviations, 1.0)
    correlations = matrix / np.outer(unit, unit)
    if np.max(np.abs(correlations - correlations.T)) > ENGINE.zero:
        raise refusal("spread", matrix.tolist(), "symmetric")
    if np.linalg.eigvalsh(correlations)[0] < -ENGINE.zero * len(matrix):
        raise refusal("spread", matrix.tolist(), "positive semidefinite")
