"""`continue_point`: the curve of a special point over two parameters."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from jaxtyping import PyTree

from .._types import Given
from .._validation import check_count, check_flag, check_type, one_concrete, refusal
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid.arguments import the_system
from ._along import Problem
from ._arguments import bounds_of, functions_of, levels_of, problem_of, value_of
from ._bifurcation_curve import BifurcationCurve, Half, curve_of
from ._border import Border, touches
from ._branch import BranchPoint, Special
from ._curve import AbstractCurve, Place, Zeros, elsewhere, last_place, stepped, zero_between
from ._degenerate import degenerate, folding, passed_by
from ._follow import Failure, Point, begin, round_trip
from ._points import Level

BORDERS = ("GR", "SQ")
LONGER = 1.5
LEAST_ROUND = 8  # points of a closed curve
BESIDE = (1e-10, 1e-9, 1e-8, 1e-7, 1e-6)  # of the first parameter's bounds


def continue_point(
    system: Given[AbstractHybridSystem],
    point: Given[BranchPoint],
    parameters: Given[tuple[str, str]],
    bounds: Given[tuple[tuple[float, float], tuple[float, float]]],
    *,
    forcing_period: Given[Callable[[Any], Any] | None] = None,
    step: Given[float] = 0.02,
    max_points: Given[int] = 100,
    values: Given[tuple[tuple[float, ...], tuple[float, ...]]] = ((), ()),
    functions: Given[Mapping[str, Callable[..., Any]] | None] = None,
    both: Given[bool] = True,
    segments: Given[int] = 1,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
    max_events: Given[int] = 256,
) -> BifurcationCurve:
    r"""Follow a fold, a doubling, a torus or branch point or a border of modes over two parameters.

    The orbits of a system with two free parameters are a surface, on which the points of one kind are a
    curve. Each of its points is a solution of Newton's method for the orbit and of a search across the
    curve: for the zero of the test function, or for the last orbit of a sequence of modes. The curve
    may turn in both parameters.

    It ends, by name, where its point becomes another one: where the orbit grazes, so that its sequence
    of modes ends; where the border of one event meets that of another (`GRGR`); at a cusp (`CP`); at a
    fold that meets a doubling (`LPPD`); where the pair of a torus point becomes real (`R1`, `R2`), and
    so on. Ends are known to some 1e-8 of the bounds' distances. Of a curve of torus points the strong
    resonances `R1` to `R4` are special points; it goes on through `R3` and `R4`.

    **Arguments**

    - `system`: its second parameter has the value at which `point` was found.
    - `point`: `LP`, `PD`, `NS`, `GR` or `SQ` of a `Branch` over the first parameter, or the zero of one
      of `functions`; also `BP`, which has a curve where both parameters leave the system symmetric.
    - `parameters`: two names; `bounds`: least and greatest value of each.
    - `step`: first and longest step, in parts of the bounds' distances (and of the motion's size).
    - `values` of each parameter at which a point `UZ` is wanted.
    - `max_points`: on each of the two halves. `both`: follow to both sides; otherwise to larger values
      of the second parameter.
    - `forcing_period`, `functions`, `segments`, `args`, `integrator`, `max_events`: as for
      `continue_orbit`.

    **Returns** a `BifurcationCurve`: its points in order, and how it ends on both sides. The loop is
    Python and runs outside `jit`.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation.
    """
    the_system(system)
    check_type("point", point, BranchPoint, "a BranchPoint of a Branch")
    names = _names(system, parameters)
    limits = np.asarray(_limits(bounds))
    step = float(one_concrete("step", step, "positive"))
    check_count("max_points", max_points, 1)
    check_flag("both", both)
    tests = {**functions_of(functions), "LP": folding}
    known = [*tests, *BORDERS]
    if point.label not in known:
        raise refusal("point", point, f"one of the kinds {', '.join(known)}")
    levels = _levels(values, limits)
    there = {names[0]: point.value, names[1]: value_of(system, names[1])}
    for (name, value), (low, high) in zip(there.items(), limits, strict=True):
        if not low <= value <= high:
            raise refusal("bounds", (low, high), f"around the value of {name}, {value}")
    problem = problem_of(
        system, there, limits[:, 1] - limits[:, 0], point.orbit, forcing_period, args=args,
        segments=segments, integrator=integrator, max_events=max_events,
    )  # fmt: skip
    curve, start = _start(problem, point, np.array([*there.values()]), tests, step)
    if isinstance(start, Failure):
        raise refusal("point", point, f"one from which a curve can be followed: it is {start.result}")
    start = start if start.way[-1] >= 0 else start.turned()
    halves = [
        _half(curve, place, point.label, names, limits, step, max_points, levels)
        for place in ((start, start.turned()) if both else (start,))
    ]
    met = [Special("UZ", level.at(start.point), "", 0) for level in levels if not level(start.point)]
    halves[0].specials[:0] = met
    return curve_of(point.label, names, halves[:1] if _closed(halves[0].end) else halves, system)


def _levels(values: Any, limits: np.ndarray) -> list[Level]:
    if not isinstance(values, tuple | list) or len(values) != 2:
        raise refusal("values", values, "two tuples of numbers, one per parameter", TypeError)
    return [
        Level(value, number)
        for number, row in enumerate(values)
        for value in levels_of(f"values[{number}]", row, tuple(limits[number]))
    ]


def _names(system: AbstractHybridSystem, parameters: Any) -> tuple[str, str]:
    allowed = "two names of parameters"
    if not isinstance(parameters, tuple | list) or len(parameters) != 2:
        raise refusal("parameters", parameters, allowed, TypeError)
    one, two = parameters
    for i, name in enumerate((one, two)):
        value_of(system, name, f"parameters[{i}]")
    if one == two:
        raise refusal("parameters", parameters, allowed)
    return one, two


def _limits(bounds: Any) -> list[tuple[float, float]]:
    if not isinstance(bounds, tuple | list) or len(bounds) != 2:
        raise refusal("bounds", bounds, "two pairs of numbers, one per parameter", TypeError)
    return [bounds_of(f"bounds[{i}]", pair) for i, pair in enumerate(bounds)]


def _start(
    problem: Problem, point: BranchPoint, values: np.ndarray, tests: Mapping[str, Any], step: float
) -> tuple[AbstractCurve, Place | Failure]:
    first = begin(problem, point.orbit, values)
    if point.label not in BORDERS:
        zeros = Zeros(problem, tests[point.label])
        return zeros, first if isinstance(first, Failure) else zeros.begin(first)
    # At the border itself rounding decides which events there are: then from a little beside it.
    border = Border(problem, round_trip(point.orbit))
    for beside in (0.0, *BESIDE):
        for side in (1.0, -1.0):
            move = np.array([side * beside * problem.unit[0], 0.0])
            found = begin(problem, point.orbit, values + move)
            if isinstance(found, Point) and found.sequence == border.sequence:
                return border, border.begin(found, step)
    return border, first if isinstance(first, Failure) else Failure("mode_differs")


def _half(
    curve: AbstractCurve, start: Place, label: str, names: tuple[str, str], limits: np.ndarray,
    step: float, most: int, levels: list[Level],
) -> Half:  # fmt: skip
    """Places from `start` along its direction, the last point and why it is that, special points."""
    places, distance, specials = [start], step, []
    passes = [*passed_by(label), *(("UZ", _At(level)) for level in levels)]
    while len(places) < most:
        place = places[-1]
        new, distance = stepped(curve, place, distance, step)
        if isinstance(new, Failure):
            last = last_place(curve, place, distance)
            if last is not place:
                places.append(last)
            return Half(places, (last.point, _reason(curve, last, new)), specials)
        if isinstance(curve, Border):
            last = curve.met(place, new, distance)
            if last is not None:
                return Half([*places, last], (last.point, CORNER), specials)
        tests = degenerate(label, place)
        for i, (name, (low, high)) in enumerate(zip(names, limits, strict=True)):
            bound = low if new.point.values[i] < low else high
            tests.append((f"bounds of {name}", lambda p, i=i, b=bound: float(p.point.values[i] - b)))
        ends, met = (_zeros(curve, place, new, distance, some) for some in (tests, passes))
        last = ends[0][0] if ends else np.inf
        index = len(places) - 1
        specials += [_special(*mark, index) for far, *mark in met if far <= last]
        if ends:
            _, words, test, found = ends[0]
            if words.startswith("R"):
                specials.append(_special(words, test, found, index))
            places.append(found)
            return Half(places, (found.point, words), specials)
        places.append(elsewhere(curve.problem, new))
        if _round(places, distance):
            return Half(places, (places[-1].point, CLOSED), specials)
        distance = min(distance * LONGER, step)
    return Half(places, (places[-1].point, "max_points"), specials)


@dataclasses.dataclass(frozen=True)
class _At:
    """A value of a parameter that is asked for, as a function of a place."""

    level: Level

    def __call__(self, place: Place) -> float:
        return self.level(place.point)


def _zeros(curve: AbstractCurve, place: Place, new: Place, distance: float, tests: list) -> list:
    """Zeros of functions between two places in order: how far, name, function, place."""
    ends = []
    for words, test in tests:
        one, two = test(place), test(new)
        if one != 0.0 and one * two <= 0.0:
            found = new if two == 0.0 else zero_between(curve, place, new, distance, test)
            if not isinstance(found, Failure):
                far = float(np.linalg.norm(found.point.u - place.point.u))
                ends.append((far, words, test, found))
    return sorted(ends, key=lambda end: end[0])


def _special(words: str, test: Callable[[Place], float], place: Place, index: int) -> Special:
    label, _, rest = words.partition(": ")
    point = test.level.at(place.point) if isinstance(test, _At) else place.point
    return Special(label, point, rest, index)


CORNER = "GRGR: the border of another sequence of modes is met"
CLOSED = "closed: the curve has come round"


def _closed(end: tuple[Point, str]) -> bool:
    return end[1] == CLOSED


def _reason(curve: AbstractCurve, last: Place, failure: Failure) -> str:
    if isinstance(curve, Border) and curve.corner(last):
        return CORNER
    if failure.result == "mode_differs" or touches(curve.problem, last.point, [last.way, last.normal]):
        return "grazes: the sequence of modes ends here"
    return f"{failure.result}: the next orbit was not found"


def _round(places: list[Place], distance: float) -> bool:
    """Whether the last place is the first one, met again in the same sense."""
    first, last = places[0], places[-1]
    if len(places) < LEAST_ROUND or first.way[-2:] @ last.way[-2:] <= 0:
        return False
    # No curve comes round without going back.
    if all(first.way[-2:] @ place.way[-2:] > 0 for place in places):
        return False
    near = np.linalg.norm(last.point.u[-2:] - first.point.u[-2:]) < distance
    one, two = (np.asarray(p.point.anchor.extent) for p in (first, last))
    return bool(near and np.all(np.abs(one - two) <= distance * one))
