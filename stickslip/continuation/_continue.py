"""`continue_orbit`: a branch of periodic orbits over one parameter."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from jaxtyping import PyTree

from .._types import Given
from .._validation import check_count, check_flag, check_type, one_concrete, refusal
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid._arguments import the_system
from ._along import Problem
from ._arguments import bounds_of, concrete_guess, functions_of, problem_of, value_of
from ._branch import Branch, BranchPoint, Special, branch_of
from ._corner import across
from ._equilibrium import EquilibriumPoint
from ._follow import QUICK, Failure, Point, ahead, begin, leaps, moved, strayed, turned
from ._guess import OrbitGuess
from ._kinds import kind_of
from ._orbit import PeriodicOrbit
from ._points import border, is_torus, located
from ._switch import birth, born, crossing, doubled, outward

# Between two points the tangent turns by at most this angle [cosine]: sharper bends get shorter steps.
BEND = 0.9
SHORTER, LONGER = 0.5, 1.5
# A step changes the extent of the motion by at most this part; one that has shrunk so far is a rest.
SHRINKS = 0.3
AT_REST = 1e-4
LEAST_ROUND = 8  # orbits of a closed branch
CUT_OFF = ("max_points", "bounds")  # ends beyond which a branch goes on
# Beyond a border the next orbit is near the last one before it: within so many of what is left of the
# step, or of this part of it.
FARTHEST, APART = 10.0, 0.01
REPEATS = "repeats: a branch of a shorter period is met"
STUCK = 1e-7  # of the step: a branch that goes on by less ends


def continue_orbit(
    system: Given[AbstractHybridSystem],
    orbit: Given[PeriodicOrbit | OrbitGuess | BranchPoint | EquilibriumPoint],
    parameter: Given[str],
    bounds: Given[tuple[float, float]],
    *,
    forcing_period: Given[Callable[[Any], Any] | None] = None,
    step: Given[float] = 0.01,
    max_points: Given[int] = 200,
    functions: Given[Mapping[str, Callable[[PeriodicOrbit], Any]] | None] = None,
    both: Given[bool] = True,
    segments: Given[int] = 1,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
    max_events: Given[int] = 256,
) -> Branch:
    r"""Follow a periodic orbit over one parameter, through folds and changes of the mode sequence.

    Pseudo-arclength continuation (Keller 1977): the unknowns are the state, the period (where nothing
    forces the system) and the parameter; each point is Newton's solution in the plane across the last
    tangent. Every orbit is simulated again and has its Floquet multipliers. Special points between two
    orbits are located by root finding along the branch, each evaluation a Newton solution.

    The sequence of modes is that of the simulation, and may change along the branch: the last orbit of
    the old sequence is located, and the branch is followed beyond it with the derivatives of the new
    one. Where the new one lies on the same side, a discontinuous fold, the branch turns there.

    **Arguments**

    - `system`: its `parameter` (a name, `a__b` for `b` inside `a`) has the value of the orbit.
    - `orbit`: a successful `PeriodicOrbit` of this system, or an `OrbitGuess` near one; or a
      `BranchPoint` of another branch over the same parameter, at whose value it begins: from a `PD`
      point the branch of doubled orbits, from a `BP` point the other branch that crosses there; from an
      `EP` of `max_points` or `bounds` the branch goes on; from an `HB` point of `continue_equilibrium`
      the orbits that are born there. An orbit that repeats itself within its
      period is followed with the shorter one.
    - `bounds`: least and greatest value of the parameter.
    - `forcing_period(system)` [s]: of a system that depends on the time; the orbit's period is a
      multiple of it. None: the period is an unknown.
    - `step`: first and longest step, in parts of the bounds' distance (and of the motion's size).
    - `max_points`: orbits on each of the two halves of the branch.
    - `functions`: real functions of the orbit, by label, whose zeros are located too.
    - `both`: follow to both sides of `orbit`; otherwise to larger values of the parameter.
    - `segments`, `args`, `integrator`, `max_events`: as for `periodic_orbit`.

    **Returns** a `Branch`: the orbits in order along the branch, and the special points `LP` (fold),
    `PD` (period doubling), `NS` (torus), `BP` (branch point), `GR` (an event appears or vanishes), `SQ`
    (another change of the mode sequence), `EP` (end, with the reason).

    The loop is Python and runs outside `jit`; it compiles three programs for the first branch of a
    system and none for later ones. Of a `GR` point `words` name the sliding bifurcation.
    It is the last orbit of the sequence that the branch came with. Where this one has the events that
    vanish there, a stick of hardly any length is lost in rounding before it has none: such points are
    known to some 1e-8 of the bounds' distance, from the other side to 1e-9 or better.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation.
    """
    the_system(system)
    special, rest, known = _start_of(system, orbit, args)
    value = value_of(system, parameter)
    low, high = bounds_of("bounds", bounds)
    one_concrete("step", step, "positive")
    check_count("max_points", max_points, 1)
    check_flag("both", both)
    tests = functions_of(functions)
    if special is not None:
        value = special.value
    elif rest is not None:
        value = rest.value
    if not low <= value <= high:
        raise refusal("bounds", (low, high), f"around the value of {parameter}, {value}")
    problem = problem_of(
        system, {parameter: value}, [high - low], known, forcing_period, args=args, segments=segments,
        integrator=integrator, max_events=max_events,
    )  # fmt: skip
    if rest is not None:
        starts = [born(problem, rest)]
    elif special is not None and special.label == "PD":
        problem = dataclasses.replace(problem, multiple=2 * problem.multiple)
        starts = [doubled(problem, known, value)]  # backwards lies the point it came from
    elif special is not None and special.label == "BP":
        starts = list(crossing(problem, known, value, special.slope))
    elif special is not None and special.words in CUT_OFF:
        first = begin(problem, known, value)
        starts = [outward(problem, first, special.slope) if isinstance(first, Point) else first]
    else:
        first = begin(problem, known, value)
        if isinstance(first, Point):
            problem, first = _shortest(problem, first)
        if isinstance(first, Point):
            first = _settled(problem, first)
            first = first if first.tangent[-1] > 0 else turned(first)
        starts = [first, first if isinstance(first, Failure) else turned(first)]
    one, *others = starts
    if isinstance(one, Failure):
        one, *others = [p for p in others if isinstance(p, Point)] or [one]
    if isinstance(one, Failure):
        raise refusal("orbit", orbit, f"an orbit of this system: it is {one.result}")
    forward, marks = _half(problem, one, (low, high), step, max_points, tests)
    closed = bool(marks) and marks[-1].words.startswith("closed")
    if closed or not both or not others or isinstance(others[0], Failure):
        return branch_of(parameter, forward, marks, system, problem)
    backward, before = _half(problem, others[0], (low, high), step, max_points, tests)
    if special is None or special.label != "BP":  # both halves begin with the same orbit
        forward, marks = forward[1:], [s.at(s.index - 1) for s in marks]
    # Of two orbits the one before is the later one of the backward half.
    count = len(backward)
    specials = [s.at(max(count - s.index - 2, 0)) for s in before[::-1]]
    specials += [s.at(count + s.index) for s in marks]
    return branch_of(parameter, backward[::-1] + forward, specials, system, problem)


def _start_of(
    system: AbstractHybridSystem, orbit: Any, args: PyTree
) -> tuple[BranchPoint | None, EquilibriumPoint | None, Any]:
    """Special point, Hopf point (None where it is neither), and the orbit or guess to begin with."""
    kinds = PeriodicOrbit | OrbitGuess | BranchPoint | EquilibriumPoint
    words = "a PeriodicOrbit, an OrbitGuess, a BranchPoint or an EquilibriumPoint"
    check_type("orbit", orbit, kinds, words)
    if isinstance(orbit, EquilibriumPoint):
        if orbit.label != "HB":
            raise refusal("orbit", orbit, "a Hopf point, HB, if it is an EquilibriumPoint")
        guess = OrbitGuess(orbit.y, orbit.period, orbit.mode)
        return None, orbit, concrete_guess(system, guess, args)
    if isinstance(orbit, OrbitGuess):
        return None, None, concrete_guess(system, orbit, args)
    special = orbit if isinstance(orbit, BranchPoint) else None
    known: Any = orbit if special is None else special.orbit
    if np.shape(known.period) != () or not bool(known.successful):
        raise refusal("orbit", orbit, "one successful PeriodicOrbit")
    return special, None, known


def _shortest(problem: Problem, point: Point) -> tuple[Problem, Point | Failure]:
    """The same orbit with the shortest period that it has, and what is followed then.

    Round twice, a doubling would be taken for a branch point: multipliers are squares of its own.
    """
    turns = int(point.orbit.repeats)
    if problem.forcing_period is not None:
        turns = math.gcd(turns, problem.multiple)
        problem = dataclasses.replace(problem, multiple=problem.multiple // turns)
    if turns == 1:
        return problem, point
    orbit = point.orbit
    once = OrbitGuess(orbit.y0, orbit.period / turns, orbit.mode0, orbit.t0)
    return problem, begin(problem, once, point.value)


def _settled(problem: Problem, point: Point) -> Point:
    """The same orbit measured around itself, where that is possible."""
    new = moved(problem, point)
    return point if isinstance(new, Failure) else new


def _shrunk(point: Point) -> float:
    """Extent of the motion, in parts of the largest that it had on the branch."""
    anchor = point.anchor
    return float(np.max(np.asarray(anchor.extent) / np.asarray(anchor.size)))


def _half(problem, start: Point, bounds, step, max_points, tests) -> tuple[list, list]:
    """Orbits from `start` along its tangent, and the special points, each with the index before it."""
    low, high = bounds
    points, specials = [start], []
    distance = step
    while len(points) < max_points:
        point, index = points[-1], len(points) - 1
        if _shrunk(point) < AT_REST:
            specials.append(Special("EP", point, "at_rest: the orbit shrinks to an equilibrium", index))
            break
        found, distance = _next(problem, point, min(distance, SHRINKS * _shrunk(point)))
        if isinstance(found, Point) and found.sequence == point.sequence:
            marks = _labelled(problem, point, found, distance, tests, index)
            met = birth(problem, point, found, distance)
            if met is not None:
                specials += [mark for mark in marks if mark.label not in ("LP", "BP")]
                specials.append(Special("EP", met, REPEATS, index))
                break
            specials += marks
            new = found
        else:
            # Either the step is too long, or the sequence of modes ends before.
            last, at = border(problem, point, distance, alike(point))
            specials += _labelled(problem, point, last, at, tests, index)
            rest = max(distance - at, APART * distance)
            near = isinstance(found, Point) and not strayed(found, last.u, rest, FARTHEST)
            other = found if near else across(problem, last)
            if not near:
                distance = at if other is None else step
            if isinstance(other, Point):
                specials.append(_change(problem, last, other, index))
                new = other
            elif at > STUCK * step:
                new = last
            else:
                result = found.result if isinstance(found, Failure) else "not_converged"
                specials.append(Special("EP", last, result, index))
                break
        if not low <= new.value <= high:
            specials = [s for s in specials if low <= s.point.value <= high]
            specials.append(
                Special("EP", _at_bound(problem, point, new, distance, bounds), "bounds", index)
            )
            break
        if int(new.orbit.repeats) > int(points[0].orbit.repeats):
            specials.append(Special("EP", new, REPEATS, index))
            break
        points.append(_settled(problem, new))
        if _closed(points, distance):
            specials.append(
                Special("EP", points[-1], "closed: the branch has come round", len(points) - 1)
            )
            break
        distance = min(distance * LONGER, step) if new.evaluations <= QUICK else distance
    else:
        specials.append(Special("EP", points[-1], "max_points", len(points) - 1))
    return points, specials


def _at_bound(problem, before: Point, after: Point, distance, bounds) -> Point:
    """The orbit at the bound that lies between two others, or the last one within the bounds."""
    low, high = bounds
    bound = low if after.value < low else high
    found = located(problem, before, after, distance, lambda point: point.value - bound)
    return before if isinstance(found, Failure) else found


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
    """Whether another point has the same sequence of modes."""
    return lambda other: other.sequence == point.sequence


def _next(problem, point: Point, distance: float):
    """The next point and the step to it, shortened where the branch bends; or why there is none."""
    shortest = distance * 2.0**-10
    while True:
        new = ahead(problem, point, distance)
        if isinstance(new, Failure) or new.sequence != point.sequence:
            return new, distance
        if not leaps(point, new, distance) and new.tangent @ point.tangent > BEND:
            return new, distance
        if distance <= shortest:
            return (Failure("not_converged") if leaps(point, new, distance) else new), distance
        distance *= SHORTER


def _labelled(problem, before: Point, after: Point, distance, tests, index) -> list[Special]:
    """Special points between two orbits of one sequence, in order."""
    found = []
    for label, test in tests.items():
        one, two = test(before), test(after)
        if not (np.isfinite(one) and np.isfinite(two)) or one * two >= 0:
            continue
        point = located(problem, before, after, distance, test)
        if isinstance(point, Failure):
            continue
        if label == "NS" and not is_torus(point):
            continue
        found.append(Special(label, point, "", index))
    return sorted(found, key=lambda s: abs(s.point.value - before.value))


def _change(problem: Problem, last: Point, new: Point, index: int) -> Special:
    """The border between two sequences: an event more or less, or others."""
    events = int(last.orbit.events.count), int(new.orbit.events.count)
    kind = kind_of(problem.system, last, new)
    words = f"{kind}{', ' * bool(kind)}{events[0]} events, {events[1]} beyond"
    return Special("SQ" if events[0] == events[1] else "GR", last, words, index)
