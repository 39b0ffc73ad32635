"""What a fit returns."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._looks_at import looks_at, not_negative_number
from .._types import Numeric
from ._sensitivity import Sensitivity
from ._unknowns import NamedValues


class Fit(eqx.Module):
    """Estimates and how far to trust them; under `vmap` every array has the batch axes in front.

    - `values`: the estimates by name. `residual` there, in units of its standard deviation.
    - `sensitivity`: at the estimate. `steps`: iterations. `successful`: whether it converged.
    """

    values: dict[str, Float[Array, "*batch"]]
    residual: Float[Array, "*batch row"]
    sensitivity: Sensitivity
    steps: Int[Array, "*batch"]
    successful: Bool[Array, "*batch"]

    @property
    def cost(self) -> Float[Array, "*batch"]:
        r"""$\tfrac12\|r\|^2$; infinite where the residual is not finite."""
        cost = 0.5 * jnp.sum(self.residual**2, axis=-1)
        return jnp.where(jnp.isfinite(cost), cost, jnp.inf)

    @property
    def reduced_chi_squared(self) -> Float[Array, "*batch"]:
        r"""$\|r\|^2/(n - p)$ of $n$ residuals and $p$ unknowns; near 1 if the noise is as assumed."""
        return 2.0 * self.cost / (self.residual.shape[-1] - len(self.sensitivity.names))

    @looks_at(threshold=not_negative_number)
    def standard_errors(self, threshold: Numeric = 1e-7) -> NamedValues:
        """Standard error of every estimate, in its own unit; infinite if the data do not see it."""
        relative = self.sensitivity.standard_errors(threshold)
        return {name: relative[name] * self.values[name] for name in relative}
