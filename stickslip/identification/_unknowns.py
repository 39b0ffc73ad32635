"""Named positive unknowns as one row of their logarithms."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._validation import as_parameter, check_positive

Values = dict[str, Any]


def checked(name: str, values: Any) -> Values:
    """A mapping of names to positive scalars, in alphabetical order."""
    if not isinstance(values, Mapping) or not values:
        raise TypeError(f"{name} = {values!r}: it must be a mapping of names to positive numbers.")
    return {
        key: as_parameter(check_positive(f"{name}[{key!r}]", value))
        for key, value in sorted(values.items())
    }


def to_logs(values: Values) -> Float[Array, "*batch unknown"]:
    """Logarithms, the last axis the unknown."""
    return jnp.log(jnp.stack([values[name] for name in sorted(values)], axis=-1))


def from_logs(names: tuple[str, ...], logs: Float[Array, "*batch unknown"]) -> Values:
    """Values by name; the inverse of `to_logs`."""
    return {name: jnp.exp(logs[..., i]) for i, name in enumerate(names)}


def with_forward_slope(function: Any) -> Any:
    """`function` of one row whose derivative is its Jacobian by forward mode, computed with the value.

    What linearises it then runs the simulation once, instead of once more for every product with the
    Jacobian.
    """

    def both(z):
        def twice(z):
            out = function(z)
            return out, out

        slope, out = jax.jacfwd(twice, has_aux=True)(z)
        return out, slope

    wrapped = jax.custom_jvp(function)

    @wrapped.defjvp
    def _(primals, tangents):
        (z,), (dz,) = primals, tangents
        out, slope = both(z)
        return out, slope @ dz

    return wrapped
