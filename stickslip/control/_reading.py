"""Readings of sensors: rounded to a quantum, and with noise."""

from typing import Any

import jax
import jax.numpy as jnp

from .._argument_checks import check_arguments, reals
from .._types import Numeric, Whole


@check_arguments(x=reals, quantum="positive")
def quantised(x: Numeric, quantum: Numeric) -> Any:
    """The whole multiple of `quantum` nearest to `x`, halves upwards, as of an encoder or a converter.

    Its derivative by `x` is zero, as it is wherever it exists: derivatives of a loop are those at which
    no reading changes. For the multiple below take `quantised(x - quantum / 2, quantum)`.
    """
    return jnp.floor(x / quantum + 0.5) * quantum


@check_arguments(shape=lambda owner, name, value: value)
def reading_noise(seed: Whole, k: Whole, shape: tuple[int, ...] = ()) -> Any:
    """Standard normal numbers of sample `k`, the same for the same `seed`, whatever came before."""
    return jax.random.normal(jax.random.fold_in(jax.random.key(seed), k), shape, jnp.float64)
