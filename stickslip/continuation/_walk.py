"""Orbits one after the other along a branch, and the special points between them."""

import dataclasses
import itertools
from collections.abc import Callable

import numpy as np

from ._along import Problem
from ._border import touches
from ._branch import Special
from ._branching import located_beside
from ._corner import across, led_back
from ._follow import QUICK, Failure, Point, ahead, leaps, moved, strayed, turned, unchecked
from ._kinds import impacts, kind_of
from ._last import endless, hopf_point
from ._points import Level, border, is_torus, located
from ._switch import birth

# Between two points the tangent turns by at most this angle [cosine]: sharper bends get shorter steps.
BEND = 0.9
SHORTER, LONGER = 0.5, 1.5
# Where Newton's method fails, steps down to the first part of it are tried; below the other angle
# [cosine] between two orbits their branch is straight.
NEARER, STRAIGHT = 2.0**-4, 0.99
# A step changes the extent of the motion by at most this part; one that has shrunk so far is a rest.
SHRINKS = 0.3
AT_REST = 1e-4
LEAST_ROUND = 8  # orbits of a closed branch
# Beyond a border the next orbit is near the last one before it: within so many of what is left of the
# step, or of this part of it.
NEAR, APART = 2.0, 0.01
# Orbits that lead from a border to a distant one are all kept where they are so many steps apart.
SPARSE = 0.25
REACH = 1e-3  # at least so far the last orbit of the other side is looked for
REPEATS = "repeats: a branch of a shorter period is met"
SAME = 1e-3  # of the step: a fold so near to a branch point is that point
AT_BOUND = 1e-6  # of the bounds' distance: an end no farther from a bound is at it
ROUNDS = 12  # in which the orbit at a bound is approached
STUCK = 1e-7  # of the step: a branch that goes on by less ends


def settled(problem: Problem, point: Point) -> Point:
    """The same orbit measured around itself, where that is possible."""
    new = moved(problem, point)
    return point if isinstance(new, Failure) else new


def _shrunk(point: Point) -> float:
    """Extent of the motion, in parts of the largest that it had on the branch."""
    anchor = point.anchor
    return float(np.max(np.asarray(anchor.extent) / np.asarray(anchor.largest)))


def walked(problem, start: Point, bounds, step, max_points, tests) -> tuple[list, list]:
    """Orbits from `start` along its tangent, and the special points, each with the index before it."""
    low, high = bounds
    points, specials = [start], []
    distance = step
    while len(points) < max_points:
        point, index = points[-1], len(points) - 1
        if _shrunk(point) < AT_REST:
            hopf = hopf_point(problem, point)
            specials += [] if hopf is None else [Special("HB", hopf, "", index)]
            specials.append(Special("EP", point, "at_rest: the orbit shrinks to an equilibrium", index))
            break
        found, distance = _next(problem, point, min(distance, SHRINKS * _shrunk(point)))
        if isinstance(found, Point) and found.sequence == point.sequence:
            marks = _labelled(problem, point, found, distance, tests, index)
            met = birth(problem, point, found, distance)
            if met is not None:
                specials += [mark for mark in marks if mark.label[:2] not in ("LP", "BP")]
                specials.append(Special("EP", met, REPEATS, index))
                break
            specials += marks
            new = found
        else:
            # Either the step is too long, or the sequence of modes ends before.
            last, at = border(problem, point, distance, alike(point))
            specials += _labelled(problem, point, last, at, tests, index)
            way, near = (
                (None, False)
                if at >= distance
                else _beyond(problem, last, found, distance - at, APART * distance)
            )
            if way is not None and low <= last.value <= high:
                distance = distance if near else step
                # Between an orbit that no branch leads back from and this border there may be others.
                edge = last if way[0] is found else _edge(problem, last, way[0])
                specials += _leapt(last, way[0], tests, index)
                specials.append(_change(problem, last, way[0], edge, index))
                if _repeat(way[-1], start):
                    specials.append(Special("EP", last, REPEATS, index))
                    break
                end, begins = None, [] if edge.sequence == last.sequence else [edge]
                for before, after in itertools.pairwise([*begins, *way]):
                    specials += _between(problem, before, after, tests, len(points) - 1)
                    if not low <= after.value <= high:
                        end = _bound_between(problem, before, after, bounds)
                        break
                    if np.linalg.norm(after.u - before.u) > SPARSE * step and after is not way[-1]:
                        points.append(settled(problem, after))
                if end is not None or not low <= way[0].value <= high:
                    specials = _within(specials, bounds)
                    specials.append(_end(end or last, problem, bounds, len(points) - 1))
                    break
                new = way[-1]
            elif way is not None or at >= distance or at > STUCK * step:
                # No border here: Newton's method had gone elsewhere. Or the bound is before the border.
                new, distance = last, at
            else:
                result = found.result if isinstance(found, Failure) else "not_converged"
                result = "grazes" if touches(problem, last, [last.tangent]) else result
                specials.append(Special("EP", last, _endless(problem, points)[0] or result, index))
                break
        if not low <= new.value <= high:
            specials = _within(specials, bounds)
            end = _at_bound(problem, point, new, distance, bounds)
            specials.append(_end(end, problem, bounds, index))
            break
        if _repeat(new, start):
            specials.append(Special("EP", new, REPEATS, index))
            break
        points.append(settled(problem, new))
        if _closed(points, distance):
            specials.append(
                Special("EP", points[-1], "closed: the branch has come round", len(points) - 1)
            )
            break
        words, over = _endless(problem, points)
        if over:
            specials.append(Special("EP", points[-1], words, len(points) - 1))
            break
        distance = min(distance * LONGER, step) if new.evaluations <= QUICK else distance
    else:
        words = _endless(problem, points)[0] or "max_points"
        specials.append(Special("EP", points[-1], words, len(points) - 1))
    return points, specials


def _endless(problem: Problem, points: list[Point]) -> tuple[str, bool]:
    """Words where the period grows without bound, and whether nothing is left of the branch."""
    if problem.forcing_period is not None:
        return "", False
    return endless(points, float(np.asarray(problem.unit)[0]))


def _within(specials: list[Special], bounds) -> list[Special]:
    """Those that are not beyond a bound."""
    low, high = bounds
    return [s for s in specials if low <= s.point.value <= high]


def _beyond(
    problem: Problem, last: Point, found: Point | Failure, rest: float, least: float
) -> tuple[list[Point] | None, bool]:
    """Orbits beyond a border, outwards, None if there are none; and whether they lead to the orbit that
    was found there. Between that one and the border there may be others."""
    if not isinstance(found, Point) or strayed(found, last.u, max(rest, least), NEAR):
        return across(problem, last, found), False
    way = led_back(problem, last, found)
    if way is not None:
        return way, True
    way = across(problem, last, Failure("not_converged"))
    return ([found], True) if way is None else (way, False)


def _edge(problem: Problem, last: Point, new: Point) -> Point:
    """The orbit at a border that is known best: of both sides, that with fewer impacts.

    With the speed of an impact that vanishes the parameter changes as its square, so that the orbits
    with it end, to rounding, far from the border. `new`: on the branch that leads away from it.
    """
    if impacts(new) >= impacts(last):
        return last
    back = new if (last.u - new.u) @ new.tangent > 0 else turned(new)
    reach = 2.0 * float(np.linalg.norm(last.u - new.u)) + REACH
    edge, at = border(problem, back, reach, alike(new))
    return turned(edge) if at < reach else last


def _bound_between(problem, before: Point, after: Point, bounds) -> Point:
    """The orbit at the bound between two others, of which the later one is found from the earlier."""
    low, high = bounds
    bound = low if after.value < low else high
    distance = float((before.u - after.u) @ -after.tangent)
    found = located(problem, turned(after), turned(before), distance, lambda p: p.value - bound)
    return before if isinstance(found, Failure) else turned(found)


def _repeat(point: Point, start: Point) -> bool:
    """Whether an orbit goes more often round itself than the first one of its branch."""
    return int(point.orbit.repeats) > int(start.orbit.repeats)


def _at_bound(problem, before: Point, after: Point, distance, bounds) -> Point:
    """The orbit at the bound that lies between two others, or the last one found within the bounds.

    Where Newton's method does not get there from the first one, from another one nearer to it.
    """
    low, high = bounds
    bound = low if after.value < low else high
    for _ in range(ROUNDS):
        found = located(problem, before, after, distance, lambda point: point.value - bound)
        if isinstance(found, Point):
            return found
        nearer = _nearest(problem, before, distance)
        if nearer is None:
            break
        step, point = nearer
        if low <= point.value <= high:
            before, distance = point, float((after.u - point.u) @ point.tangent)
        else:
            after, distance = point, step
    return before


def _nearest(problem: Problem, before: Point, distance: float) -> tuple[float, Point] | None:
    """The first orbit of the branch that is found with ever shorter steps, and its step."""
    for step in (distance * SHORTER**k for k in range(1, ROUNDS)):
        point = ahead(problem, before, step)
        if isinstance(point, Failure) or point.sequence != before.sequence:
            continue
        if not leaps(before, point, step):
            return step, point
    return None


def _end(point: Point, problem: Problem, bounds, index: int) -> Special:
    """The end of a branch at a bound, or where the orbit at the bound was not found."""
    away = min(abs(point.value - bound) for bound in bounds)
    words = (
        "bounds"
        if away <= AT_BOUND * float(problem.unit[0])
        else "bounds: not reached, the next orbit is beyond"
    )
    return Special("EP", point, words, index)


def _closed(points: list[Point], distance: float) -> bool:
    """Whether the last orbit is the first one, met again in the same sense."""
    first, last = points[0], points[-1]
    if len(points) < LEAST_ROUND or last.sequence != first.sequence:
        return False
    # No curve comes round without going back: where the state moves fast, orbits of one way are as near
    # to each other in the parameter as the first and last of a round.
    if all(point.tangent[-1] * first.tangent[-1] > 0 for point in points):
        return False
    period, other = float(first.orbit.period), float(last.orbit.period)
    near = abs(last.u[-1] - first.u[-1]) < distance and abs(other - period) < distance * period
    if not near or last.tangent[-1] * first.tangent[-1] <= 0:
        return False
    # The same point of the orbit is compared by what does not depend on where it starts.
    one, two = (np.asarray(p.anchor.extent) for p in (first, last))
    return bool(np.all(np.abs(one - two) <= distance * one))


def alike(point: Point) -> Callable[[Point], bool]:
    """Whether another point has the same sequence of modes, as often round."""
    turns = int(point.orbit.repeats)
    return lambda other: other.sequence == point.sequence and int(other.orbit.repeats) == turns


def _next(problem, point: Point, distance: float):
    """The next point and the step to it, shortened where the branch bends; or why there is none.

    An orbit of another sequence may be far away, and of another branch. Newton's method fails beyond
    the last orbit of a sequence, and from afar where the branch bends soon. A little nearer it still
    needs many evaluations at a bend, but few before a border, which no ever shorter steps approach.
    """
    shortest = distance * 2.0**-10
    failed = None
    while True:
        new = unchecked(problem, point, distance * point.tangent)
        if isinstance(new, Failure):
            failed = failed or (new, distance)
            if distance <= failed[1] * NEARER:
                return failed
        elif new.sequence != point.sequence:
            return failed or (new, distance)
        else:
            turn = new.tangent @ point.tangent
            if not leaps(point, new, distance) and turn > BEND:
                if failed and new.evaluations <= QUICK and turn > STRAIGHT:
                    return failed
                return new, distance
            if distance <= shortest:
                return (Failure("not_converged") if leaps(point, new, distance) else new), distance
        distance *= SHORTER


def _labelled(problem, before: Point, after: Point, distance, tests, index) -> list[Special]:
    """Special points between two orbits of one sequence, in order."""
    found = []
    for label, test in tests:
        one, two = test(before), test(after)
        # A zero at an end is that of the step that ends there.
        if not (np.isfinite(one) and np.isfinite(two)) or one == 0.0 or one * two > 0.0:
            continue
        at = after if two == 0.0 else _found(problem, before, after, distance, label, test)
        if isinstance(at, Failure):
            words = f"not located: between here and {after.value:.10g}, {at.result}"
            found.append(Special(f"{label}?", before, words, index))
        elif isinstance(test, Level):
            found.append(Special(label, test.at(at), "", index))
        elif label != "NS" or is_torus(at):
            found.append(Special(label, at, "", index))
    crossings = [s.point.u for s in found if s.label == "BP"]
    # Where the parameter turns at the point where branches cross there is no fold.
    folds = [s for s in found if s.label == "LP"]
    for fold in folds:
        if any(np.linalg.norm(fold.point.u - u) < SAME * distance for u in crossings):
            found.remove(fold)
    return sorted(found, key=lambda s: abs(s.point.value - before.value))


def _leapt(last: Point, new: Point, tests, index) -> list[Special]:
    """Values asked for that lie between the orbits next to a border of the mode sequence."""
    found = []
    for label, test in tests:
        if isinstance(test, Level) and test(last) * test(new) < 0.0:
            near = min((last, new), key=lambda point: abs(test(point)))
            words = f"not located: at a change of the mode sequence, between here and {new.value:.10g}"
            found.append(Special(f"{label}?", near, words, index))
    return found


def _found(problem, before: Point, after: Point, distance, label: str, test) -> Point | Failure:
    """The zero of a test; beside the point where branches cross Newton's method does not get to it."""
    if label == "BP":
        beside = located_beside(problem, before, after, test)
        return beside if isinstance(beside, Failure) else beside[0]
    at = located(problem, before, after, distance, test)
    if isinstance(at, Failure) and label == "LP":
        beside = located_beside(problem, before, after, test)
        return at if isinstance(beside, Failure) else beside[0]
    return at


def _between(problem, before: Point, after: Point, tests, index) -> list[Special]:
    """Special points between two orbits that were found one from the other, the later one first."""
    distance = float((before.u - after.u) @ -after.tangent)
    marks = _labelled(problem, turned(after), turned(before), distance, tests, index)
    return [dataclasses.replace(mark, point=turned(mark.point)) for mark in reversed(marks)]


def _change(problem: Problem, last: Point, new: Point, edge: Point, index: int) -> Special:
    """The border between two sequences, at one of its orbits: an event more or less, or others."""
    events = int(last.orbit.events.count), int(new.orbit.events.count)
    kind = kind_of(problem.system, last, new)
    words = f"{kind}{', ' * bool(kind)}{events[0]} events, {events[1]} beyond"
    same = events[0] == events[1] and impacts(last) == impacts(new)
    return Special("SQ" if same else "GR", edge, words, index)
