"""Residual and Jacobian together: the one expensive thing that every method asks for."""

from collections.abc import Callable
from typing import Any

import jax
from jaxtyping import Array, Float

from ._unknowns import Values, from_logs

Evaluation = Callable[[Float[Array, " unknown"]], tuple[Array, Array]]


def evaluation(residual: Callable[[Values], Any], names: tuple[str, ...]) -> Evaluation:
    """Function of the logarithms of the unknowns: row of residuals, its Jacobian by forward mode.

    **Raises** `ValueError`, when it is traced, for residuals that are not one row.
    """

    def evaluate(z):
        def twice(z):
            out = residual(from_logs(names, z))
            if getattr(out, "ndim", None) != 1:
                raise ValueError(
                    f"residual returned {_shape(out)}: it must be one array with one dimension."
                )
            return out, out

        matrix, out = jax.jacfwd(twice, has_aux=True)(z)
        return out, matrix

    return evaluate


def _shape(out: Any) -> str:
    return f"shape {out.shape}" if hasattr(out, "shape") else f"a {type(out).__name__}"
