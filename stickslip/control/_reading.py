"""Readings of sensors: rounded to a quantum, and with noise."""

from typing import Any

import jax
import jax.numpy as jnp

from .._argument_checks import check_arguments, checked_by, number, reals
from .._types import Numeric, Whole
from .._validation import whole_number


@check_arguments(x=reals, quantum=number("positive"))
def encoder_reading(x: Numeric, quantum: Numeric) -> Any:
    """The whole multiple of `quantum` nearest to `x`, halves upwards, as of an encoder or a converter.

    Its derivative by `x` is zero, as it is wherever it exists: derivatives of a loop are those at which
    no reading changes. For the multiple below take `encoder_reading(x - quantum / 2, quantum)`.
    """
    return jnp.floor(jnp.asarray(x, jnp.float64) / quantum + 0.5) * quantum


_WHOLE = checked_by(whole_number, 0, 2**31 - 1)


@check_arguments(seed=_WHOLE, k=_WHOLE)
def reading_noise(seed: Whole, k: Whole) -> Any:
    """A standard normal number for sample `k`, the same for the same `seed`, whatever came before."""
    return jax.random.normal(jax.random.fold_in(jax.random.key(seed), k), (), jnp.float64)
