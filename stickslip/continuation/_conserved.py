"""Quantities that a forced motion conserves beyond a border: they are those at the border."""

import numpy as np

from ._accuracy import ACCURACY
from ._along import Problem
from ._family import Failure
from ._point import Point, correct


def with_quantities_of(problem: Problem, last: Point, found: Point | Failure) -> Point | Failure:
    """An orbit found beyond the last one of a sequence, with what it conserves as the last one has it.

    Where a slider sticks all the time its place is free within limits, and Newton's method ends at any
    of them. It was left where it is at the border. An orbit that cannot be there stays as it is.
    """
    if isinstance(found, Failure) or problem.forcing_period is None or np.any(found.closing.neutral):
        return found
    count = np.asarray(found.anchor.size).size
    assert found.closing.pieces is not None
    monodromy = np.eye(count)
    for piece in found.closing.pieces:
        monodromy = piece @ monodromy
    left, strength, _ = np.linalg.svd(monodromy - np.eye(count))
    silent = left[:, strength <= ACCURACY.rounding * strength[0]].T
    change = silent @ (last.u - found.u)[:count]
    if not np.any(np.abs(change) > ACCURACY.short):
        return found
    u, along = found.u.copy(), found.tangent
    u[:count] += silent.T @ change
    new = correct(problem, u, found.modes, found.anchor, along, along, found)
    alike = isinstance(new, Point) and new.sequence == found.sequence
    return new if alike else found
