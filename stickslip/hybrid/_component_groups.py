"""Which components of a state can be compared with each other: those of one unit."""

from typing import Any

import jax
from jaxtyping import PyTree

from ._breaks import Pieced
from ._tolerance import MIXED, STILL
from ._wrapper import AbstractSystemWrapper
from .components import components_of
from .system import AbstractHybridSystem


def component_groups(system: AbstractHybridSystem, y: PyTree) -> tuple[str, ...]:
    """Group of each leaf of `y`, whose largest number a small one is measured against.

    Components of one unit that a system states are a group: a metre is compared with no second. A
    component without a unit, or of a wrapper, as an integral is, is compared with all that moves
    (`MIXED`): an integral may be nothing but rounding. The number of a piece of a load does not move
    (`STILL`).
    """
    while isinstance(system, AbstractSystemWrapper):
        system = system.system
    rows = zip(components_of(y), jax.tree.leaves(_counts(y)), strict=True)
    return tuple(STILL if counts else system.units.get(name, MIXED) for name, counts in rows)


def _counts(y: PyTree) -> PyTree:
    """Whether the leaves are numbers of pieces."""

    def of(node: Any) -> Any:
        return Pieced(_counts(node.y), True) if isinstance(node, Pieced) else False

    return jax.tree.map(of, y, is_leaf=lambda node: isinstance(node, Pieced))
