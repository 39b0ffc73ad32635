"""Periodic orbits over one parameter as a family: steps, changes of the mode sequence, ends."""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem
from ._branching import zero_beside
from ._corner import across, led_back
from ._crossings import LEFT, PAIR, RIGHT, next_point_with_few, several_at_once
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
    zero_between,
)
from ._kinds import impacts, kind_of
from ._last import endless, hopf_point
from ._orbit import PeriodicOrbit
from ._point import Point, ahead, correct_from, is_astray, leaps, remeasure
from ._points import border, branching, doubling, growing, growths, is_torus, on_circle, turning
from ._switch import birth
from ._touches import touches
from ._walk import has_come_round

REPEATS = "repeats: a branch of a shorter period is met"
CLOSED = "closed: the branch has come round"
OWN = (
    Test("BP", branching, odd=True),
    Test("LP", turning, odd=True),
    Test("PD", doubling),
    # As exactly as multipliers are known: of a motion without damping they stay on the circle.
    Test("NS", on_circle, zero=ENGINE.zero),
)
SEVERAL = {RIGHT: ("BP", "LP"), LEFT: ("PD",), PAIR: ("NS",)}


@dataclasses.dataclass(frozen=True)
class Orbits(AbstractFamily):
    """Orbits of a problem with one parameter; `functions` of the orbit are tests of users.

    `turns`: how often the first one is repeated in its period.
    """

    problem: Problem
    functions: Mapping[str, Callable[[PeriodicOrbit], Any]]
    turns: int

    @property
    def names(self) -> tuple[str, ...]:
        return self.problem.names

    @property
    def control(self) -> Control:
        a = ACCURACY
        return Control(a.bend, a.shortest, a.patience, a.straight)

    def onward(self, point: Point, distance: float) -> Point | Failure:
        return ahead(self.problem, point, distance)

    def onward_anywhere(self, point: Point, distance: float) -> Point | Failure:
        return correct_from(self.problem, point, distance * point.tangent)

    def differs(self, point: Point, new: Point) -> bool:
        return new.sequence != point.sequence

    def cosine(self, point: Point, new: Point) -> float:
        return float(new.tangent @ point.tangent)

    def leaps(self, point: Point, new: Point, distance: float) -> bool:
        return leaps(point, new, distance)

    def is_quick(self, new: Point) -> bool:
        return new.evaluations <= ACCURACY.few

    def length(self, one: Point, other: Point) -> float:
        return float(np.linalg.norm(other.u - one.u)) if one.u.shape == other.u.shape else np.inf

    def at_level(self, point: Point, number: int, value: float) -> Point:
        return dataclasses.replace(point, values=np.array([value]))

    def orbit(self, point: Point, label: str = "") -> PeriodicOrbit:
        return point.orbit

    def sequence(self, point: Point) -> tuple:
        return point.sequence

    def slope(self, point: Point) -> np.ndarray:
        """Rates of the first point, of the period if it is an unknown, and of the parameter."""
        scale = units_of(self.problem, point)
        states = np.asarray(point.anchor.size).size
        return np.append(point.tangent[:states], point.tangent[states - scale.size :]) * scale

    def tests(self, point: Point) -> list[Test]:
        return [*OWN, *(Test(label, _of_orbit(f)) for label, f in self.functions.items())]

    def zero(
        self, before: Point, after: Point, distance: float, test: Test, found: list[Event]
    ) -> Point | Failure | None:
        if test.bound:
            return _at_bound(self.problem, before, after, distance, test)
        if test.label == "BP":
            # There Newton's method has no step; another branch point may be near on the other side.
            beside = zero_beside(self.problem, before, after, test)
            if not isinstance(beside, Failure):
                return beside
        if test.zero and abs(test(before)) <= test.zero:
            at = before  # a step may end on it
        else:
            at = zero_between(self.onward, before, after, distance, test)
        if isinstance(at, Failure) and test.label == "LP":
            beside = zero_beside(self.problem, before, after, test)
            at = at if isinstance(beside, Failure) else beside
        if isinstance(at, Failure):
            return at
        # Where the parameter turns at the point where branches cross there is no fold.
        crossings = [event.point.u for event in found if event.label == "BP"]
        near = any(np.linalg.norm(at.u - u) < ACCURACY.alike * distance for u in crossings)
        if (test.label == "LP" and near) or (test.label == "NS" and not is_torus(at)):
            return None
        return at

    def others(self, leg: Leg, found: list[Event]) -> list[Event]:
        """A branch of doubled orbits ends where it meets the orbit that it doubles: no fold."""
        for kind, labels in SEVERAL.items():
            found = several_at_once(self, growing, leg, found, kind, labels, growths)
        met = None if leg.backward or leg.distance == 0.0 else birth(self.problem, *_ends(leg))
        if met is None:
            return found
        found = [event for event in found if event.label[:2] not in ("LP", "BP") and not event.ends]
        return [*found, Event("EP", met, REPEATS, ends=True)]

    def remeasure(self, points: list[Point], new: Point) -> Point:
        return remeasure(self.problem, new)

    def over(self, points: list[Point], distance: float) -> str:
        if has_come_round(points, distance):
            return CLOSED
        words, over = self._endless(points)
        return words if over else ""

    def cut_off(self, points: list[Point]) -> str:
        return self._endless(points)[0] or "max_points"

    def _endless(self, points: list[Point]) -> tuple[str, bool]:
        """Words where the period grows without bound, and whether nothing is left of the branch."""
        if self.problem.forcing_period is not None:
            return "", False
        return endless(points, float(np.asarray(self.problem.unit)[0]))

    def advance(
        self, points: list[Point], distance: float, longest: float
    ) -> Iterator[Leg | Gap | Event | Reached]:
        problem, point = self.problem, points[-1]
        extent = _shrunk(point)
        if extent < ACCURACY.little:
            hopf = hopf_point(problem, point)
            if hopf is not None:
                yield Event("HB", hopf)
            yield Event("EP", point, "at_rest: the orbit shrinks to an equilibrium", ends=True)
            return
        first = min(distance, ACCURACY.shrinks * extent)
        found, distance = next_point_with_few(self, growing, point, first, longest)
        if isinstance(found, Point) and found.sequence == point.sequence:
            yield Leg(point, found, distance)
            yield Reached(found, longer(self, found, distance, longest))
            return
        # Either the step is too long, or the sequence of modes ends before.
        last, at = border(problem, point, distance, alike(point))
        yield Leg(point, last, at)
        way, near = None, False
        # Where a shorter step from there goes on Newton's method had gone elsewhere: any branch that is
        # near would be taken for what lies beyond.
        goes = ACCURACY.closes * longest < at < distance and self._goes_on(last, at)
        if at < distance and not goes:
            way, near = self._beyond(last, found, distance - at, ACCURACY.near * distance)
        if way is not None:
            yield from self._through(points, last, way, way[0] is found, near, (distance, longest))
        elif at >= distance or at > ACCURACY.closes * longest:
            # No border here: Newton's method had gone elsewhere.
            yield Reached(last, longer(self, last, at, longest))
        else:
            result = found.result if isinstance(found, Failure) else "not_converged"
            result = "grazes" if touches(problem, last, [last.tangent]) else result
            yield Event("EP", last, self._endless(points)[0] or result, ends=True)

    def _goes_on(self, point: Point, distance: float) -> bool:
        """Whether the branch does, in sizes measured anew: what was at rest may have begun to move."""
        point = remeasure(self.problem, point)
        new = ahead(self.problem, point, distance)
        return isinstance(new, Point) and alike(point)(new) and not leaps(point, new, distance)

    def _through(
        self, points: list[Point], last: Point, way: list[Point], alone: bool, near: bool,
        steps: tuple[float, float],
    ) -> Iterator[Leg | Gap | Event | Reached]:  # fmt: skip
        """Through a border of the mode sequence, along orbits that lead outwards on its other side.

        `alone`: no branch leads back from there, and between it and the border there may be others.
        `near`: whether the step need not begin anew.
        """
        distance, longest = steps
        edge = last if alone else self._edge(last, way[0])
        yield self._change(last, way[0], edge)
        yield Gap(last, way[0])
        if int(way[-1].orbit.repeats) > self.turns:
            yield Event("EP", last, REPEATS, ends=True)
            return
        begins = [] if edge.sequence == last.sequence else [edge]
        for before, after in itertools.pairwise([*begins, *way]):
            back = float((before.u - after.u) @ -after.tangent)
            yield Leg(before, after, back, backward=True)
            if np.linalg.norm(after.u - before.u) > ACCURACY.shrinks * longest and after is not way[-1]:
                yield Reached(after, distance)
        yield Reached(way[-1], longer(self, way[-1], distance if near else longest, longest))

    def _beyond(
        self, last: Point, found: Point | Failure, rest: float, least: float
    ) -> tuple[list[Point] | None, bool]:
        """Orbits beyond a border, outwards, None if there are none; and whether they lead to the orbit
        that was found there. Between that one and the border there may be others."""
        problem = self.problem
        if not isinstance(found, Point) or is_astray(found, last.u, max(rest, least), ACCURACY.strays):
            return across(problem, last, found), False
        way = led_back(problem, last, found)
        if way is not None:
            return way, True
        way = across(problem, last, Failure("not_converged"))
        return ([found], True) if way is None else (way, False)

    def _edge(self, last: Point, new: Point) -> Point:
        """The orbit at a border that is known best: of both sides, that with fewer impacts.

        With the speed of an impact that vanishes the parameter changes as its square, so that the
        orbits with it end, to rounding, far from the border. `new`: on the branch that leads away.
        """
        if impacts(new) >= impacts(last):
            return last
        reach = 2.0 * float(np.linalg.norm(last.u - new.u)) + ACCURACY.alike
        back = new if (last.u - new.u) @ new.tangent > 0 else new.backward()
        # The root of the distance may lead the orbits with impact to where those without go on.
        for way in (back, back.backward()):
            edge, at = border(self.problem, way, reach, alike(new))
            if at < reach:
                return edge.backward()
        return last

    def _change(self, last: Point, new: Point, edge: Point) -> Event:
        """The border between two sequences, at one of its orbits: an event more or less, or others."""
        events = int(last.orbit.events.count), int(new.orbit.events.count)
        kind = kind_of(self.problem.system, last, new)
        words = f"{kind}{', ' * bool(kind)}{events[0]} events, {events[1]} beyond"
        same = events[0] == events[1] and impacts(last) == impacts(new)
        return Event("SQ" if same else "GR", edge, words)


def units_of(problem: Problem, point: Point) -> np.ndarray:
    """Sizes of the first point, of the period if it is an unknown, and of the parameter, in units."""
    scales = [np.asarray(point.anchor.size)]
    if problem.forcing_period is None:
        scales.append(np.asarray([float(point.anchor.period)]))
    return np.concatenate([*scales, np.asarray(problem.unit)])


def alike(point: Point) -> Callable[[Point], bool]:
    """Whether another point has the same sequence of modes, as often round."""
    turns = int(point.orbit.repeats)
    return lambda other: other.sequence == point.sequence and int(other.orbit.repeats) == turns


def _of_orbit(function: Callable[[PeriodicOrbit], Any]) -> Callable[[Point], float]:
    return lambda point: float(function(point.orbit))


def _ends(leg: Leg) -> tuple[Point, Point, float]:
    return leg.before, leg.after, leg.distance


def _shrunk(point: Point) -> float:
    """Extent of the motion, in parts of the largest that it had on the branch."""
    anchor = point.anchor
    return float(np.max(np.asarray(anchor.extent) / np.asarray(anchor.largest)))


def _at_bound(problem: Problem, before: Point, after: Point, distance: float, test: Test) -> Point:
    """The orbit at the bound that lies between two others, or the last one found within the bounds.

    Where Newton's method does not get there from the first one, from another one nearer to it.
    """
    onward = functools.partial(ahead, problem)
    for _ in range(ACCURACY.rounds):
        found = zero_between(onward, before, after, distance, test)
        if isinstance(found, Point):
            return found
        nearer = _nearest(problem, before, distance)
        if nearer is None:
            break
        step, point = nearer
        if test(point) >= 0.0:
            before, distance = point, float((after.u - point.u) @ point.tangent)
        else:
            after, distance = point, step
    return before


def _nearest(problem: Problem, before: Point, distance: float) -> tuple[float, Point] | None:
    """The first orbit of the branch that is found with ever shorter steps, and its step."""
    for step in (distance * ACCURACY.shorter**k for k in range(1, ACCURACY.rounds)):
        point = ahead(problem, before, step)
        if isinstance(point, Failure) or point.sequence != before.sequence:
            continue
        if not leaps(before, point, step):
            return step, point
    return None
