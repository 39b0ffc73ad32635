"""Grids of named coordinates and the blocks they are computed in."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from .._validation import numbers, one_row, refusal

MAX_LANES = 2**40


def block_lanes() -> int:
    """Lanes per block: large against a chunk of `map_lanes` on a CPU, small against a long sweep.

    An accelerator computes a block at once.
    """
    return 4096 if jax.default_backend() == "cpu" else 65536


class Block(NamedTuple):
    """One rectangular piece of the grid: its number along each axis and the indices it covers."""

    number: int
    place: tuple[int, ...]
    region: tuple[slice, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(s.stop - s.start for s in self.region)

    @property
    def lanes(self) -> int:
        return math.prod(self.shape)


def check_grid(grid: Any) -> dict[str, np.ndarray]:
    """Coordinates as float64 vectors; `ValueError` or `TypeError` naming the one that is not."""
    if not isinstance(grid, Mapping) or not grid:
        such = "such as {'k3': numpy.linspace(72.0, 97.0, 251)}"
        allowed = f"a mapping, not empty, from coordinate names to values, {such}"
        raise refusal("grid", grid, allowed, TypeError)
    checked = {}
    for name, values in grid.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise refusal(f"grid[{name!r}]", values, "named by a Python identifier")
        array = numbers(f"grid[{name!r}]", values, "a vector of real numbers")
        checked[name] = np.asarray(one_row(f"grid[{name!r}]", array), np.float64)
    lanes = math.prod(a.size for a in checked.values())
    if lanes > MAX_LANES:
        raise refusal("grid", grid, f"of at most {MAX_LANES} points, not {lanes}")
    return checked


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


def shard_shape(shape: Sequence[int], sides: Sequence[int], lanes: int) -> tuple[int, ...]:
    """Sides of a shard of at most `lanes` lanes, and of one block at least, in whole blocks.

    As in a block, trailing axes are whole, one axis is cut, the rest single.
    """
    result, room = list(sides), max(lanes // math.prod(sides), 1)
    for axis in reversed(range(len(shape))):
        count = -(-shape[axis] // sides[axis])
        taken = min(count, room)
        result[axis] = sides[axis] * taken
        room //= taken
        if taken < count:
            break
    return tuple(result)


def blocks_inside(unit: Block, shape: Sequence[int], sides: Sequence[int]) -> list[Block]:
    """The blocks of a shard, with the numbers that they have in the whole grid."""
    ranges = [
        range(s.start // side, -(-s.stop // side)) for s, side in zip(unit.region, sides, strict=True)
    ]
    counts = [-(-n // side) for n, side in zip(shape, sides, strict=True)]
    return [_block(place, counts, shape, sides) for place in itertools.product(*ranges)]


def blocks(shape: Sequence[int], sides: Sequence[int], backward: int | None = None) -> list[Block]:
    """All blocks in the order of computation, the axis `backward` from its end to its start."""
    counts = [-(-n // side) for n, side in zip(shape, sides, strict=True)]
    ranges = [
        range(count - 1, -1, -1) if axis == backward else range(count)
        for axis, count in enumerate(counts)
    ]
    return [_block(place, counts, shape, sides) for place in itertools.product(*ranges)]


def _block(place, counts, shape, sides) -> Block:
    number = 0
    for i, count in zip(place, counts, strict=True):
        number = number * count + i
    region = tuple(
        slice(i * side, min((i + 1) * side, n)) for i, side, n in zip(place, sides, shape, strict=True)
    )
    return Block(number, place, region)


def chains(units: Sequence[Block], axis: int | None) -> list[list[Block]]:
    """Units that follow from each other along the axis of a carried sweep; else each by itself."""
    if axis is None:
        return [[unit] for unit in units]
    found: dict[tuple[int, ...], list[Block]] = {}
    for unit in units:
        found.setdefault((*unit.place[:axis], *unit.place[axis + 1 :]), []).append(unit)
    return list(found.values())
