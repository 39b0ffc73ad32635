"""Residual and Jacobian together: the one expensive thing that every method asks for."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._compiled_once import compiled_once
from ..hybrid import current_executor
from ..hybrid.executor import closed_jaxpr
from ._losses import AbstractLoss
from ._unknowns import NamedValues, Space

Evaluation = Callable[[Float[Array, " unknown"]], tuple[Array, Array]]


def evaluation(
    residual: Callable[[NamedValues], Any], space: Space, loss: AbstractLoss | None = None
) -> Evaluation:
    """Function of the coordinates of the unknowns: row of residuals, its Jacobian by forward mode.

    A robust loss has weighed the residuals. Priors are rows behind those of the data.

    **Raises** `ValueError`, when it is traced, for residuals that are not one row.
    """

    def evaluate(z):
        def twice(z):
            values = space.values(z)
            out = residual(values)
            if getattr(out, "ndim", None) != 1:
                raise ValueError(
                    f"residual(values) = {_shape(out)}: it must be one array with one dimension."
                )
            if loss is not None:
                out = out * loss.weight(out)
            if space.num_priors:
                out = jnp.concatenate([out, space.prior_rows(values)])
            return out, out

        matrix, out = jax.jacfwd(twice, has_aux=True)(z)
        return out, matrix

    return evaluate


def _shape(out: Any) -> str:
    return f"an array of shape {out.shape}" if hasattr(out, "shape") else f"a {type(out).__name__}"


def with_operands(
    residual: Callable[[NamedValues], Any], space: Space, z: Array, loss: AbstractLoss | None = None
) -> tuple[Any, Callable[[Any], Evaluation]]:
    """All that the residual closes over, and the evaluation that is given it as operands.

    So loops cannot make constants of the data, and other data need no new program.
    """
    jaxpr, consts, form = closed_jaxpr(evaluation(residual, space, loss), (z,))

    def of(consts: Any) -> Evaluation:
        return lambda z: jax.tree.unflatten(form, jax.core.eval_jaxpr(jaxpr, (), *consts, z))

    return consts, of


def solve_run(method: Any, run: Any, data: Any, space: Space, z: Array) -> Any:
    """`method.solve` for the residuals `run(values, data)`: traced once for equal `run`s."""
    given = jax.tree.map(
        lambda a: jnp.asarray(a) if isinstance(a, np.ndarray | np.generic) else a,
        (method, data, space, z),
    )
    arrays, rest = eqx.partition(given, eqx.is_array)

    def solve(arrays):
        method, data, space, z = eqx.combine(arrays, rest)
        evaluate = evaluation(lambda values: run(values, data), space, method.loss)
        return method.solve(evaluate, space, z)

    leaves, form = jax.tree.flatten(rest)
    key = (run, tuple((type(leaf), leaf) for leaf in leaves), form, current_executor())
    try:
        hash(key)
    except TypeError:
        key = None
    return compiled_once(solve, arrays, key=key)
