"""Which components of a state are compared with each other."""

from typing import Any

import jax
from jaxtyping import PyTree

from ._breaks import Pieced
from ._tolerance import MIXED, STILL
from ._wrapper import AbstractSystemWrapper
from .components import components_of, per_second
from .system import AbstractHybridSystem


def component_groups(system: AbstractHybridSystem, y: PyTree) -> tuple[str, ...]:
    """Group of each leaf of `y`, whose largest number a small one is measured against.

    Coordinates and velocities are a group, whatever their units: a velocity that a contact holds at
    rest may be nothing but rounding. Other components with a unit that the system states, as those of
    first order are, are compared with their like. A component without a unit, or of a wrapper, as an
    integral is, is compared with all that moves (`MIXED`). The number of a piece of a load does not
    move (`STILL`).
    """
    while isinstance(system, AbstractSystemWrapper):
        system = system.system
    units = [system.units.get(name) for name in components_of(y)]
    rates = {unit for unit in units if unit is not None and unit.endswith("/s")}
    motion = rates | {unit for unit in units if unit is not None and per_second(unit) in rates}
    rows = zip(units, jax.tree.leaves(_counts(y)), strict=True)
    return tuple(
        STILL if counts else MIXED if unit is None else "motion" if unit in motion else unit
        for unit, counts in rows
    )


def _counts(y: PyTree) -> PyTree:
    """Whether the leaves are numbers of pieces."""

    def of(node: Any) -> Any:
        return Pieced(_counts(node.y), True) if isinstance(node, Pieced) else False

    return jax.tree.map(of, y, is_leaf=lambda node: isinstance(node, Pieced))
