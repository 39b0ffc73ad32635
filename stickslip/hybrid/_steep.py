"""Equations of a program that may have no slope somewhere, with a slope of 0 there."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient

from .._jaxpr import bound

# Which operand of what may have no slope somewhere.
_OPERANDS = {
    "sqrt": 0, "rsqrt": 0, "cbrt": 0, "pow": 0, "integer_pow": 0, "log": 0, "log1p": 0, "div": 1,
    "asin": 0, "acos": 0, "atanh": 0,
}  # fmt: skip


def steep_operand(eqn: Any) -> int | None:
    """Number of the operand by which an equation may have no slope, as a root has none at 0."""
    place = _OPERANDS.get(eqn.primitive.name)
    if eqn.params.get("y", -1) >= 0 and eqn.primitive.name == "integer_pow":
        return None
    return place if jnp.issubdtype(eqn.outvars[0].aval.dtype, jnp.floating) else None


def gently(eqn: Any, values: Sequence, place: int) -> list:
    """Results with a slope of 0 where there is none by the operand at `place`.

    `where(d > 0, sqrt(where(d > 0, d, 1)) * d, 0)` is smooth from its border on, where `sqrt` is not.
    Without a value below zero it has that at zero, so that fields go on beyond a border.
    """

    def of(x: Any) -> Any:
        return bound(eqn, [x if i == place else value for i, value in enumerate(values)])[0]

    x = stop_gradient(values[place])
    has_slope = jnp.isfinite(jax.jvp(of, (x,), (jnp.ones_like(x),))[1])
    ends = jnp.maximum(x, 0.0) if eqn.primitive.name in ("sqrt", "pow") else x
    smooth = of(jnp.where(has_slope, values[place], 0.5))
    return [jnp.where(has_slope, smooth, stop_gradient(of(ends)))]
