"""Functions of users as parts of a controller."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
from jax.tree_util import Partial

from .._validation import check_callable, refusal

UPDATE = "update(k, t, measured, state, args)"


def as_tree(name: str, function: Any, call: str, *arguments: Any) -> Callable:
    """A function that is called so, as a pytree: the numbers of a module are parameters."""
    function = check_callable(name, function, call, *arguments)
    tree: Any = function if isinstance(function, eqx.Module) else Partial(function)
    return tree


def pair_of(measured: Any) -> tuple:
    """Place and speed, as measured; raises `TypeError` for anything but a pair."""
    try:
        x, v = measured
    except (TypeError, ValueError):
        allowed = "a pair, (x, v): give `measure` of the loop, such as lambda t, y, args: (y.x, y.v_x)"
        raise refusal("measured", measured, allowed, TypeError) from None
    return x, v
