"""Curves of special points over two parameters: one place after the other in the plane of orbits."""

import abc
import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem
from ._degenerate import degenerate
from ._family import (
    AbstractFamily,
    Control,
    Event,
    Failure,
    Gap,
    Leg,
    Reached,
    Test,
    longer,
    next_point,
)
from ._orbit import PeriodicOrbit
from ._point import Point, ahead, beginning_elsewhere
from ._touches import touches
from ._walk import has_come_round


@dataclasses.dataclass(frozen=True)
class Place:
    """A point of the curve; `way` along it and `normal` across it, unit vectors in the plane of orbits.

    `steep`: slope of the test along the normal. For a border the normal points to the orbits there are.
    """

    point: Point
    way: np.ndarray
    normal: np.ndarray
    steep: float

    @property
    def values(self) -> np.ndarray:
        return self.point.values

    @property
    def orbit(self) -> PeriodicOrbit:
        return self.point.orbit

    @property
    def anchor(self) -> Any:
        return self.point.anchor

    @property
    def sequence(self) -> tuple:
        return self.point.sequence

    @property
    def rates(self) -> np.ndarray:
        """Rates of the parameters along the curve."""
        return self.way[-2:]

    @property
    def place(self) -> np.ndarray:
        """The parameters in parts of the bounds' distances."""
        return self.point.place

    def backward(self) -> "Place":
        """The same, with the curve followed the other way."""
        return dataclasses.replace(self, way=-self.way)

    def led_to(self, point: Point, steep: float) -> "Place":
        """Another point not far along the curve; its direction is that of the parabola through both.

        A chord as short as points are apart by rounding has no direction: the old one is kept.
        """
        chord = point.u - self.point.u
        length = np.linalg.norm(chord)
        if length < ENGINE.same:
            return place_along(self, point, self.way, steep)
        chord = chord / length
        return place_along(self, point, 2.0 * (chord @ self.way) * chord - self.way, steep)


def place_along(old: Place, point: Point, along: np.ndarray, steep: float) -> Place:
    """A point with a direction of the curve and the normal on the side of the old one."""
    one, two = point.tangent @ along
    size = np.hypot(one, two)
    normal = np.array([-two, one]) / size @ point.tangent
    normal = normal if normal @ old.normal > 0 else -normal
    return Place(point, np.array([one, two]) / size @ point.tangent, normal, steep)


class AbstractCurve(AbstractFamily):
    """A curve in the surface of orbits of a problem with two parameters, of points with a `label`."""

    problem: Problem
    label: str

    @property
    def names(self) -> tuple[str, ...]:
        return self.problem.names

    @property
    def control(self) -> Control:
        return Control(ACCURACY.bend, ACCURACY.shortest, ACCURACY.shortest)

    @abc.abstractmethod
    def reason(self, last: Place, failure: Failure) -> str:
        """Why the curve ends at its last place."""

    def alike(self, place: Place) -> Callable[[Place], bool] | None:
        """Return what tells places of this curve from those of another that crosses it, if needed."""
        return None

    def tests(self, point: Place) -> list[Test]:
        return degenerate(self.label, point)

    def cosine(self, point: Place, new: Place) -> float:
        return float(new.way @ point.way)

    def length(self, one: Place, other: Place) -> float:
        return float(np.linalg.norm(other.point.u - one.point.u))

    def at_level(self, point: Place, number: int, value: float) -> Place:
        values = np.array(point.values, float)
        values[number] = value
        return dataclasses.replace(point, point=dataclasses.replace(point.point, values=values))

    def orbit(self, point: Place, label: str = "") -> PeriodicOrbit:
        return point.orbit

    def sequence(self, point: Place) -> tuple:
        return point.sequence

    def slope(self, point: Place) -> np.ndarray:
        """Rates of both parameters."""
        return point.rates * np.asarray(self.problem.unit)

    def remeasure(self, points: list[Place], new: Place) -> Place:
        return elsewhere(self.problem, new)

    def over(self, points: list[Place], distance: float) -> str:
        return "closed: the curve has come round" if has_come_round(points, distance) else ""

    def advance(
        self, points: list[Place], distance: float, longest: float
    ) -> Iterator[Leg | Gap | Event | Reached]:
        place = points[-1]
        new, distance = next_point(self, place, distance)
        if isinstance(new, Failure):
            distance *= ACCURACY.shortest  # the last that was tried
            last = last_place(self, place, distance, self.alike(place))
            if last is not place:
                yield Leg(place, last, self.length(place, last))
            yield Event(
                "EP", last, self.reason(last, new), ends=True, located=last is not place
            )  # fmt: skip
            return
        yield Leg(place, new, distance)
        yield Reached(new, longer(self, new, distance, longest))


class Zeros(AbstractCurve):
    """The curve on which a smooth function of the orbit is zero, by secants across it."""

    def __init__(self, problem: Problem, label: str, test: Callable[[Point], float]):
        self.problem, self.label, self.test = problem, label, test

    def reason(self, last: Place, failure: Failure) -> str:
        return reason_of(self.problem, last, failure)

    def begin(self, point: Point) -> Place | Failure:
        """A place at a point that nearly is on the curve."""
        slopes = self._slopes(point)
        if slopes is None:
            return Failure("singular")
        across = slopes / np.linalg.norm(slopes) @ point.tangent
        near = Place(point, across, across, float(np.linalg.norm(slopes)))
        found = self._zero_across(near, point, ACCURACY.near)
        return found if isinstance(found, Failure) else self._with_slopes(near, *found)

    def onward(self, place: Place, distance: float) -> Place | Failure:
        """The place at a distance along the curve."""
        near = ahead(self.problem, place.point, distance, place.way)
        if isinstance(near, Failure):
            return near
        found = self._zero_across(place, near, distance)
        return found if isinstance(found, Failure) else self._with_slopes(place, *found)

    def _slopes(self, point: Point) -> np.ndarray | None:
        """Slopes of the test by the coordinates of the plane; None where its sequence of modes ends."""
        found = []
        for row in point.tangent:
            ends = []
            for d in (-ACCURACY.little, ACCURACY.little):
                p = ahead(self.problem, point, d, row)
                if isinstance(p, Failure) or p.sequence != point.sequence:
                    return None
                ends.append(self.test(p))
            found.append((ends[1] - ends[0]) / (2.0 * ACCURACY.little))
        slopes = np.asarray(found)
        return slopes if np.linalg.norm(slopes) > 0.0 else None

    def _with_slopes(self, old: Place, point: Point, steep: float) -> Place:
        slopes = self._slopes(point)
        if slopes is None:
            return old.led_to(point, steep)
        steep = float(np.linalg.norm(slopes))
        across = slopes / steep
        way = np.array([-across[1], across[0]]) @ point.tangent
        return Place(point, way if way @ old.way >= 0 else -way, across @ point.tangent, steep)

    def _zero_across(self, place: Place, near: Point, reach: float) -> tuple[Point, float] | Failure:
        """The zero on the line across the curve through a point near it, and the slope there."""
        if near.sequence != place.point.sequence:
            return Failure("mode_differs")
        at, best, slope = 0.0, near, place.steep
        value = self.test(near)
        for _ in range(ACCURACY.tries):
            step = -value / slope
            if value == 0.0 or abs(step) <= ACCURACY.short:
                return best, slope
            if not abs(at + step) <= reach:
                return Failure("not_converged")
            found = ahead(self.problem, near, at + step, place.normal)
            if isinstance(found, Failure):
                return found
            if found.sequence != near.sequence:
                return Failure("mode_differs")
            new = self.test(found)
            if abs(new) >= abs(value) and abs(step) < ACCURACY.closes:
                return best, slope  # rounding
            slope = (new - value) / step if new != value else slope
            at, value, best = at + step, new, found
        return Failure("not_converged")


def reason_of(problem: Problem, last: Place, failure: Failure) -> str:
    """Why a curve ends at its last place."""
    if failure.result == "mode_differs" or touches(problem, last.point, [last.way, last.normal]):
        return "grazes: the sequence of modes ends here"
    return f"{failure.result}: the next orbit was not found"


def elsewhere(problem: Problem, place: Place) -> Place:
    """The same place measured around its own orbit, where that is possible."""
    old, found = place.point, beginning_elsewhere(problem, place.point)
    if isinstance(found, Failure) or found[0].sequence != old.sequence:
        return place
    new, shift = found
    states, free = np.asarray(new.anchor.size).size, 2 + (problem.forcing_period is None)
    ratio = np.asarray(old.anchor.size) / np.asarray(new.anchor.size)

    def comparable(vector: np.ndarray, ratio: np.ndarray | float) -> np.ndarray:
        # States at different instants of the orbit are not.
        return vector[-free:] if shift else np.append(vector[:states] * ratio, vector[-free:])

    basis = np.stack([comparable(row, 1.0) for row in new.tangent], axis=1)
    way, normal = (
        np.linalg.lstsq(basis, comparable(vector, ratio), rcond=None)[0]
        for vector in (place.way, place.normal)
    )
    length = np.linalg.norm(way)
    if not length > 0.0:
        return place
    way = way / length
    across = np.array([-way[1], way[0]])
    side = 1.0 if across @ normal >= 0 else -1.0
    # The basis keeps its sense against both, so that functions of the basis keep their sign.
    before = np.linalg.det([old.tangent @ place.way, old.tangent @ place.normal])
    if before * side < 0:
        new = dataclasses.replace(new, tangent=new.tangent[::-1])
        way, across = way[::-1], across[::-1]
    return Place(new, way @ new.tangent, side * across @ new.tangent, place.steep)


def last_place(
    curve: AbstractCurve, place: Place, distance: float, alike: Callable[[Place], bool] | None = None
) -> Place:
    """The last place of the curve within a distance, or the last of those that are alike.

    At a corner of the region of orbits their room beside the curve becomes as narrow as what is left
    of the way, so that the search is begun again from the last place found, with shorter steps.
    """
    last, span = place, distance
    for _ in range(ACCURACY.rounds):
        low, high, best = 0.0, span, last
        while high - low > ACCURACY.nearer * span:
            middle = 0.5 * (low + high)
            found = curve.onward(last, middle)
            if isinstance(found, Failure) or (alike is not None and not alike(found)):
                high = middle
            else:
                low, best = middle, found
        last, span = best, 4.0 * (high - low)  # more than was left, for it is a little off
        if span < ENGINE.zero * distance:
            break
    return last
