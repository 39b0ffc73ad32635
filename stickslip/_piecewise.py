"""Forces in pieces: functions that bend where a play, a limit or a stop is reached."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Real

from ._argument_checks import reals
from ._validation import check_at_least, check_nonnegative

Number = Real[ArrayLike, "..."]


def positive_part(x: Number) -> Float[Array, "..."]:
    r"""$\max(x, 0)$, of any shape and unit: a stop or a rope, which pushes or pulls one way only.

    A soft stop at 20 mm, for example, which a mass goes into and leaves. A run lands on both instants,
    so that its derivatives are exact:

    >>> from typing import Any
    >>> import jax
    >>> import stickslip as ss
    >>> from stickslip.systems import Motion
    >>> class Soft(ss.AbstractSmoothSystem):
    ...     stiffness: Any
    ...     def vector_field(self, t, y, mode, args):
    ...         return Motion(x=y.v, v=-y.x - self.stiffness * ss.positive_part(y.x - 0.02))
    >>> def end(x):
    ...     return ss.simulate(Soft(1e3), 0.0, 10.0, Motion(x=x, v=0.0)).y1.x
    >>> print(f"{jax.grad(end)(-0.3):.6f}")
    1.041461

    So is everything else that a field compares by `jnp.maximum`, `jnp.where`, `jnp.clip`, `jnp.interp`
    or `jax.lax.cond`. **Errors** `TypeError` for what is not a number.
    """
    return jnp.maximum(_floating("x", x), 0.0)


def absolute(x: Number) -> Float[Array, "..."]:
    r"""$|x|$, of any shape and unit. **Errors** `TypeError` for what is not a number."""
    return jnp.abs(_floating("x", x))


def saturate(x: Number, low: Number, high: Number) -> Float[Array, "..."]:
    r"""$\min(\max(x, \mathrm{low}), \mathrm{high})$, in the unit of all three: a limited drive.

    **Errors** `TypeError` for what is not a number, `ValueError` if `high` is below `low`.
    """
    x, low, high = _floating("x", x), _floating("low", low), _floating("high", high)
    return jnp.minimum(jnp.maximum(x, low), check_at_least("high", high, "low", low))


def backlash(x: Number, gap: Number) -> Float[Array, "..."]:
    r"""Deflection of a spring behind a play of `gap` in all, in the unit of both.

    $$x - \min\left(\max\left(x, -\tfrac12\mathrm{gap}\right), \tfrac12\mathrm{gap}\right)$$

    0 while $|x| \le \frac12$`gap`; beyond, how far `x` is past the flank. The force in a coupling of
    stiffness $k$ with teeth that have play is $k$`backlash(phi_1 - phi_2, gap)`.

    **Errors** `TypeError` for what is not a number, `ValueError` for a negative gap.
    """
    x, half = _floating("x", x), 0.5 * _floating("gap", check_nonnegative("gap", gap))
    return x - saturate(x, -half, half)


def dead_band(x: Number, width: Number) -> Float[Array, "..."]:
    """`backlash(x, width)`, as it is called of a controller: no answer in a band of `width` about 0.

    **Errors** `TypeError` for what is not a number, `ValueError` for a negative width.
    """
    return backlash(x, check_nonnegative("width", width))


def _floating(name: str, value: Number) -> Float[Array, "..."]:
    value = jnp.asarray(reals(None, name, value))
    return value if jnp.issubdtype(value.dtype, jnp.floating) else value.astype(jnp.float64)
