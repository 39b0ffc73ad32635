"""The curve over two parameters on which orbits of one sequence of modes end."""

import dataclasses
from collections.abc import Callable

import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem
from ._curves import AbstractCurve, Place, last_place, place_along, reason_of
from ._family import Event, Failure, Leg
from ._point import Point, ahead, correct, is_astray
from ._points import border
from ._touches import TOUCHING, decades, events_of, first_difference

CORNER = "GRGR: the border of another sequence of modes is met"


class Border(AbstractCurve):
    """The curve on which orbits of one sequence of modes end, by bisection across it."""

    def __init__(self, problem: Problem, label: str, sequence: tuple):
        self.problem, self.label, self.own = problem, label, sequence

    def reason(self, last: Place, failure: Failure) -> str:
        return CORNER if self.corner(last) else reason_of(self.problem, last, failure)

    def others(self, leg: Leg, found: list[Event]) -> list[Event]:
        """The corner at which the border of another event is met, nearer than all else."""
        last = self.corner_between(leg.before, leg.after, leg.distance)
        if last is None:
            return found
        found = [event for event in found if not event.ends]
        return [*found, Event("EP", last, CORNER, ends=True, located=True)]

    def begin(self, point: Point, distance: float) -> Place | Failure:
        """A place at an orbit that nearly is the last one of its sequence.

        On a small circle around it in the plane of orbits the others of its kind are an arc, from one
        direction of the curve to the other.
        """

        def direction(angle: float) -> np.ndarray:
            return np.array([np.cos(angle), np.sin(angle)]) @ point.tangent

        def inside(angle: float, radius: float) -> bool:
            found = ahead(self.problem, point, radius, direction(angle))
            return not isinstance(found, Failure) and self._alike(found)

        turn = 2.0 * np.pi / ACCURACY.around
        for part in (0.03, 0.003, 0.3):
            radius = part * distance
            # Two edges, or the circle is too large for the border to be straight in it.
            there = [inside(k * turn, radius) for k in range(ACCURACY.around)]
            edges = [k for k in range(ACCURACY.around) if there[k - 1] != there[k]]
            if len(edges) != 2:
                continue
            ends = {}
            for k in edges:
                one, two = (k - 1) * turn, k * turn
                while two - one > ENGINE.same:
                    middle = 0.5 * (one + two)
                    one, two = (
                        (middle, two) if inside(middle, radius) == there[k - 1] else (one, middle)
                    )
                ends[there[k]] = 0.5 * (one + two)
            arc = (ends[False] - ends[True]) % (2.0 * np.pi)
            normal = direction(ends[True] + 0.5 * arc)
            place = Place(point, normal, normal, 1.0)
            last, _ = border(self.problem, point, radius, self._alike, -normal)
            return place_along(place, last, direction(ends[False]) - direction(ends[True]), 1.0)
        return Failure("mode_differs")

    def onward(self, place: Place, distance: float) -> Place | Failure:
        """The place at a distance along the curve."""
        found = self._across(place, distance)
        return found if isinstance(found, Failure) else place.led_to(found, 1.0)

    def outside(self, place: Place) -> tuple | None:
        """The first event of a motion just beyond a place that is not as on the orbit.

        `(index, guard, mode after)`, or None where none is seen. Later events do not matter: a
        first touch of a stop kicks as the square root of how deep it is, into other borders too.
        """
        own = events_of(self.problem, place.point, place.point.u)
        for beside in TOUCHING:
            found = events_of(self.problem, place.point, place.point.u - beside * place.normal)
            if found != own:
                return first_difference(own, found)
        return None

    def alike(self, place: Place) -> Callable[[Place], bool]:
        """Beyond a corner the last orbit across this border is the last one of another border.

        Across the first place, because a short chord to the other has no direction.
        """
        beyond, normal = self.outside(place), place.normal
        return lambda other: self.outside(dataclasses.replace(other, normal=normal)) == beyond

    def corner_between(self, before: Place, after: Place, distance: float) -> Place | None:
        """The place between two others where the border of another event is met, if there is one."""
        alike = self.alike(before)
        if alike(after):
            return None
        last = last_place(self, before, distance, alike)
        return last if self.corner(last) else None

    def corner(self, place: Place) -> bool:
        """Whether motions near a place differ from its orbit in more than one first event."""
        own = events_of(self.problem, place.point, place.point.u)
        directions = [
            side * place.way - lean * place.normal
            for side in (1.0, -1.0)
            for lean in (-0.3, 0.3, 1.0, 3.0)
        ]
        for beside in decades(ENGINE.same, ACCURACY.little):
            beyond = {
                first_difference(
                    own, events_of(self.problem, place.point, place.point.u + beside * direction)
                )
                for direction in directions
            } - {None}
            if len(beyond) > 1:
                return True
        return False

    def _alike(self, point: Point) -> bool:
        return point.sequence == self.own

    def _across(self, place: Place, distance: float) -> Point | Failure:
        """The last orbit on the line across the curve, at a distance along it."""
        begin = place.point
        # On the tangent first; where the border bends towards the orbits they are a little inside.
        for inside in ACCURACY.inside:
            there = begin.u + distance * (place.way + inside * place.normal)
            found = correct(
                self.problem, there, begin.modes, begin.anchor, begin.tangent, begin.tangent
            )  # fmt: skip
            if is_astray(found, there, (1.0 + inside) * distance, 1.0):
                continue
            if not isinstance(found, Failure) and self._alike(found):
                reach = (1.0 + 2.0 * inside) * distance
                last, at = border(self.problem, found, reach, self._alike, -place.normal)
                return last if at < reach else Failure("mode_differs")
        return Failure("mode_differs")
