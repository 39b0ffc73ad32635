"""Components of a state by name, with their units and periods."""

from collections import Counter
from typing import Any

import jax
from jaxtyping import PyTree

from .._validation import one_static


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


def unit_of(system: Any, name: str) -> str | None:
    """The unit of a component, if the system states it."""
    return system.units.get(name)


def period_of(system: Any, name: str) -> float | None:
    """The period of a component, if it is an angle or the like.

    Raises `ValueError`, `TypeError` where the system states one that is no positive number.
    """
    period = system.periods.get(name)
    return None if period is None else float(one_static(f"periods[{name!r}]", period, "positive"))
