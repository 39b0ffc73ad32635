"""Arithmetic on state pytrees."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree


def combine(y: PyTree, slopes: Sequence[PyTree], weights: Sequence[float], h: Any) -> PyTree:
    """`y + h * sum_j weights[j] * slopes[j]`; zero weights cost nothing."""
    used = [(h * float(w), k) for w, k in zip(weights, slopes, strict=False) if w != 0.0]
    for factor, slope in used:
        y = jax.tree.map(lambda a, b, f=factor: a + f * b, y, slope)
    return y


def weighted(slopes: Sequence[PyTree], weights: Sequence[float], h: Any) -> PyTree:
    """`h * sum_j weights[j] * slopes[j]`."""
    zero = jax.tree.map(jnp.zeros_like, slopes[0])
    return combine(zero, slopes, weights, h)


def select(condition: Any, yes: PyTree, no: PyTree) -> PyTree:
    """Leafwise `where` on a scalar condition."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), yes, no)


def shift(y: PyTree, slope: PyTree, dt: Any) -> PyTree:
    """`y + slope * dt`."""
    return jax.tree.map(lambda a, b: a + b * dt, y, slope)


def write_row(rows: PyTree, row: PyTree, index: Any) -> PyTree:
    """`rows` with `row` written at `index` of the leading axis, in place inside a loop.

    With the primitive itself: `dynamic_update_index_in_dim` is jitted, and inside the fused loop that
    call would copy the whole buffer.
    """

    def write(buffer, value):
        value = jax.lax.expand_dims(jnp.asarray(value), (0,))
        start = (index, *(jnp.zeros((), jnp.int32),) * (buffer.ndim - 1))
        return jax.lax.dynamic_update_slice(buffer, value, start)

    return jax.tree.map(write, rows, row)


def all_finite(tree: PyTree) -> Array:
    """One boolean: no NaN and no infinity in any leaf."""
    flags = [jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(tree)]
    result = flags[0]
    for flag in flags[1:]:
        result = result & flag
    return result


def as_float64(name: str, tree: PyTree) -> PyTree:
    """`tree` with float64 scalars or arrays as leaves.

    Raises `TypeError` for leaves that are not real numbers and `ValueError` for concrete leaves that
    are float32 arrays (silent loss of digits) or not finite.
    """

    def convert(path, leaf):
        where = name + jax.tree_util.keystr(path)
        try:
            array = jnp.asarray(leaf)
        except (TypeError, ValueError, OverflowError) as error:
            raise TypeError(f"{where}={leaf!r} must be a real number or array") from error
        if array.dtype == jnp.bool_ or not (
            jnp.issubdtype(array.dtype, jnp.floating) or jnp.issubdtype(array.dtype, jnp.integer)
        ):
            raise TypeError(f"{where} has dtype {array.dtype}; allowed: real numbers")
        if array.dtype in (jnp.float32, jnp.float16, jnp.bfloat16):
            raise ValueError(
                f"{where} has dtype {array.dtype}; allowed: float64 (convert it explicitly with "
                f"jnp.asarray(..., dtype=jnp.float64) if the lost digits do not matter)"
            )
        if not isinstance(array, jax.core.Tracer) and not np.all(np.isfinite(np.asarray(array))):
            raise ValueError(f"{where}={leaf!r} must be finite")
        return array.astype(jnp.float64)

    return jax.tree_util.tree_map_with_path(convert, tree)


def with_float_arrays(tree: PyTree) -> PyTree:
    """`tree` with its Python floats as arrays: another number then is not another program."""
    return jax.tree.map(lambda a: jnp.asarray(a, jnp.float64) if isinstance(a, float) else a, tree)
