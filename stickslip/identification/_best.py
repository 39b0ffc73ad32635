"""The best of many fits."""

import equinox as eqx
import jax
import jax.numpy as jnp

from .._types import Given
from .._validation import check_type, refusal
from ._fit import Fit


def best(fits: Given[Fit]) -> Fit:
    """The fit of least cost; `fits` as from `many_starts`.

    **Raises** `TypeError` for anything else, `ValueError` for a single fit.
    """
    check_type("fits", fits, Fit, "a Fit")
    if fits.steps.ndim != 1:
        raise refusal("fits", fits, "one row of fits", but=f"of shape {fits.steps.shape}")
    row = jnp.argmin(fits.cost)
    return jax.tree.map(lambda a: a[row] if eqx.is_array(a) else a, fits)
