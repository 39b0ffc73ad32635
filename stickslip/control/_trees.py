"""Functions of users as parts of a controller."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
from jax.tree_util import Partial

from .._validation import check_callable

UPDATE = "update(k, t, measured, state, args)"


def as_tree(name: str, function: Any, call: str, *arguments: Any) -> Callable:
    """A function that is called so, as a pytree: the numbers of a module are parameters."""
    function = check_callable(name, function, call, *arguments)
    tree: Any = function if isinstance(function, eqx.Module) else Partial(function)
    return tree
