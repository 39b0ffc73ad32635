"""The best of many fits."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from .._validation import check_type
from ._fit import Fit


def best(fits: Any) -> Fit:
    """The fit of least cost; `fits` as from `many_starts`.

    **Raises** `TypeError` for anything else, `ValueError` for a single fit.
    """
    check_type("fits", fits, Fit, "a Fit")
    if fits.steps.ndim != 1:
        raise ValueError(f"fits has batch shape {fits.steps.shape}: it must be one row of fits.")
    row = jnp.argmin(fits.cost)
    return jax.tree.map(lambda a: a[row] if eqx.is_array(a) else a, fits)
