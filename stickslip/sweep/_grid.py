"""Grids of named coordinates and the blocks they are computed in."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

CHUNK = 4096  # lanes per block: large against a chunk of `map_lanes`, small against a long sweep
MAX_LANES = 2**40


class Block(NamedTuple):
    """One rectangular piece of the grid: its number along each axis and the indices it covers."""

    number: int
    place: tuple[int, ...]
    region: tuple[slice, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(s.stop - s.start for s in self.region)


def check_grid(grid: Any) -> dict[str, np.ndarray]:
    """Coordinates as float64 vectors; `ValueError` or `TypeError` naming the one that is not."""
    if not isinstance(grid, Mapping) or not grid:
        raise TypeError(
            f"grid = {grid!r}: it must be a non-empty mapping from coordinate names to values, such as "
            "{'k3': numpy.linspace(72.0, 97.0, 251)}."
        )
    checked = {}
    for name, values in grid.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise ValueError(f"grid has the name {name!r}: it must be a Python identifier.")
        try:
            array = np.asarray(values)
            if array.dtype.kind not in "iuf":
                raise TypeError
            array = array.astype(np.float64)
        except (TypeError, ValueError):
            raise TypeError(
                f"grid[{name!r}] = {_short(values)}: it must be a vector of real numbers."
            ) from None
        if array.ndim != 1 or array.size == 0:
            raise ValueError(
                f"grid[{name!r}] has shape {array.shape}: it must be one-dimensional and not empty."
            )
        if not np.isfinite(array).all():
            where = int(np.flatnonzero(~np.isfinite(array))[0])
            raise ValueError(f"grid[{name!r}][{where}] = {array[where]}: it must be finite.")
        checked[name] = array
    lanes = math.prod(a.size for a in checked.values())
    if lanes > MAX_LANES:
        raise ValueError(f"grid has {lanes} points: at most {MAX_LANES} are allowed.")
    return checked


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def block_shape(shape: Sequence[int], chunk: int, first: int | None = None) -> tuple[int, ...]:
    """Sides of a block of at most `chunk` lanes: trailing axes whole, one axis cut, the rest single.

    Axis `first` is cut last, so that a block of a carried sweep holds many rows across the direction
    in which it is carried.
    """
    order = [axis for axis in reversed(range(len(shape))) if axis != first]
    if first is not None:
        order.append(first)
    sides, room = [1] * len(shape), max(chunk, 1)
    for axis in order:
        sides[axis] = min(shape[axis], room)
        room //= sides[axis]
        if sides[axis] < shape[axis] or room < 1:
            break
    return tuple(sides)


def blocks(shape: Sequence[int], sides: Sequence[int], backward: int | None = None) -> list[Block]:
    """All blocks in the order of computation, the axis `backward` from its end to its start."""
    counts = [-(-n // side) for n, side in zip(shape, sides, strict=True)]
    ranges = [
        range(count - 1, -1, -1) if axis == backward else range(count)
        for axis, count in enumerate(counts)
    ]
    strides = [math.prod(counts[axis + 1 :]) for axis in range(len(counts))]
    result = []
    for place in itertools.product(*ranges):
        region = tuple(
            slice(i * side, min((i + 1) * side, n))
            for i, side, n in zip(place, sides, shape, strict=True)
        )
        number = sum(i * stride for i, stride in zip(place, strides, strict=True))
        result.append(Block(number, place, region))
    return result
