"""Equations that may have no slope somewhere, with one of 0 there; borders where fields have none."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jax.lax import stop_gradient
from jaxtyping import PyTree

from .._jaxpr import bound
from .accuracy import ACCURACY

# Which operand of what may have no slope somewhere.
_OPERANDS = {
    "sqrt": 0, "rsqrt": 0, "cbrt": 0, "pow": 0, "integer_pow": 0, "log": 0, "log1p": 0, "div": 1,
    "asin": 0, "acos": 0, "acosh": 0, "atanh": 0,
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


def has_no_bound(system: Any, t: Any, y: PyTree, modes: Any, guard: Any, args: PyTree) -> Any:
    """Whether the slope of the field by the distance from a border has no bound there, in one of two
    modes: whether it grows towards it as that of a power below 0.8 does."""
    flat, back = ravel_pytree(y)

    def margin(flat):
        return jnp.stack(system.guards(t, back(flat), modes[0], args))[guard]

    value, normal = jax.value_and_grad(margin)(flat)
    size = jnp.sum(jnp.abs(normal * flat)) + jnp.abs(value)
    across = normal / jnp.maximum(jnp.sum(normal * normal), ACCURACY.tiny)

    border = flat - value * across

    def steepness(mode, distance):
        def field(flat):
            return ravel_pytree(system.vector_field(t, back(flat), mode, args))[0]

        return jnp.max(jnp.abs(jax.jvp(field, (border + distance * across,), (across,))[1]))

    # A motion that turns back before the border is some way from it. It was above in the mode before.
    distances = jnp.array([ACCURACY.edge, ACCURACY.same]) * size
    of_modes = jax.vmap(lambda m, d: jax.vmap(lambda x: steepness(m, x))(d))
    near, far = of_modes(modes, jnp.stack([distances, -distances])).T
    return jnp.any(near > (ACCURACY.same / ACCURACY.edge) ** 0.2 * far)
