"""Pendulums."""

import dataclasses
from typing import Any

import numpy as np

from .._types import Given
from .._validation import check_text, one_static
from ._scene import DARK, AbstractPart, Place, Quantity, Reading, Scene, check_place, check_quantity


@dataclasses.dataclass(frozen=True)
class Pendulum(AbstractPart):
    """A rod with a bob that turns about a pivot, blue while a contact sticks and red while it does not.

    **Arguments:** `angle` [rad] from hanging straight down, counter-clockwise: a number, the name of an
    observable, or a function `f(t, y)` of time and state. `pivot` [m]: x at the height 0, or a pair of
    x and y, each given like the angle. `length` [m] of the rod. `contact`: the name of the contact that
    colours the pivot, by default the only one there is.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    angle: Quantity
    pivot: Place = (0.0, 0.0)
    length: Given[float] = 1.0
    contact: Given[str | None] = None

    def __post_init__(self) -> None:
        check_quantity("angle", self.angle)
        check_place("pivot", self.pivot)
        one_static("length", self.length, "positive")
        if self.contact is not None:
            check_text("contact", self.contact)

    def read(self, scene: Scene) -> Reading:
        """The pendulum as the frames have it."""
        angle, pivot = scene.row("angle", self.angle), scene.place("pivot", self.pivot)
        bob = pivot + self.length * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
        colours = scene.colours(self.contact)

        def draw(axis: Any, size: float) -> Any:
            (rod,) = axis.plot([], [], color=DARK, lw=2.5, zorder=2)
            (mass,) = axis.plot([], [], "o", color=DARK, ms=14, zorder=3)
            (joint,) = axis.plot([], [], "o", ms=8, zorder=4)

            def update(i: int) -> None:
                rod.set_data(*np.stack([pivot[i], bob[i]], axis=1))
                mass.set_data(bob[i, :1], bob[i, 1:])
                joint.set_data(pivot[i, :1], pivot[i, 1:])
                joint.set_color(colours[i])

            return update

        return Reading(np.concatenate([pivot - self.length, pivot + self.length]), draw)
