"""A state that is known with a covariance."""

from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, whole_state
from .._types import Given, Mode, Rows
from .._validation import as_float64, as_parameter, check_finite, is_concrete, refusal, shape_refusal
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._with_spread import flat_size


class Gaussian(eqx.Module):
    """A normal distribution of states, to begin a filter with.

    **Arguments**

    - `mean`: the state, as `simulate` takes it.
    - `covariance`: matrix `[n, n]` in the order of the flattened state
      (`jax.flatten_util.ravel_pytree`), symmetric and not negative.
    - `mode`: name or number; by default that of the mean. Deviations that the mode does not allow, as
      of the speed of a contact that sticks, are taken out of the covariance.

    **Raises** `TypeError`, `ValueError` for anything else.
    """

    mean: PyTree
    covariance: Float[Array, "n n"]
    mode: Any

    @check_arguments(mean=whole_state)
    def __init__(self, mean: PyTree, covariance: Rows, mode: Given[Mode | None] = None):
        self.mean = as_float64("mean", mean)
        size = flat_size(self.mean)
        check_finite("covariance", covariance)
        if np.shape(covariance) != (size, size):
            raise shape_refusal("covariance", covariance, f"of shape {(size, size)}")
        if is_concrete(covariance):
            matrix = np.asarray(covariance, float)
            largest = np.max(np.abs(matrix))
            if np.max(np.abs(matrix - matrix.T)) > ENGINE.zero * largest:
                raise refusal("covariance", matrix.tolist(), "symmetric")
            scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
            scale = np.where(scale > 0.0, scale, 1.0)
            if np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0] < -ENGINE.zero * size:
                raise refusal("covariance", matrix.tolist(), "positive semidefinite")
        self.covariance = as_parameter(covariance)
        self.mode = mode
