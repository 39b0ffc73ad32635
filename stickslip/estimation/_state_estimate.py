"""Means and covariances of the state along a motion, and of what is computed from it."""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int, PyTree

from .._show import amount
from .._types import Given
from .._validation import check_callable, check_mapping
from ..hybrid import AbstractHybridSystem, jit_plainly

Observe = Callable[[AbstractHybridSystem, Any, PyTree, Any, PyTree], Mapping[str, Any]]
Rows = dict[str, Float[Array, " time"]]
FORM = "f(system, t, y, mode, args) -> named scalars"


class StateEstimate(eqx.Module):
    """States at the stamps `t` [s]: `means` with their `modes`, and `covariances` in the order of the
    flattened state; NaN from where a run failed on."""

    t: Float[Array, " time"]
    means: PyTree
    covariances: Float[Array, "time n n"]
    modes: Int[Array, " time"]
    system: AbstractHybridSystem
    args: PyTree

    def __repr__(self) -> str:
        return f"StateEstimate: {amount(self.t.shape[-1], 'time')}"

    def sense(self, observables: Given[Observe]) -> tuple[Rows, Rows]:
        r"""Quantities that no sensor measures, with bands: a virtual sensor.

        **Argument** `observables(system, t, y, mode, args)`: named scalars, such as a friction force.
        **Returns** by name their values $h$ at the means, and their standard deviations
        $\sqrt{h_yPh_y^T}$; the mode is taken for certain. **Raises** `TypeError` for anything else.
        """
        check_callable("observables", observables, FORM, *range(5))
        return _sense(self, observables)


@jit_plainly
def _sense(estimate: StateEstimate, observables: Observe) -> tuple[Rows, Rows]:
    def one(t, y, covariance, mode):
        flat, unravel = ravel_pytree(y)

        def values(z):
            found = observables(estimate.system, t, unravel(z), mode, estimate.args)
            named = check_mapping("observables(system, t, y, mode, args)", found)
            return {name: jnp.asarray(a, jnp.float64) for name, a in named.items()}

        slopes = jax.jacfwd(values)(flat)
        squares = {name: slope @ covariance @ slope for name, slope in slopes.items()}
        return values(flat), {name: jnp.sqrt(jnp.maximum(a, 0.0)) for name, a in squares.items()}

    return jax.vmap(one)(estimate.t, estimate.means, estimate.covariances, estimate.modes)
