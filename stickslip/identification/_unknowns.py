"""Named positive unknowns as one row of their logarithms."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._validation import as_parameter, check_positive, misshaped, refusal

NamedValues = dict[str, Any]


def checked(name: str, values: Any) -> NamedValues:
    """A mapping of names to positive numbers or rows of them, in alphabetical order."""
    if not isinstance(values, Mapping) or not values or not all(isinstance(k, str) for k in values):
        raise refusal(name, values, "a mapping from names to positive numbers, not empty", TypeError)
    return {
        key: as_parameter(check_positive(f"{name}[{key!r}]", value))
        for key, value in sorted(values.items())
    }


def scalars(name: str, values: Any) -> NamedValues:
    """A mapping of names to one positive number each."""
    found = checked(name, values)
    for key, value in found.items():
        if value.shape != ():
            raise misshaped(f"{name}[{key!r}]", values[key], "one number (many_starts takes rows)")
    return found


def to_logs(values: NamedValues) -> Float[Array, "*batch unknown"]:
    """Logarithms, the last axis the unknown."""
    return jnp.log(jnp.stack([values[name] for name in sorted(values)], axis=-1))


def from_logs(names: tuple[str, ...], logs: Float[Array, "*batch unknown"]) -> NamedValues:
    """Values by name; the inverse of `to_logs`."""
    return {name: jnp.exp(logs[..., i]) for i, name in enumerate(names)}
