"""A family of solutions that a branch goes through: what a walk asks for, and one step along it."""

import abc
import dataclasses
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
from scipy.optimize import brentq

from ._accuracy import ACCURACY


@dataclasses.dataclass(frozen=True)
class Failure:
    """Why there is no point: a name of `ORBITS`, or words."""

    result: str


@dataclasses.dataclass(frozen=True)
class Test:
    """A function of a point whose zero between two points of a branch is an event.

    - `label`: of the event; `words` say more about it. `ends`: whether the branch ends there.
    - `zero`: values as small as this have no sign. `odd`: whether the function has the other sign where
      the branch is followed the other way.
    - `level`: number and value of a parameter that is asked for, and then met exactly. `bound`: whether
      the function is the distance from a bound, which is still within.
    """

    label: str
    function: Callable[[Any], float]
    words: str = ""
    ends: bool = False
    zero: float = 0.0
    odd: bool = False
    level: tuple[int, float] | None = None
    bound: bool = False

    def __call__(self, point: Any) -> float:
        return self.function(point)

    def sign(self, point: Any) -> int:
        """1 or -1, and 0 where the function is zero or no number."""
        value = self.function(point)
        if self.bound:
            return 1 if value >= 0.0 else -1
        return int(value > self.zero) - int(value < -self.zero)


@dataclasses.dataclass(frozen=True)
class Event:
    """A special point of a branch: `index` is the number of the point before it.

    `ends`: whether the branch ends there; `located`: whether the end is a point of the branch too.
    """

    label: str
    point: Any
    words: str = ""
    index: int = 0
    ends: bool = False
    located: bool = False

    def at(self, index: int) -> "Event":
        """The same after another point."""
        return dataclasses.replace(self, index=index)


@dataclasses.dataclass(frozen=True)
class Leg:
    """A smooth piece of a branch, on which events are looked for.

    The later point lies at `distance` along the tangent of the earlier one; `backward`: the earlier one
    at that distance back along the tangent of the later one.
    """

    before: Any
    after: Any
    distance: float
    backward: bool = False


@dataclasses.dataclass(frozen=True)
class Gap:
    """Two neighbours on a branch between which functions of them may jump."""

    before: Any
    after: Any


@dataclasses.dataclass(frozen=True)
class Reached:
    """A point that the branch goes on from, and the length of the next step."""

    point: Any
    distance: float


@dataclasses.dataclass(frozen=True)
class Control:
    """How steps are shortened.

    - `bend`: cosine of the largest angle between two tangents. `straight`: above this cosine a step
      that follows a failure is not what the failure came from; None: no cosine says so.
    - `shortest`: part of the first length below which a step is not shortened for a bend.
    - `patience`: the same where the corrector fails.
    """

    bend: float
    shortest: float
    patience: float
    straight: float | None = None


class AbstractFamily(abc.ABC):
    """Solutions over one parameter or two. A point has `values` of these, and `backward()`."""

    names: tuple[str, ...]
    control: Control

    @abc.abstractmethod
    def onward(self, point: Any, distance: float) -> Any:
        """Corrector: the point at a distance along the tangent of another one, or a `Failure`."""

    @abc.abstractmethod
    def advance(
        self, points: list, distance: float, longest: float
    ) -> Iterator[Leg | Gap | Event | Reached]:
        """One step from the last point: pieces of the branch in order, up to a point or an end."""

    @abc.abstractmethod
    def tests(self, point: Any) -> list[Test]:
        """Functions whose zeros are looked for behind a point."""

    @abc.abstractmethod
    def cosine(self, point: Any, new: Any) -> float:
        """Cosine of the angle between the directions of the branch at two points."""

    @abc.abstractmethod
    def length(self, one: Any, other: Any) -> float:
        """Distance of two points."""

    @abc.abstractmethod
    def at_level(self, point: Any, number: int, value: float) -> Any:
        """A point that was located at a value of a parameter, with the very value."""

    @abc.abstractmethod
    def orbit(self, point: Any, label: str = "") -> Any:
        """The solution as users see it, at a special point with a label."""

    @abc.abstractmethod
    def sequence(self, point: Any) -> tuple:
        """Guards and modes of a solution, from wherever it begins."""

    @abc.abstractmethod
    def slope(self, point: Any) -> Any:
        """Direction of the branch, in units."""

    def onward_anywhere(self, point: Any, distance: float) -> Any:
        """The corrector, whose result may lie on another branch."""
        return self.onward(point, distance)

    def leaps(self, point: Any, new: Any, distance: float) -> bool:
        """Whether a point, a step ahead, lies on another branch."""
        return False

    def differs(self, point: Any, new: Any) -> bool:
        """Whether a point is of another kind: between both the branch is not smooth."""
        return False

    def is_quick(self, new: Any) -> bool:
        """Whether the corrector found a point so easily that the next step may be longer."""
        return True

    def zero(self, before: Any, after: Any, distance: float, test: Test, found: list[Event]) -> Any:
        """The point between two others where a test is zero; a `Failure`, or None: there is no event.

        `found`: events that are known between both.
        """
        return zero_between(self.onward, before, after, distance, test)

    def others(self, leg: Leg, found: list[Event]) -> list[Event]:
        """Events of a leg with those that are no zeros of a test, from those found."""
        return found

    def remeasure(self, points: list, new: Any) -> Any:
        """A new point, measured around itself."""
        return new

    def over(self, points: list, distance: float) -> str:
        """Words where the branch ends at its last point; empty where it goes on."""
        return ""

    def cut_off(self, points: list) -> str:
        """Words for a branch that ends since it has enough points."""
        return "max_points"


def next_point(family: AbstractFamily, point: Any, distance: float) -> tuple[Any, float]:
    """The next point and the step to it, shortened where the branch bends; or why there is none.

    A point that differs may be far away, and on another branch. Newton's method fails beyond the last
    point of a kind, and from afar where the branch bends soon. A little nearer it still needs many
    evaluations at a bend, but few before a border, which no ever shorter steps approach.
    """
    control, failed = family.control, None
    shortest = distance * control.shortest
    while True:
        new = family.onward_anywhere(point, distance)
        if isinstance(new, Failure):
            failed = failed or (new, distance)
            if distance <= failed[1] * control.patience:
                return failed
        elif family.differs(point, new):
            return failed or (new, distance)
        else:
            turn, leaps = family.cosine(point, new), family.leaps(point, new, distance)
            if not leaps and turn > control.bend:
                straight = control.straight is not None and turn > control.straight
                if failed and straight and family.is_quick(new):
                    return failed
                return new, distance
            if distance <= shortest:
                return (Failure("not_converged") if leaps else new), distance
        # By halves: a point before a bend is found with few evaluations, or not at all.
        distance *= ACCURACY.shorter


def longer(family: AbstractFamily, new: Any, distance: float, longest: float) -> float:
    """Length of the step after one that succeeded."""
    return min(distance * ACCURACY.longer, longest) if family.is_quick(new) else distance


def least_with_sign(factors: Iterable[complex]) -> float:
    """The least magnitude, at most 1, with the sign of the product of all, which is real.

    The product itself is rounding where many factors are small, as of modes that are hardly damped.
    """
    found = np.array([1.0, *factors], complex)
    sizes = np.abs(found)
    sign = np.prod(found / np.where(sizes > 0.0, sizes, 1.0))
    return float(np.min(sizes) * np.sign(np.round(np.real(sign))))


def zero_between(
    onward: Callable[[Any, float], Any], before: Any, after: Any, distance: float,
    test: Callable[[Any], float], bracket: tuple[float, float] | None = None, known: dict | None = None,
) -> Any:  # fmt: skip
    """The point between two others where a function is zero, by Brent's method.

    `onward(before, distance)`: the point at a distance from the first. `bracket`: distances between
    which the zero lies, by default all of it; `known`: points at distances. A `Failure` where a point
    between is not found, or where the function jumps over zero.
    """
    ends = {0.0: before, distance: after, **(known or {})}
    bracket = bracket or (0.0, distance)
    largest = max(abs(test(ends[at])) for at in bracket)

    def value(at: float) -> float:
        found = ends.get(at)
        if found is None:
            found = onward(before, at)
            if isinstance(found, Failure):
                raise ArithmeticError(found.result)
            ends[at] = found
        return test(found)

    try:
        found: Any = brentq(value, *bracket, xtol=1e-15, rtol=1e-14)  # pyright: ignore[reportArgumentType]
        root = float(found)
        if abs(value(root)) > ACCURACY.alike * largest:
            return Failure("the function jumps there")
    except (ArithmeticError, ValueError) as error:
        return Failure(str(error))
    return ends[root]
