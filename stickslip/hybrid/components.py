"""Components of a state by name, with their units and periods."""

import itertools
import re
from collections import Counter
from typing import Any, NamedTuple, overload

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._show import LISTED
from .._validation import one_static


class Place(NamedTuple):
    """Which numbers of a state a name means."""

    name: str  # of the component, without an index
    leaf: int  # its number among the leaves of the state
    index: tuple[int, ...] | None  # of one number of an array; None for the whole component

    def read(self, y: PyTree) -> Any:
        """The component of a state, or the one number of it."""
        found = jax.tree.leaves(y)[self.leaf]
        for i in self.index or ():
            # By a slice that is known while tracing, which costs nothing in a compiled loop.
            found = jax.lax.index_in_dim(jnp.asarray(found), i, keepdims=False)
        return found


def components_of(y: PyTree) -> dict[str, Any]:
    """Leaves of a state by the last part of their path, or by all of it where that is not unique.

    `x` of a state `Pieced(y=Motion(x, v), piece)`: what the units of the system call it too.
    """
    found = jax.tree_util.tree_leaves_with_path(y)
    paths = [jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in found]
    last = [path.rsplit(".", 1)[-1] for path in paths]
    times = Counter(last)
    names = [
        (short if times[short] == 1 else path.replace(".", "_")) or "y"
        for short, path in zip(last, paths, strict=True)
    ]
    return {name: leaf for name, (_, leaf) in zip(names, found, strict=True)}


def place_of(y: PyTree, name: str) -> Place | None:
    """Place of `"x"`, `"x[0]"`, of a matrix `"x[1, 2]"`, in a state; None if it has no such part."""
    components = components_of(y)
    if name in components:
        return Place(name, list(components).index(name), None)
    base, index = split(name)
    if index is None or base not in components:
        return None
    shape = np.shape(components[base])
    inside = len(index) == len(shape) and all(i < n for i, n in zip(index, shape, strict=True))
    return Place(base, list(components).index(base), index) if inside else None


def split(name: str) -> tuple[str, tuple[int, ...] | None]:
    """`"x[1, 2]"` as `"x"` and `(1, 2)`; a name without an index as it is, and None."""
    found = re.fullmatch(r"(.+)\[(\d+(?:, ?\d+)*)\]", name, re.ASCII)
    return (name, None) if found is None else (found[1], tuple(map(int, found[2].split(","))))


def entries(name: str, shape: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
    """Names of the single numbers of a component, with their indices: `x[0]`, `x[1]`, or `x` alone."""
    if not shape:
        return {name: ()}
    every = itertools.product(*map(range, shape))
    return {f"{name}[{', '.join(map(str, index))}]": index for index in every}


def own_axes(name: str, rank: int) -> tuple[str, ...]:
    """Names of the axes of a component in a dataset: `x_0`, `x_1`, ..."""
    return tuple(f"{name}_{i}" for i in range(rank))


def numbers_of(y: PyTree) -> list[str]:
    """Names of the numbers of a state, in the order in which it is flattened."""
    return [name for key, leaf in components_of(y).items() for name in entries(key, np.shape(leaf))]


def component_list(y: PyTree) -> str:
    """The components of a state for messages: `x`, or `x[0] to x[2]` of an array."""
    found = []
    for name, leaf in components_of(y).items():
        names = list(entries(name, np.shape(leaf))) if np.size(leaf) else [name]
        found.append(names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}")
    return ", ".join(found[:LISTED]) + (", ..." if len(found) > LISTED else "")


def unit_of(system: Any, name: str) -> str | None:
    """The unit of a component, if the system states it."""
    return system.units.get(name)


def period_of(system: Any, name: str) -> float | None:
    """The period of a component, if it is an angle or the like.

    Raises `ValueError`, `TypeError` where the system states one that is not a positive number.
    """
    period = system.periods.get(name)
    return None if period is None else float(one_static(f"periods[{name!r}]", period, "positive"))


def second_of(system: Any) -> str:
    """The unit of time: s, or 1 where the system has no dimensions."""
    return "1" if getattr(system, "is_dimensionless", False) else "s"


@overload
def per_second(unit: str) -> str: ...
@overload
def per_second(unit: None) -> None: ...
def per_second(unit: str | None) -> str | None:
    """The unit of a slope."""
    return None if unit is None else {"1": "1/s"}.get(unit, f"{unit}/s")
