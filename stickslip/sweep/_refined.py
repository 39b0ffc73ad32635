"""The steps of a refinement one after another, computed or read, and all of its points as a dataset."""

import json
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import xarray as xr

from ._cells import Cells, Step

LANE, LEVEL = "lane", "level"  # dimension of points in no order, and in which level each was added
OWN = (LANE, LEVEL)


class Part(NamedTuple):
    """Results of one step: its dataset, and `finished` or how far it is."""

    dataset: xr.Dataset
    state: str


class Refined(NamedTuple):
    """All that is known of a refinement."""

    cells: Cells
    parts: list[xr.Dataset]
    state: str

    @property
    def is_stopped(self) -> bool:
        """Whether more points are wanted than are allowed."""
        return "max_points" in self.state


Get: TypeAlias = Callable[[int, Step | None, list[np.ndarray]], Part | None]


def walk(cells: Cells, get: Get, most: int) -> Refined:
    """Go from step to step as far as results are known, or `most` points allow.

    `get(number, step, points)` gives the results of a step at these values of each parameter, and as
    number 0 those of the grid; `None` where there is nothing yet.
    """
    number, step = 0, None
    parts: list[xr.Dataset] = []
    while True:
        part = get(number, step, [] if step is None else cells.points(step.places))
        if part is None:
            assert step is not None
            return Refined(cells, parts, f"unfinished: level {step.level} is not begun")
        if step is not None:
            cells.take(step)
        parts.append(part.dataset)
        if part.state != "finished":
            level = "" if step is None else f"level {step.level}, "
            return Refined(cells, parts, part.state.replace(": ", f": {level}", 1))
        rank = len(cells.axes) if number == 0 else 1
        cells.know({name: _flat(part.dataset[name], rank) for name in cells.tolerances})
        step = cells.step()
        if step is None:
            return Refined(cells, parts, "finished")
        wanted = len(cells.places) + len(step.places)
        if wanted > most:
            state = f"unfinished: level {step.level} wants {wanted:,} points, max_points = {most:,}"
            return Refined(cells, parts, state)
        number += 1


def all_points(found: Refined, names: list[str], about: Mapping[str, Any]) -> xr.Dataset:
    """All points: of one parameter in ascending order, of two in the order in which they were added."""
    cells, first = found.cells, found.parts[0]
    rank = len(names)
    place = cells.points(cells.places)
    order: Any = np.argsort(place[0], kind="stable") if rank == 1 else slice(None)
    dim = names[0] if rank == 1 else LANE
    coords: dict[Any, Any] = {
        name: (dim, values[order], first[name].attrs) for name, values in zip(names, place, strict=True)
    }
    about_level = {"long_name": "halvings of the grid's cells that asked for the point"}
    coords[LEVEL] = (dim, cells.level[order], about_level)
    for name, coord in first.coords.items():
        if name not in coords:
            coords[name] = coord.variable
    variables = {}
    for name, variable in first.data_vars.items():
        flat = [_flat(part[name], 1 if i else rank) for i, part in enumerate(found.parts)]
        dims = (dim, *variable.dims[rank:])
        variables[name] = (dims, np.concatenate(flat)[order], variable.attrs)
    attrs = {
        **first.attrs,
        "refined_by": json.dumps(dict(cells.tolerances)),
        "refine_levels": cells.levels,
        "sweep_state": found.state,
        **about,
    }
    return xr.Dataset(variables, coords, attrs)


def _flat(variable: xr.DataArray, rank: int) -> np.ndarray:
    values = np.asarray(variable.values)
    return values.reshape(-1, *values.shape[rank:])
