r"""Which combinations of the unknowns the data can see."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._argument_checks import callable_as, check_arguments
from .._show import number
from .._validation import is_concrete
from ._accuracy import ACCURACY
from ._evaluate import evaluation
from ._unknowns import NamedUnknowns, NamedValues, scalars


class Sensitivity(eqx.Module):
    r"""Scaled sensitivity $S_{ij} = \partial r_i/\partial\ln p_j$ and what follows from it.

    With residuals in units of their standard deviation, $\|S\,\delta\|^2$ is the information on a
    small relative change $\delta$ of the unknowns. Its singular value decomposition
    $S = U\,\mathrm{diag}(s)\,V^T$ sorts the combinations $\prod_j p_j^{V_{jk}}$ of unknowns by how
    well they are seen: the standard error of the logarithm of the $k$-th is $1/s_k$.

    For an `Unknown` with other bounds than `(0, None)` its coordinate stands in place of $\ln p_j$.

    - `names` of the unknowns, in alphabetical order; `matrix` $S$.
    - `singular_values` $s$, falling; `directions` $V^T$, a row each.

    Source: Golub & Van Loan, Matrix Computations, section 5.5.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    matrix: Float[Array, "*batch row unknown"]
    singular_values: Float[Array, "*batch unknown"]
    directions: Float[Array, "*batch unknown unknown"]

    def __init__(self, names: tuple[str, ...], matrix: Float[Array, "*batch row unknown"]):
        self.names = names
        self.matrix = matrix
        # Rows of zeros change no singular value and make room for one per unknown.
        short = max(len(names) - matrix.shape[-2], 0)
        padding = [(0, 0)] * (matrix.ndim - 2) + [(0, short), (0, 0)]
        _, self.singular_values, self.directions = jnp.linalg.svd(
            jnp.pad(matrix, padding), full_matrices=False
        )

    def __repr__(self) -> str:
        names = ", ".join(self.names)
        if not is_concrete(self):
            return f"Sensitivity(traced, to {names})"
        text = f"Sensitivity of {self.matrix.shape[-2]:,} residuals to {names}"
        if self.matrix.ndim > 2:
            return f"{text}, of shape {self.matrix.shape[:-2]}"
        return f"{text}; singular values {', '.join(number(s) for s in self.singular_values)}"

    def seen_directions(self) -> Bool[Array, "*batch unknown"]:
        """Which combinations are seen: singular values above 1e-7 of the largest."""
        return self.singular_values > ACCURACY.seen * self.singular_values[..., :1]

    def covariance(self) -> Float[Array, "*batch unknown unknown"]:
        r"""Covariance $(S^T S)^{-1}$ of the logarithms, to first order.

        Combinations that are not `seen` are left out of the sum; the unknowns that they contain have
        no finite variance, see `relative_standard_errors`.
        """
        seen = self.seen_directions()
        weight = jnp.where(seen, 1.0 / jnp.where(seen, self.singular_values, 1.0) ** 2, 0.0)
        return jnp.einsum("...ki,...k,...kj->...ij", self.directions, weight, self.directions)

    def relative_standard_errors(self) -> NamedValues:
        """Standard error of every unknown in parts of its value: that of its logarithm.

        Infinite if the unknown is in a combination not seen. In units: `Fit.standard_errors`.
        """
        return errors_of(self, self.covariance())


def errors_of(sensitivity: Sensitivity, covariance: Array) -> NamedValues:
    """Roots of the diagonal of a covariance of the logarithms; infinite for an unknown in a combination
    not seen."""
    hidden = jnp.where(sensitivity.seen_directions()[..., None], 0.0, jnp.abs(sensitivity.directions))
    lost = jnp.max(hidden, axis=-2) > ACCURACY.part
    variance = jnp.diagonal(covariance, axis1=-2, axis2=-1)
    errors = jnp.where(lost, jnp.inf, jnp.sqrt(variance))
    return {name: errors[..., i] for i, name in enumerate(sensitivity.names)}


@check_arguments(residual=callable_as("f(values)", {}))
def sensitivity(residual: Callable[[NamedValues], Any], values: NamedUnknowns) -> Sensitivity:
    """`Sensitivity` of the residuals at `values`, by forward mode through all events.

    **Arguments:** `residual(values)`, one row of residuals in units of their standard deviation, e.g.
    `(model - data) / sigma`; `values`, positive numbers or `Unknown`s by name. **Raises**
    `TypeError`, `ValueError` for anything else. Works under `jit` and `vmap`.
    """
    space, found = scalars("values", values)
    return Sensitivity(space.names, evaluation(residual, space)(space.coordinates(found))[1])
