"""Arithmetic on state pytrees."""

import functools
import operator
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree


def combine(y: PyTree, slopes: Sequence[PyTree], weights: Sequence[float], h: Any) -> PyTree:
    """`y + h * sum_j weights[j] * slopes[j]`; zero weights cost nothing."""
    used = [(h * float(w), k) for w, k in zip(weights, slopes, strict=False) if w != 0.0]
    for factor, slope in used:
        y = jax.tree.map(lambda a, b, f=factor: a + f * b, y, slope)
    return y


def weighted_sum(slopes: Sequence[PyTree], weights: Any, h: Any) -> PyTree:
    """`h * sum_j weights[j] * slopes[j]`."""
    zero = jax.tree.map(jnp.zeros_like, slopes[0])
    return combine(zero, slopes, weights, h)


def select(condition: Any, yes: PyTree, no: PyTree) -> PyTree:
    """Leafwise `where` on a scalar condition."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), yes, no)


def shift(y: PyTree, slope: PyTree, dt: Any) -> PyTree:
    """`y + slope * dt`."""
    return jax.tree.map(lambda a, b: a + b * dt, y, slope)


def cubics(points: Sequence[float], y0: PyTree, dy0: PyTree, y1: PyTree, dy1: PyTree, h: Any) -> list:
    """States at the `points`, fractions of a step, on the cubic through its ends with their slopes."""
    return [
        jax.tree.map(lambda a, s, b, e, x=x: cubic(x, a, h * s, b, h * e), y0, dy0, y1, dy1)
        for x in points
    ]


def cubic(x: float, start: Any, start_rise: Any, end: Any, end_rise: Any) -> Any:
    """Cubic at the fraction `x` of a step through the values at its ends; rises: slopes times length.

    A constant component stays so to the last bit: it may be the number of a piece.
    """
    rest = 1.0 - x
    middle = start + x * x * (3.0 - 2.0 * x) * (end - start)
    return middle + x * rest * (rest * start_rise - x * end_rise)


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
    return functools.reduce(operator.and_, flags)


def with_float_arrays(tree: PyTree) -> PyTree:
    """`tree` with its Python floats as arrays: another number then is not another program."""
    return jax.tree.map(lambda a: np.asarray(a, np.float64) if isinstance(a, float) else a, tree)


def frozen(tree: PyTree) -> PyTree:
    """`tree` without derivatives."""
    return jax.tree.map(lambda a: jax.lax.stop_gradient(a) if eqx.is_array(a) else a, tree)
