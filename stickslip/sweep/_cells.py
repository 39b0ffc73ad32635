"""Cells between the points of a grid, halved where points on them differ: in one parameter or two."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .._validation import MOST_NUMBERED


class Step(NamedTuple):
    """Points that halve some cells, and what becomes of these cells."""

    level: int
    places: np.ndarray  # (n, d), on the finest lattice, ascending
    halved: np.ndarray  # (cells,), of which cells


class Cells:
    """Points and cells of a grid that is refined, as results become known.

    A cell is halved along every axis if two points on it, at its corners or on its edges, differ.
    Points lie on the lattice of the finest cells that `levels` halvings would give, so that neighbours
    find each other by whole numbers. Level 1 is finished once no cell of the grid has points that
    differ, level 2 once no cell of half the width has, and so on: a neighbour that was whole is halved
    too if a point on its edge differs from its corners, so that a level may take several steps. Which
    steps there are follows from the results alone, and those of the first levels do not depend on how
    many levels are asked for.
    """

    def __init__(self, axes: Sequence[np.ndarray], levels: int, tolerances: Mapping[str, float]):
        self.axes, self.levels, self.tolerances = axes, levels, tolerances
        self._side = 2**levels
        self._ends = [(axis.size - 1) * self._side for axis in axes]
        self.places = _all([axis.size for axis in axes]) * self._side
        self.level = np.zeros(len(self.places), np.int64)
        self._low = _all([axis.size - 1 for axis in axes]) * self._side
        self._depth = np.zeros(len(self._low), np.int64)
        self._values: dict[str, np.ndarray] = {}
        self._at = 1

    def points(self, places: np.ndarray) -> list[np.ndarray]:
        """Values of each parameter at places of the lattice."""
        return [self._point(axis, places[:, i]) for i, axis in enumerate(self.axes)]

    def _point(self, axis: np.ndarray, place: np.ndarray) -> np.ndarray:
        # Between two values by their shares, which are exact: the same whatever `levels` is.
        index, rest = np.divmod(place, self._side)
        share = rest / self._side
        between = axis[index] * (1.0 - share) + axis[np.minimum(index + 1, axis.size - 1)] * share
        return np.where(rest == 0, axis[index], between)

    def know(self, values: Mapping[str, np.ndarray]) -> None:
        """Results at the points that have none yet, by name, the points in front."""
        for name in self.tolerances:
            new = values[name].reshape(len(values[name]), -1)
            old = self._values.get(name)
            self._values[name] = new if old is None else np.concatenate([old, new])

    def step(self) -> Step | None:
        """Which points are wanted next; `None` where all cells are as fine as they must be."""
        if self.levels == 0:
            return None
        apart = self._apart()
        while self._at <= self.levels:
            halved = apart & (self._depth < self._at)
            halved[halved] = self._can_be_halved(halved)
            if halved.any():
                return Step(self._at, self._new(halved), halved)
            self._at += 1
        return None

    def take(self, step: Step) -> None:
        """Halve the cells of a step; results at its points are to follow."""
        self.places = np.concatenate([self.places, step.places])
        self.level = np.concatenate([self.level, np.full(len(step.places), step.level)])
        low, half = self._low[step.halved], self._half(step.halved)
        parts = [low + np.multiply(half, offset) for offset in self._offsets(2)]
        depths = [self._depth[step.halved] + 1] * len(parts)
        self._low = np.concatenate([self._low[~step.halved], *parts])
        self._depth = np.concatenate([self._depth[~step.halved], *depths])

    def _offsets(self, count: int) -> list[tuple[int, ...]]:
        return list(itertools.product(range(count), repeat=len(self.axes)))

    def _half(self, cells: np.ndarray) -> np.ndarray:
        """Half the sides of cells, (n, 1)."""
        return (self._side >> (self._depth[cells] + 1))[:, None]

    def _can_be_halved(self, cells: np.ndarray) -> np.ndarray:
        """Whether there are numbers between the ends of cells, along every axis."""
        low, half = self._low[cells], self._half(cells)
        good = np.ones(len(low), bool)
        for first, middle, last in zip(*(self.points(low + i * half) for i in range(3)), strict=True):
            good &= (np.minimum(first, last) < middle) & (middle < np.maximum(first, last))
        return good

    def _new(self, halved: np.ndarray) -> np.ndarray:
        """Corners of the parts of these cells that are no points yet."""
        low, half = self._low[halved], self._half(halved)
        every = [self._key(low + np.multiply(half, offset)) for offset in self._offsets(3)]
        keys = np.setdiff1d(np.concatenate(every), self._key(self.places))
        places = []
        for end in reversed(self._ends):
            keys, place = np.divmod(keys, end + 1)
            places.append(place)
        return np.stack(places[::-1], axis=1)

    def _key(self, places: np.ndarray) -> np.ndarray:
        """A place as one number, in the order of the first axis, then of the second."""
        key = places[:, 0]
        for i, end in enumerate(self._ends[1:], 1):
            key = key * (end + 1) + places[:, i]
        return key

    def _apart(self) -> np.ndarray:
        """Whether two points on a cell differ, for each cell."""
        cell, point = self._on_cells()
        order = np.argsort(cell, kind="stable")
        cell, point = cell[order], point[order]
        starts = np.searchsorted(cell, np.arange(len(self._low)))
        apart = np.zeros(len(self._low), bool)
        for name, tolerance in self.tolerances.items():
            apart |= _differ(self._values[name], point, starts, tolerance)
        return apart

    def _on_cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a cell and a point on it, at the least its corners; some of them twice."""
        cells, points = [], []
        for depth in np.unique(self._depth):
            own = np.flatnonzero(self._depth == depth)
            side = self._side >> int(depth)
            counts = [end // side for end in self._ends]
            keys = _keys_of_places(self._low[own] // side, counts)
            order = np.argsort(keys)
            own, keys = own[order], keys[order]
            # Each cell that meets others at a point holds what lies a little to one side of it.
            for offset in self._offsets(2):
                near = (self.places - np.array(offset)) // side
                inside = np.all((near >= 0) & (near < np.array(counts)), axis=1)
                wanted = np.flatnonzero(inside)
                sought = _keys_of_places(near[wanted], counts)
                found = np.minimum(np.searchsorted(keys, sought), len(keys) - 1)
                same = keys[found] == sought
                cells.append(own[found[same]])
                points.append(wanted[same])
        return np.concatenate(cells), np.concatenate(points)


def most_levels(sizes: Sequence[int]) -> int:
    """How often the cells of a grid can be halved so that each place has a number."""
    levels = 0
    while math.prod((n - 1) * 2 ** (levels + 1) + 1 for n in sizes) < MOST_NUMBERED and levels < 52:
        levels += 1
    return levels


def _all(sizes: Sequence[int]) -> np.ndarray:
    """All places of a grid, (n, d), the last axis fastest."""
    return np.indices(sizes).reshape(len(sizes), -1).T


def _keys_of_places(places: np.ndarray, counts: Sequence[int]) -> np.ndarray:
    key = places[:, 0]
    for i, count in enumerate(counts[1:], 1):
        key = key * count + places[:, i]
    return key


def _differ(values: np.ndarray, point: np.ndarray, starts: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether any component of the results differs by more than a tolerance within each group.

    NaN is like NaN and unlike every number; an infinity is like itself alone.
    """
    if values.dtype.kind == "f":
        sorted_ = values[point].astype(np.float64)
        nan = np.isnan(sorted_)
        mixed = np.logical_or.reduceat(nan, starts) & ~np.logical_and.reduceat(nan, starts)
        with np.errstate(invalid="ignore", over="ignore"):
            span = np.fmax.reduceat(sorted_, starts) - np.fmin.reduceat(sorted_, starts)
            return np.any(mixed | (span > tolerance), axis=1)
    wide = np.uint64 if values.dtype.kind in "ub" else np.int64
    sorted_ = values[point].astype(wide)
    most, least = np.maximum.reduceat(sorted_, starts), np.minimum.reduceat(sorted_, starts)
    # The difference of the widest integers has room too, without a sign.
    return np.any(most.view(np.uint64) - least.view(np.uint64) > tolerance, axis=1)
