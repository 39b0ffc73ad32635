"""Functions of orbits whose zeros are special points, and the border of a sequence of modes."""

from collections.abc import Callable
from typing import cast

import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem
from ._crossings import of_kind, partners
from ._family import Failure, least_with_sign
from ._orbit import PeriodicOrbit
from ._point import Candidate, Point, describe, is_astray, solve_ahead


def multipliers_of(orbit: PeriodicOrbit) -> np.ndarray:
    """Multipliers without those of shifts that change nothing, which are 1 along the whole branch."""
    found = np.asarray(orbit.multipliers)
    neutral = round(float(np.trace(np.asarray(orbit.neutral))))
    return np.delete(found, np.flatnonzero(found == 1.0)[:neutral])


def growing(point: Point) -> np.ndarray:
    """Multipliers outside the unit circle beyond what they are known to, the largest first."""
    found = multipliers_of(point.orbit)
    found = found[np.argsort(-np.abs(found))]
    return found[np.abs(found) > 1.0 + ENGINE.same]


def growths(point: Point, kind: str) -> np.ndarray:
    """By how much the multipliers of a kind are outside the unit circle, in order."""
    return np.sort(np.abs(of_kind(multipliers_of(point.orbit), kind)))[::-1] - 1.0


def turning(point: Point) -> float:
    """Rate of the parameter along the branch: zero at a fold."""
    return float(point.tangent[-1])


def doubling(point: Point) -> float:
    r"""$\prod(\mu_i + 1)$: zero where a multiplier is -1."""
    return float(np.real(np.prod(multipliers_of(point.orbit) + 1.0)))


def torus(point: Point) -> float:
    r"""$\prod_{i<j}(\mu_i\mu_j - 1)$: zero where a pair is on the unit circle, or inverse."""
    found = multipliers_of(point.orbit)
    product = 1.0 + 0.0j
    for i in range(found.size):
        for j in range(i):
            product *= found[i] * found[j] - 1.0
    return float(np.real(product)) if found.size > 1 else 1.0


def on_circle(point: Point) -> float:
    r"""Least $|\mu_i\mu_j - 1|$, with the sign of the product of all: zero where `torus` is, also where
    many multipliers are near the unit circle."""
    found = multipliers_of(point.orbit)
    products = (found[i] * found[j] for i, j in partners(found))
    return least_with_sign((ab - 1.0) / max(1.0, abs(ab)) for ab in products)


def branching(point: Point) -> float:
    """Determinant of the derivative and the tangent: zero where two branches cross."""
    return float(np.linalg.det(np.vstack([point.jacobian, point.tangent])))


def is_torus(point: Point) -> bool:
    """Whether the pair whose product is 1 is a conjugate one."""
    found = multipliers_of(point.orbit)
    pairs = [(abs(found[i] * found[j] - 1.0), i) for i, j in partners(found)]
    return bool(pairs and abs(found[min(pairs)[1]].imag) > ENGINE.zero)


def border(
    problem: Problem,
    before: Point,
    distance: float,
    alike: Callable[[Point], bool],
    way: np.ndarray | None = None,
) -> tuple[Point, float]:
    """The last point, within a distance along the branch, that is like the one before; and how far.

    By halving: of a border nothing but its side is known at an orbit. First of orbits whose motion has
    the same events as the last one, which is told at once; then of all that are alike, since an event
    may have passed the instant at which the period begins.
    """
    least = max(ACCURACY.short * distance, ENGINE.slack)
    found, at = _border(problem, before, distance, distance, least, None, way)
    point = describe(problem, found)
    if isinstance(point, Failure) or not alike(point):
        point, at, near = before, 0.0, distance
    else:
        near = ACCURACY.strays * least
    last, more = _border(problem, point, distance - at, near, least, alike, way)
    assert isinstance(last, Point)
    return last, at + more


def _border(
    problem: Problem, before: Point, distance: float, near: float, least: float,
    alike: Callable[[Point], bool] | None, way: np.ndarray | None,
) -> tuple[Candidate, float]:  # fmt: skip
    """The last orbit that is `alike`, or else whose motion has the same events, and how far it is.

    Where it is first looked for within less than the distance, `near`, it may be farther.
    """
    last: Candidate = before
    other: Candidate | None = None

    def beyond(step: float) -> Candidate | None:
        """An orbit a step from the last one; None where there is none."""
        # In the plane of orbits there, so that what it is off is the square of the step.
        onward = last.tangent if way is None else last.tangent.T @ (last.tangent @ way)
        found = solve_ahead(problem, last, step, onward, last if alike is None else None)
        there = last.u + step * onward
        if isinstance(found, Failure) or is_astray(found, there, step, ACCURACY.shorter):
            return None
        point = found if alike is None else describe(problem, found)
        return None if isinstance(point, Failure) else point

    # The border is within `reach` of the last orbit, as a step as long as `asked` had told.
    whole, reach, asked = 0.0, near, near if near == distance else np.inf
    while reach > least:
        # A step leads to beside where it ends, by its square, and there maybe beyond a border that lies
        # farther: the end of the reach is asked again from nearer by, and what follows if it succeeds.
        anew = reach < asked * min(1.0, ACCURACY.far * asked)
        step = reach if anew else ACCURACY.shorter * reach
        found = beyond(step)
        if found is None or (alike is not None and not alike(cast(Point, found))):
            other, reach, asked = found, step, step
        else:
            last, whole = found, whole + step
            if anew:
                other, reach, asked = None, min(2.0 * reach, distance - whole), np.inf
            else:
                reach = step
        # The orbit goes on right behind the last one, as another kind: the method has not failed.
        if (
            other is not None
            and reach <= ACCURACY.nearer**5 * distance
            and np.linalg.norm(other.u - last.u) <= ACCURACY.strays * reach + ACCURACY.short
        ):
            break
    return last, whole
