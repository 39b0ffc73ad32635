"""Springs and dampers between two places."""

import abc
import dataclasses
from typing import Any

import numpy as np

from .._types import Given, Row
from .._validation import check_count, check_finite, one_static, shape_refusal
from ._scene import DARK, AbstractPart, Place, Reading, Scene, check_place

# How far along the way between its ends and across it the lines of a damper go: rod, cup, piston, rod.
CUP = ((0.0, 0.3, 0.3, 0.6, np.nan, 0.3, 0.3, 0.6), (0.0, 0.0, 0.5, 0.5, np.nan, 0.0, -0.5, -0.5))
PISTON = ((np.nan, 0.45, 0.45, np.nan, 0.45, 1.0), (np.nan, -0.35, 0.35, np.nan, 0.0, 0.0))


def coil(
    start: Row, end: Row, turns: int = 6, width: Given[float] = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """A spring between two points, as a zigzag.

    **Arguments:** `start`, `end`: x and y of the points; `turns` of the zigzag; its `width`, in the
    same unit. **Returns** x and y of its corners, `[corner]` each. **Raises** `TypeError`,
    `ValueError` naming the argument.
    """
    ends = []
    for name, point in (("start", start), ("end", end)):
        check_finite(name, point)
        ends.append(np.asarray(point, np.float64))
        if ends[-1].shape != (2,):
            raise shape_refusal(name, point, "x and y, two numbers")
    check_count("turns", turns, 1)
    along = np.concatenate([[0.0, 0.15], np.linspace(0.15, 0.85, 2 * turns + 1)[1:-1], [0.85, 1.0]])
    across = np.concatenate([[0.0, 0.0], np.tile([0.5, -0.5], turns)[: 2 * turns - 1], [0.0, 0.0]])
    begin, stop = ends
    return _between(begin, stop, along, one_static("width", width, "positive") * across)


def _between(
    start: np.ndarray, end: np.ndarray, along: np.ndarray, across: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points by their parts of the way from `start` to `end`, and their distances from it."""
    way = end - start
    normal = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-300)
    points = start + along[:, None] * way + across[:, None] * normal
    return points[:, 0], points[:, 1]


@dataclasses.dataclass(frozen=True)
class _LineBetween(AbstractPart):
    """A part that is drawn by one line between two places."""

    start: Place
    end: Place

    def __post_init__(self) -> None:
        check_place("start", self.start)
        check_place("end", self.end)

    @abc.abstractmethod
    def _corners(
        self, start: np.ndarray, end: np.ndarray, size: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Corners between two points, in a drawing whose blocks are of this `size` [m]."""

    def read(self, scene: Scene) -> Reading:
        """The part as the frames have it."""
        start, end = scene.place("start", self.start), scene.place("end", self.end)

        def draw(axis: Any, size: float) -> Any:
            (line,) = axis.plot([], [], color=DARK, lw=1.2, zorder=2)
            return lambda i: line.set_data(*self._corners(start[i], end[i], size))

        return Reading(np.concatenate([start, end]), draw)


@dataclasses.dataclass(frozen=True)
class Spring(_LineBetween):
    """A spring from one place to another.

    **Arguments:** `start`, `end` [m]: x at the height 0, or a pair of x and y, each a number, the name
    of an observable, or a function `f(t, y)` of time and state.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    def _corners(
        self, start: np.ndarray, end: np.ndarray, size: float
    ) -> tuple[np.ndarray, np.ndarray]:
        return coil(start, end, 6, 0.4 * size)


@dataclasses.dataclass(frozen=True)
class Damper(_LineBetween):
    """A damper from one place to another, which are given as those of a `Spring`."""

    def _corners(
        self, start: np.ndarray, end: np.ndarray, size: float
    ) -> tuple[np.ndarray, np.ndarray]:
        along, across = np.array([a + b for a, b in zip(CUP, PISTON, strict=True)])
        return _between(start, end, along, 0.5 * size * across)
