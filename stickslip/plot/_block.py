"""Blocks, and the ground, belts and walls that they rub on and hang from."""

import dataclasses
from typing import Any

import numpy as np
from matplotlib.patches import Rectangle

from .._types import Given
from .._validation import check_text, one_static
from ._scene import DARK, PALE, AbstractPart, Quantity, Reading, Scene, check_quantity


@dataclasses.dataclass(frozen=True)
class Block(AbstractPart):
    """A block, blue while a contact sticks and red while it does not.

    **Arguments:** `x`, and `y` [m], of its middle: a number, the name of an observable, or a function
    `f(t, y)` of time and state, as everywhere in a drawing. `width`, `height` [m], by default a part of
    the picture. `contact`: the name of the contact that colours it, by default the only one there is.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    x: Quantity
    y: Quantity = 0.0
    _: dataclasses.KW_ONLY
    width: Given[float | None] = None
    height: Given[float | None] = None
    contact: Given[str | None] = None

    def __post_init__(self) -> None:
        check_quantity("x", self.x)
        check_quantity("y", self.y)
        for name in ("width", "height"):
            if getattr(self, name) is not None:
                one_static(name, getattr(self, name), "positive")
        if self.contact is not None:
            check_text("contact", self.contact)

    def read(self, scene: Scene) -> Reading:
        """The block as the frames have it."""
        middle = np.stack([scene.row("x", self.x), scene.row("y", self.y)], axis=1)
        colours = scene.colours(self.contact)
        half = 0.5 * np.array([self.width or 0.0, self.height or 0.0])

        def draw(axis: Any, size: float) -> Any:
            sides = np.array([self.width or size, self.height or size])
            body = axis.add_patch(Rectangle((0.0, 0.0), *sides, zorder=3))

            def update(i: int) -> None:
                body.set_xy(middle[i] - 0.5 * sides)
                body.set_color(colours[i])

            return update

        return Reading(np.concatenate([middle - half, middle + half]), draw)


@dataclasses.dataclass(frozen=True)
class Belt(AbstractPart):
    """A belt along x across the picture, whose marks move with it; one of speed 0 is the ground.

    **Arguments:** `speed` [m/s]: a number, the name of an observable, or a function `f(t, y)`, summed
    over the frames. `y` [m]: its height, by default beneath blocks at the height 0.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    speed: Quantity = 0.0
    y: Given[float | None] = None

    def __post_init__(self) -> None:
        check_quantity("speed", self.speed)
        if self.y is not None:
            one_static("y", self.y)

    def read(self, scene: Scene) -> Reading:
        """The belt as the frames have it."""
        speed = scene.row("speed", self.speed)
        way = np.append(0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(scene.times)))
        points = np.zeros((0, 2)) if self.y is None else np.array([[np.nan, self.y]])

        def draw(axis: Any, size: float) -> Any:
            left, right = axis.get_xlim()
            height = -0.5 * size if self.y is None else self.y
            axis.plot([left, right], [height, height], color=DARK, lw=1.5)
            (marks,) = axis.plot([], [], color=DARK, lw=1.0)
            begins = np.arange(0.0, right - left, 0.5 * size)

            def update(i: int) -> None:
                marks.set_data(*_strokes(left + np.mod(begins + way[i], right - left), height, size))

            return update

        return Reading(points, draw)


@dataclasses.dataclass(frozen=True)
class Wall(AbstractPart):
    """An upright wall, which springs and dampers are held by, hatched on the outer side.

    **Arguments:** `x` [m]: a number, the name of an observable, or a function `f(t, y)`, where it
    moves. `y` [m]: the height of its middle.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    x: Quantity
    y: Quantity = 0.0

    def __post_init__(self) -> None:
        check_quantity("x", self.x)
        check_quantity("y", self.y)

    def read(self, scene: Scene) -> Reading:
        """The wall as the frames have it."""
        x, y = scene.row("x", self.x), scene.row("y", self.y)

        def draw(axis: Any, size: float) -> Any:
            outside = np.copysign(1.0, np.mean(x) - np.mean(axis.get_xlim()))
            (face,) = axis.plot([], [], color=DARK, lw=2.5)
            (hatch,) = axis.plot([], [], color=PALE, lw=1.0, zorder=1)
            along = np.linspace(-0.75, 0.75, 7) * size

            def update(i: int) -> None:
                face.set_data([x[i], x[i]], y[i] + along[[0, -1]])
                up, out = _strokes(y[i] + along, 0.0, size)
                hatch.set_data(x[i] - outside * out, up)

            return update

        return Reading(np.stack([x, y], axis=1), draw)


def _strokes(places: np.ndarray, height: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Slanting strokes that hang from places at a height, as one line with gaps."""
    gaps = np.full(places.size, np.nan)
    x = np.stack([places, places - 0.15 * size, gaps], axis=1)
    y = np.stack([0.0 * places + height, 0.0 * places + height - 0.15 * size, gaps], axis=1)
    return x.ravel(), y.ravel()
