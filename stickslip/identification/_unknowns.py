"""Named positive unknowns as one row of their logarithms."""

from collections.abc import Mapping
from typing import Any

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
