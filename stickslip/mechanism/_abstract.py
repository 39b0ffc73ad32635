"""Structure of a declaration, read with all numbers abstract and kept for machines of the same form."""

import functools
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._code import code_key


def abstract(system: Any) -> tuple[list[Any], Any]:
    """Leaves of a pytree as abstract numbers, so that no value of them counts as structure."""
    leaves, form = jax.tree.flatten(system)
    kinds = (bool, int, float, np.ndarray, np.generic, jax.Array, jax.ShapeDtypeStruct)

    def shape(x):
        return jax.ShapeDtypeStruct(jnp.shape(x), jnp.float64)

    return [shape(x) if isinstance(x, kinds) else x for x in leaves], form


def numbers_of(leaves: Sequence[Any]) -> list[jax.ShapeDtypeStruct]:
    """Those of the leaves that are numbers."""
    return [x for x in leaves if isinstance(x, jax.ShapeDtypeStruct)]


def with_numbers(leaves: Sequence[Any], numbers: Sequence[Any]) -> list[Any]:
    """The leaves with these numbers for abstract ones."""
    given = iter(numbers)
    return [next(given) if isinstance(x, jax.ShapeDtypeStruct) else x for x in leaves]


def traced_with(function: Any, system: Any) -> Any:
    """`function(system)`, which gives no numbers but its structure, with all numbers abstract.

    Kept for the next system of this structure and code, so `function` must have a name: a lambda has
    none.
    """
    leaves, form = abstract(system)
    key = (function, form, tuple(leaves), code_key(system))
    try:
        hash(key)
    except TypeError:
        return _trace_of.__wrapped__(*key)
    return _trace_of(*key)


@functools.lru_cache(maxsize=1024)
def _trace_of(function: Any, form: Any, leaves: Any, code: str) -> Any:
    seen: list[Any] = []

    def run(numbers):
        seen.append(function(jax.tree.unflatten(form, with_numbers(leaves, numbers))))
        return 0.0

    jax.eval_shape(run, numbers_of(leaves))
    return seen[0]
