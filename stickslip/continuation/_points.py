"""Functions of orbits whose zeros are special points, and the border of a sequence of modes."""

from collections.abc import Callable

import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem
from ._family import Failure
from ._orbit import PeriodicOrbit
from ._point import Point, ahead, is_astray


def multipliers_of(orbit: PeriodicOrbit) -> np.ndarray:
    """Multipliers without those of shifts that change nothing, which are 1 along the whole branch."""
    found = np.asarray(orbit.multipliers)
    neutral = round(float(np.trace(np.asarray(orbit.neutral))))
    return np.delete(found, np.flatnonzero(found == 1.0)[:neutral])


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


def branching(point: Point) -> float:
    """Determinant of the derivative and the tangent: zero where two branches cross."""
    return float(np.linalg.det(np.vstack([point.jacobian, point.tangent])))


def is_torus(point: Point) -> bool:
    """Whether the pair whose product is 1 is a conjugate one."""
    found = multipliers_of(point.orbit)
    pairs = [(abs(a * b - 1.0), a) for i, a in enumerate(found) for b in found[:i]]
    return bool(pairs and abs(np.imag(min(pairs, key=lambda p: p[0])[1])) > ENGINE.zero)


def border(
    problem: Problem,
    before: Point,
    distance: float,
    alike: Callable[[Point], bool],
    way: np.ndarray | None = None,
) -> tuple[Point, float]:
    """The last point, within a distance along the branch, that is like the one before; and how far.

    Far from its start Newton's method may fail before the sequence ends, so that the search begins
    again from the last point found, until it does not get further.
    """
    last, whole, span = before, 0.0, distance
    for _ in range(ACCURACY.rounds):
        # By bisection: of a border nothing but its side is known at an orbit.
        low, high, best, other = 0.0, span, last, None
        while high - low > ACCURACY.nearer ** (4 if other is None else 5) * span:
            middle = 0.5 * (low + high)
            found = ahead(problem, last, middle, way)
            there = last.u + middle * (last.tangent if way is None else way)
            if isinstance(found, Failure) or is_astray(found, there, middle, ACCURACY.shorter):
                high, other = middle, None
            elif alike(found):
                low, best = middle, found
            else:
                high, other = middle, found
        last, whole = best, whole + low
        # The orbit goes on right behind the last one, as another kind: the method has not failed.
        goes_on = other is not None and (
            np.linalg.norm(other.u - best.u) <= ACCURACY.strays * (high - low) + ACCURACY.short
        )
        if goes_on or low <= ACCURACY.short * distance or whole >= distance:
            break
        # The rest of the way was too long, not by much.
        span = min(0.5 * span, distance - whole)
    return last, whole
