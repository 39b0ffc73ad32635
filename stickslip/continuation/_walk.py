"""`follow`: the one walk along a branch, whatever its points are, with all its events."""

import dataclasses
from typing import Any

import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ..progress import tell
from ._accuracy import ACCURACY
from ._family import AbstractFamily, Event, Failure, Gap, Leg, Test, zero_between
from ._options import Follow

Bounds = tuple[tuple[float, float], ...]


@dataclasses.dataclass(frozen=True)
class Half:
    """Points of a branch to one side of its start, with its events; the last one says why it ends."""

    points: list
    events: list[Event]


def follow(
    family: AbstractFamily, start: Any, bounds: Bounds, options: Follow, *, first: bool = True
) -> Half:
    """Points from `start` along its tangent, up to a bound, an end of the family, or `max_points`.

    Each step is a predictor, a corrector and a control of its length, in `family.advance`. All that
    has a label is a test that changes its sign, on a smooth piece of the branch or across a gap: folds
    and doublings, functions of users, values asked for, bounds. `first`: whether this is the first half
    from its start, which has the events there.
    """
    watch = _Watch(family, bounds, options)
    points, events, distance = [start], [], options.step
    if first:
        events += watch.begin(start, options.step)
    while len(points) < options.max_points:
        for item in family.advance(points, distance, options.step):
            if isinstance(item, Leg):
                found = watch.on_leg(item)
            elif isinstance(item, Gap):
                found = watch.across(item)
            elif isinstance(item, Event):
                found = [item] if item.ends or watch.within(item.point) else []
            else:
                distance = item.distance
                points.append(family.remeasure(points, item.point))
                tell(_place(family, points))
                words = family.over(points, distance)
                found = [Event("EP", points[-1], words, ends=True)] if words else []
            for event in found:
                events.append(event.at(len(points) - 1))
                if event.ends:
                    return Half([*points, event.point] if event.located else points, events)
    if first or len(points) > 1:
        events += [event.at(len(points) - 1) for event in watch.finish(points[-1], options.step)]
    events.append(Event("EP", points[-1], family.cut_off(points), len(points) - 1))
    return Half(points, events)


def _place(family: AbstractFamily, points: list) -> str:
    """How many points there are, and the parameters at the last of them."""
    there = zip(family.names, points[-1].values, strict=True)
    return f"{len(points)} points, {', '.join(f'{name} = {float(v):.6g}' for name, v in there)}"


def join(forward: Half, backward: Half, shared: bool = True) -> Half:
    """Both halves as one, the second one backwards; `shared`: whether both begin with one point."""
    points, marks = forward.points, forward.events
    if shared:
        points, marks = points[1:], [mark.at(mark.index - 1) for mark in marks]
    # Of two points the one before is the later one of the backward half.
    count = len(backward.points)
    events = [mark.at(max(count - mark.index - 2, 0)) for mark in reversed(backward.events)]
    events += [mark.at(count + mark.index) for mark in marks]
    return Half(backward.points[::-1] + points, events)


class _Watch:
    """Tests along a branch, with the sign that each of them had.

    A function that is zero at a point keeps the sign that it had, so that a zero which is met exactly
    is found once, with the next point.
    """

    def __init__(self, family: AbstractFamily, bounds: Bounds, options: Follow):
        self.family, self.bounds, self.step = family, bounds, options.step
        self.signs: dict[Any, int] = {}
        self.own = [
            Test("UZ", _distance_from(number, value), level=(number, value))
            for number, row in enumerate(options.values_by_parameter(len(family.names)))
            for value in row
        ]
        for number, (low, high) in enumerate(bounds):
            words = "bounds" if len(bounds) == 1 else f"bounds of {family.names[number]}"
            for value, sign in ((low, 1.0), (high, -1.0)):
                far, level = _distance_from(number, value, sign), (number, value)
                self.own.append(Test("EP", far, words, ends=True, bound=True, level=level))

    def within(self, point: Any) -> bool:
        """Whether all parameters are within their bounds."""
        ends = zip(point.values, self.bounds, strict=True)
        return all(low <= value <= high for value, (low, high) in ends)

    def tests(self, point: Any) -> list[Test]:
        return [*self.family.tests(point), *self.own]

    def begin(self, start: Any, step: float) -> list[Event]:
        """Values asked for that are those of the start. Tests that are zero have an earlier sign."""
        behind = None
        for test in self.family.tests(start):
            if not self._sign(test, start) and test(start) == test(start):
                behind = self._nearby(start.backward(), step) if behind is None else behind
                if not isinstance(behind, Failure):
                    self.signs[_key(test)] = test.sign(behind) * (-1 if test.odd else 1)
        return [Event("UZ", start) for test in self.own if not test.bound and test(start) == 0.0]

    def on_leg(self, leg: Leg) -> list[Event]:
        """Events between two points, in order, up to the first one at which the branch ends."""
        if leg.backward:  # the later point was found first
            before, after = leg.after.backward(), leg.before.backward()
        else:
            before, after = leg.before, leg.after
        found: list[Event] = []
        outside = not self.within(leg.after)
        for test in self.tests(before):
            key, now = _key(test), test.sign(after)
            was = (0 if leg.backward else self.signs.get(key, 0)) or test.sign(before)
            if not now and outside and not leg.backward and test.zero:
                beyond = self._nearby(after, self.step)
                now = now if isinstance(beyond, Failure) else test.sign(beyond)
            self.signs[key] = now or (was if test(after) == test(after) else 0)
            # Beside a border, where the sign was another, a piece may have no length.
            if was * now < 0 and leg.distance != 0.0:
                found += self._event(test, before, after, leg, found)
        found += self._there_and_back(before, after, leg, found)
        if leg.backward:
            self.signs = {_key(test): test.sign(leg.after) for test in self.tests(leg.after)}
            found = [dataclasses.replace(event, point=event.point.backward()) for event in found]
        found = self.family.others(leg, found)
        far = {id(event): self.family.length(leg.before, event.point) for event in found}
        ends = [far[id(event)] for event in found if event.ends]
        last = min(ends, default=np.inf) * (1.0 + ENGINE.same) + ENGINE.same**2
        found = sorted(found, key=lambda event: (far[id(event)], event.ends))
        kept = [event for event in found if not event.ends and far[id(event)] <= last]
        return kept + [event for event in found if event.ends][:1]

    def _there_and_back(self, before: Any, after: Any, leg: Leg, found: list[Event]) -> list[Event]:
        """Values of a parameter that are passed twice between two points, since it turns there."""
        family, events = self.family, []
        for number in range(len(family.names)):

            def rate(point: Any, place: int = number - len(family.names)) -> float:
                return float(np.atleast_1d(family.slope(point))[place])

            own = [test for test in self.own if test.level is not None and test.level[0] == number]
            same = [test for test in own if test.sign(before) * test.sign(after) > 0]
            # As far as the parameter would come without a turn, from either end.
            reach = leg.distance * (abs(rate(before)) + abs(rate(after)))
            near = [test for test in same if min(abs(test(p)) for p in (before, after)) <= reach]
            if rate(before) * rate(after) >= 0.0 or not near:
                continue
            folds = [event.point for event in found if event.label == "LP"]
            turn = folds[0] if folds else zero_between(family.onward, before, after, leg.distance, rate)
            if isinstance(turn, Failure):
                words = (
                    f"not located: it may turn between here and {after.values[0]:.10g}, {turn.result}"
                )
                asked = [test for test in near if not test.bound]
                events += [Event(f"{test.label}?", before, words) for test in asked]
                continue
            for test in near:
                for one, two in ((before, turn), (turn, after)):
                    if test.sign(one) * test.sign(two) < 0:
                        part = Leg(one, two, family.length(one, two))
                        events += self._event(test, one, two, part, found)
        return events

    def across(self, gap: Gap) -> list[Event]:
        """Values asked for, and bounds, between two points that are not joined by a smooth piece."""
        found, ends = [], []
        self.signs = {}
        for test in self.own:
            if test.sign(gap.before) * test.sign(gap.after) >= 0:
                continue
            if test.bound:
                ends.append(self._end(test, gap.before))
            else:
                near = min((gap.before, gap.after), key=lambda point: abs(test(point)))
                words = "not located: at a change of the mode sequence, between here and"
                found.append(Event("UZ?", near, f"{words} {gap.after.values[0]:.10g}"))
        return found + ends[:1]

    def finish(self, last: Any, step: float) -> list[Event]:
        """Events exactly at the last point of a branch that would go on."""
        found: list[Event] = []
        for test in self.family.tests(last):
            if test.zero and not test.sign(last) and self.signs.get(_key(test)):
                beyond = self._nearby(last, step)
                now = 0 if isinstance(beyond, Failure) else test.sign(beyond)
                if now * self.signs[_key(test)] < 0:
                    found += self._event(test, last, last, Leg(last, last, 0.0), found)
        return found

    def _sign(self, test: Test, point: Any) -> int:
        return self.signs.setdefault(_key(test), test.sign(point))

    def _nearby(self, point: Any, step: float) -> Any:
        """A point a little farther along the branch."""
        for part in ACCURACY.patience ** np.arange(1.0, 4.0):
            new = self.family.onward(point, part * step)
            if not isinstance(new, Failure) and not self.family.leaps(point, new, part * step):
                return new
        return Failure("not_converged")

    def _event(self, test: Test, before: Any, after: Any, leg: Leg, found: list[Event]) -> list[Event]:
        at = self.family.zero(before, after, leg.distance, test, found)
        if at is None:
            return []
        if isinstance(at, Failure):
            if test.bound:
                return [self._end(test, after if leg.backward else before)]
            words = f"not located: between here and {leg.after.values[0]:.10g}, {at.result}"
            return [Event(f"{test.label}?", before, words)]
        if test.bound:
            return [self._end(test, at)]
        if test.level is not None:
            at = self.family.at_level(at, *test.level)
        event = Event(test.label, at, test.words)
        if not test.ends:
            return [event]
        words = f"{test.label}: {test.words}"
        return [event, Event("EP", at, words, ends=True, located=True)]

    def _end(self, test: Test, point: Any) -> Event:
        """The end of a branch at a bound, or where the point at the bound was not found."""
        assert test.level is not None
        number, value = test.level
        low, high = self.bounds[number]
        near = bool(abs(point.values[number] - value) <= ENGINE.same * (high - low))
        words = test.words if near else f"{test.words}: not reached, the next orbit is beyond"
        return Event("EP", point, words, ends=True, located=near)


def _key(test: Test) -> Any:
    return test.label, test.bound, test.level


def _distance_from(number: int, value: float, sign: float = 1.0) -> Any:
    def distance(point: Any) -> float:
        there = float(point.values[number])
        # A branch that begins at a bound comes out on either side of it by a rounding of its unit.
        far = abs(there - value) > ENGINE.some_roundings * max(abs(there), abs(value))
        return sign * (there - value) * far

    return distance


def has_come_round(points: list, distance: float) -> bool:
    """Whether the last orbit is the first one, met again in the same sense.

    A point tells its `rates`, of the parameters along the branch, and its `place`, the parameters in
    parts of the bounds' distances.
    """
    first, last = points[0], points[-1]
    if len(points) < ACCURACY.least_points or last.sequence != first.sequence:
        return False
    # No curve comes round without going back: where the state moves fast, orbits of one way are as near
    # to each other in the parameter as the first and last of a round.
    if all(point.rates @ first.rates > 0 for point in points) or last.rates @ first.rates <= 0:
        return False
    period, other = float(first.orbit.period), float(last.orbit.period)
    if np.linalg.norm(last.place - first.place) >= distance or abs(other - period) >= distance * period:
        return False
    # The same point of the orbit is compared by what does not depend on where it starts.
    one, two = (np.asarray(p.anchor.extent) for p in (first, last))
    return bool(np.all(np.abs(one - two) <= distance * one))
