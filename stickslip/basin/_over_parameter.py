"""Basins over a parameter: attractors keep their names from one value to the next."""

from typing import NamedTuple

import numpy as np
from jaxtyping import PyTree

from .._types import Given, Row
from .._validation import check_text, check_type, one_row
from ..analysis.observable import check_parameter, with_parameters
from ..hybrid import AbstractHybridSystem, Integrator
from ._attractor import Attractor
from ._basins import Basins, basins
from ._settle import Settle


class BasinsOver(NamedTuple):
    """Basins at values of a parameter: a `Basins` for each, in `maps`."""

    parameter: str
    values: np.ndarray
    maps: tuple[Basins, ...]

    @property
    def shares(self) -> dict[str, np.ndarray]:
        """Shares by name at each value; 0 where there is none of this name."""
        names = dict.fromkeys(name for found in self.maps for name in found.shares)
        return {name: np.array([m.shares.get(name, 0.0) for m in self.maps]) for name in names}

    def __str__(self) -> str:
        rows = [f"  {name}: {', '.join(f'{p:.4g}' for p in row)}" for name, row in self.shares.items()]
        values = ", ".join(f"{value:.4g}" for value in self.values)
        return "\n".join([f"Basins at {self.parameter} = {values}", *rows])

    __repr__ = __str__


def basins_over(
    system: Given[AbstractHybridSystem],
    parameter: Given[str],
    values: Row,
    y0: PyTree,
    box: Given[dict[str, tuple[float, float]]],
    settle: Given[Settle],
    *,
    points: Given[int | tuple[int, ...]] = 1024,
    integrator: Given[Integrator | None] = None,
    args: PyTree = None,
) -> BasinsOver:
    """`basins` at each value of a parameter, in their order.

    An attractor keeps its name as long as Newton's method leads from the one at the value before to a
    stable one at the next; so take steps that are small against what it does in between. Otherwise it
    is not there any more; `continue_equilibrium` and `continue_orbit` say at which point it ended, and
    at which a new one began.

    **Arguments** `parameter`: name of a number of the system (`drive__U_in` for `U_in` of its part
    `drive`), which takes the `values`; the others as of `basins`.

    **Returns** a `BasinsOver`. **Errors** as of `basins`.
    """
    check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
    check_parameter(system, check_text("parameter", parameter), "parameter")
    values = np.asarray(one_row("values", values), float)
    maps: list[Basins] = []
    seen: dict[str, Attractor] = {}  # the last one of each name, also of those that have ended
    for value in values:
        there = with_parameters(system, {parameter: value})
        maps.append(
            basins(
                there, y0, box, settle, points=points, integrator=integrator, args=args,
                known=tuple(seen.values()),
            )
        )  # fmt: skip
        seen |= {attractor.name: attractor for attractor in maps[-1].attractors}
    return BasinsOver(parameter, values, tuple(maps))
