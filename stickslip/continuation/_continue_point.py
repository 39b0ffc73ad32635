"""`continue_point`: the curve of a special point over two parameters."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from jaxtyping import PyTree

from .._types import Given
from .._validation import check_type, refusal
from ..hybrid import AbstractHybridSystem
from ..hybrid.arguments import the_system
from ..progress import showing
from ._along import Problem
from ._arguments import bounds_of, follow_of, problem_of, value_of
from ._border import Border
from ._branch import Branch, BranchPoint, branch_of
from ._curves import AbstractCurve, Place, Zeros
from ._degenerate import folding
from ._family import Failure
from ._options import FOLLOW, SHOOTING, Follow, Shooting
from ._orbit import PeriodicOrbit
from ._point import Point, begin, round_trip
from ._points import branching, doubling, torus
from ._touches import TOUCHING
from ._walk import follow as follow_branch
from ._walk import join

BORDERS = ("GR", "SQ")
FUNCTIONS = {"LP": folding, "PD": doubling, "NS": torus, "BP": branching}


@showing("continue_point")
def continue_point(
    system: Given[AbstractHybridSystem],
    point: Given[BranchPoint],
    parameters: Given[tuple[str, str]],
    bounds: Given[tuple[tuple[float, float], tuple[float, float]]],
    *,
    forcing_period: Given[Callable[[Any], Any] | None] = None,
    follow: Given[Follow] = FOLLOW,
    shooting: Given[Shooting] = SHOOTING,
    args: PyTree = None,
) -> Branch:
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
    - `point`: `LP`, `PD`, `NS`, `GR` or `SQ` of a `Branch` of orbits over the first parameter, or the
      zero of one of `follow.tests`; also `BP`, which has a curve where both parameters leave the system
      symmetric.
    - `parameters`: two names; `bounds`: least and greatest value of each.
    - `follow`: a `Follow`, `values` of which are a tuple for each parameter; `step` in parts of the
      bounds' distances and of the motion's size.
    - `forcing_period`, `shooting`, `args`: as for `continue_orbit`.

    **Returns** a `Branch` over both parameters: its points in order, `ends` that say how it ends on
    both sides, and special points where it meets another curve, by the names above. The loop is Python
    and runs outside `jit`.

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation.
    """
    the_system(system)
    check_type("point", point, BranchPoint, "a BranchPoint of a Branch")
    if not isinstance(point.orbit, PeriodicOrbit):
        raise refusal("point", point, "one of a Branch of orbits")
    names = _names(system, parameters)
    limits = np.asarray(_limits(bounds))
    options = follow_of(follow, tuple(map(tuple, limits.tolist())))
    tests = {**FUNCTIONS, **{k: (lambda p, f=f: float(f(p.orbit))) for k, f in options.tests.items()}}
    known = [*tests, *BORDERS]
    if point.label not in known:
        raise refusal("point", point, f"one of the kinds {', '.join(known)}")
    there = {names[0]: point.value, names[1]: value_of(system, names[1])}
    for (name, value), (low, high) in zip(there.items(), limits, strict=True):
        if not low <= value <= high:
            raise refusal("bounds", (low, high), f"around the value of {name}, {value}")
    problem = problem_of(
        system, there, limits[:, 1] - limits[:, 0], point.orbit, forcing_period, args=args,
        shooting=shooting,
    )  # fmt: skip
    curve, start = _start(problem, point, np.array([*there.values()]), tests, options.step)
    if isinstance(start, Failure):
        raise refusal("point", point, f"one from which a curve can be followed: it is {start.result}")
    # The first half goes to larger values of the second parameter, whatever the curve's own sense is.
    start = start if start.way[-1] >= 0 else start.backward()
    box: Any = tuple(map(tuple, limits.tolist()))
    half = follow_branch(curve, start, box, options)
    if options.both and not half.events[-1].words.startswith("closed"):
        half = join(half, follow_branch(curve, start.backward(), box, options, first=False))
    return branch_of(curve, half, system, point.label)


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
        zeros = Zeros(problem, point.label, tests[point.label])
        return zeros, first if isinstance(first, Failure) else zeros.begin(first)
    # At the border itself rounding decides which events there are: then from a little beside it.
    border = Border(problem, point.label, round_trip(point.orbit))
    for beside in (0.0, *TOUCHING):
        for side in (1.0, -1.0):
            move = np.array([side * beside * problem.unit[0], 0.0])
            found = begin(problem, point.orbit, values + move)
            if isinstance(found, Point) and found.sequence == border.own:
                return border, border.begin(found, step)
    return border, first if isinstance(first, Failure) else Failure("mode_differs")
