"""Frames of a motion, and how the parts of a drawing read from them where they are."""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_callable, check_text, one_static, refusal, shape_refusal
from ._movie import SLIP, STICK
from ._observed import Source, list_of_names
from ._sticks import intervals_of

Quantity: TypeAlias = Given[float | str | Callable[[Any, Any], Any]]
Place: TypeAlias = Given[float | str | Callable[[Any, Any], Any] | tuple[Any, Any]]
DARK, PALE = "0.25", "0.8"


def check_quantity(name: str, value: Any) -> Any:
    """A number, the name of an observable, or a function of time and state."""
    if isinstance(value, str):
        return check_text(name, value, "the name of an observable")
    if callable(value):
        return check_callable(name, value, "f(t, y)", 0.0, None)
    if isinstance(value, bool) or not isinstance(value, int | float):
        allowed = "a number, the name of an observable, or a function f(t, y)"
        raise refusal(name, value, allowed, TypeError)
    return one_static(name, value)


def check_place(name: str, value: Any) -> Any:
    """x at the height 0, or a pair of x and y."""
    if isinstance(value, tuple):
        if len(value) != 2:
            raise refusal(name, value, "x, or a pair of x and y")
        for i, item in enumerate(value):
            check_quantity(f"{name}[{i}]", item)
        return value
    return check_quantity(name, value)


class Reading(NamedTuple):
    """A part with numbers: `points` [m] that must be in view, `[point, 2]`, and `draw(axes, size)`,
    which adds it to axes, in pieces of a usual `size` [m], and returns what moves it to a frame."""

    points: np.ndarray
    draw: Callable[[Axes, float], Callable[[int], Any]]


class AbstractPart(abc.ABC):
    """A part of the drawing of a mechanism."""

    @abc.abstractmethod
    def read(self, scene: "Scene") -> Reading:
        """The part as the frames of a `Scene` have it."""


class Scene:
    """Frames of one run at equal distances of time; `part` is how messages call what reads them."""

    def __init__(self, source: Source, times: np.ndarray):
        self.source, self.times, self.part = source, times, ""
        self.held = intervals_of(source)

    def row(self, name: str, quantity: Any) -> np.ndarray:
        """A quantity over the frames, linear between the rows of the run."""
        if isinstance(quantity, int | float):
            return np.full(self.times.size, float(quantity))
        where = f"{self.part}.{name}"
        if self.source.dataset and callable(quantity):
            names = ", ".join(self.source.names)
            allowed = f"a number or one of {names}: a Dataset has no states for a function"
            raise refusal(where, quantity, allowed)
        function = self.source.function(where, _observable(quantity))
        found = self.source.row(quantity, function)
        if found.values.shape != self.source.time.shape:
            raise shape_refusal(where, found.values[0], "a single number")
        values = found.values
        if found.period is not None:
            values = np.unwrap(values, period=found.period)
        return np.interp(self.times, self.source.time, values)

    def place(self, name: str, place: Any) -> np.ndarray:
        """A place over the frames, `[frame, 2]`."""
        x, y = place if isinstance(place, tuple) else (place, 0.0)
        return np.stack([self.row(name, x), self.row(name, y)], axis=1)

    def colours(self, contact: str | None) -> list[str]:
        """A colour for each frame: whether the contact sticks; by default the only one there is."""
        if contact is None and len(self.held) == 1:
            (contact,) = self.held
        if contact is None:
            return [DARK] * self.times.size
        if contact not in self.held:
            among = f"of the contacts that may stick: {list_of_names(self.held)}"
            raise refusal(f"{self.part}.contact", contact, among)
        return [STICK if held else SLIP for held in self.sticks(contact)]

    def sticks(self, contact: str) -> np.ndarray:
        """Whether a contact sticks, at each frame."""
        found = np.zeros(self.times.shape, dtype=bool)
        for begin, end in self.held[contact]:
            found |= (begin <= self.times) & (self.times <= end)
        return found


def _observable(quantity: Any) -> Any:
    """A function of time and state as the observable that it is."""
    if isinstance(quantity, str):
        return quantity

    def read(system, t, y, dy, mode, args):
        return jnp.asarray(quantity(t, y), jnp.float64)

    return read
