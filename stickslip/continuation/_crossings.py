"""How many eigenvalues leave the stable side between two points of a branch, and of which kind.

A test function is a product over eigenvalues: its sign sees an odd number of them only. So steps are
taken short enough that of one kind no two pass, as of two machines that are nearly alike; where they
pass at once, as the symmetry of a ring of blades makes them, counting says so.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._family import AbstractFamily, Event, Failure, Leg, next_point, zero_between

# Kinds of eigenvalues: real ones, on the right or on the left, and pairs, which are counted once.
RIGHT, LEFT, PAIR = "right", "left", "pair"


def of_kind(found: np.ndarray, kind: str) -> np.ndarray:
    """Eigenvalues of one kind; of a pair the one above the real axis."""
    real = np.abs(np.imag(found)) <= ENGINE.same * np.abs(found)
    if kind == PAIR:
        return found[~real & (np.imag(found) > 0.0)]
    return found[real & ((np.real(found) > 0.0) == (kind == RIGHT))]


def partners(found: np.ndarray) -> list[tuple[int, int]]:
    """Numbers of every two eigenvalues that are conjugates or both real.

    Sum and product of two others are not real, and have a conjugate, so that they have no say in the
    sign of a product over all: but they vanish where one pair grows as fast as another one decays.
    """
    real = np.imag(found) == 0.0
    together = (found[:, None] == found.conj()) | (real[:, None] & real)
    return [(int(i), int(j)) for i, j in np.argwhere(np.tril(together, -1))]


def passing(one: np.ndarray, other: np.ndarray) -> Counter[str]:
    """Kinds of the eigenvalues that grow at one of two points only, by those that grow at each.

    They are given with the fastest first: those that one point has more are its slowest.
    """
    few, many = sorted((one, other), key=len)
    return Counter({kind: of_kind(many[few.size :], kind).size for kind in (RIGHT, LEFT, PAIR)})


def is_exchange(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether of the directions that grow at one point not all grow at the one that has more of them.

    They are the columns of two matrices, and change smoothly where no eigenvalue passes: one that has
    come in while another has gone leaves their number, and the sign of every product.
    """
    few, many = (np.linalg.qr(a)[0] for a in sorted((one, other), key=lambda a: a.shape[1]))
    away = few - many @ (many.T @ few)
    # The sine of the largest angle between a direction and those of the other point.
    return bool(few.size and np.linalg.norm(away, 2) > ACCURACY.bend)


def next_point_with_few(
    family: AbstractFamily, growing: Callable[[Any], np.ndarray], point: Any, distance: float,
    longest: float, exchanges: Callable[[Any, Any], bool] = lambda one, other: False,
) -> tuple[Any, float]:  # fmt: skip
    """The next point and the step to it, so short that of each kind one eigenvalue passes, not more.

    `exchanges`: whether between two points some pass to one side and as many to the other.
    """
    new, distance = next_point(family, point, distance)
    while distance > ACCURACY.shortest * longest:
        if isinstance(new, Failure) or family.differs(point, new):
            break
        many = max(passing(growing(point), growing(new)).values()) > 1
        if not many and not exchanges(point, new):
            break
        new, distance = next_point(family, point, ACCURACY.shorter * distance)
    return new, distance


def several_at_once(
    family: AbstractFamily, growing: Callable[[Any], np.ndarray], leg: Leg, found: list[Event],
    kind: str, labels: tuple[str, ...], size: Callable[[Any, str], np.ndarray],
) -> list[Event]:  # fmt: skip
    """The events of a leg with the point at which several eigenvalues of a kind pass, if they do, or a
    pair beside others that stay on the border as without damping, and hide it.

    `labels`: of such a point, and of others that may be found there in its place. `size(point, kind)`:
    of all eigenvalues of the kind, the largest first; positive where they grow.
    """
    before, after = growing(leg.before), growing(leg.after)
    count = passing(before, after)[kind]
    first, last = sorted(of_kind(ends, kind).size for ends in (before, after))
    hidden = kind == PAIR and count == 1 and last == first + 1
    if not (count > 1 or hidden) or any(event.label in labels for event in found):
        return found

    def value(point: Any) -> float:
        sizes = size(point, kind)
        # One that is not there yet may begin at zero, as without damping: no jump.
        return float(sizes[first]) if sizes.size > first else -ENGINE.slack

    found = [event for event in found if event.label != f"{labels[0]}?"]
    words = "a pair beside others" if hidden else "several eigenvalues at once"
    begin, end = leg.before, leg.after
    if leg.backward:  # the later point was found first
        begin, end = end.backward(), begin.backward()
    known = _before_zero(family, begin, leg.distance, value)
    bracket = min(known, default=0.0), leg.distance
    at = zero_between(family.onward, begin, end, leg.distance, value, bracket, known)
    if not isinstance(at, Failure):
        return [*found, Event(labels[0], at.backward() if leg.backward else at, words)]
    words = f"{words}, not located: between here and {leg.after.values[0]:.10g}, {at.result}"
    return [*found, Event(f"{labels[0]}?", leg.before, words)]


def _before_zero(
    family: AbstractFamily, point: Any, distance: float, value: Callable[[Any], float]
) -> dict[float, Any]:
    """A point back along the branch where a function is not positive yet, by its distance.

    None is needed where that holds at the point itself. An eigenvalue that grows by less than it is
    known to is not counted, so that its zero may lie before the step in which the count changes.
    """
    found: dict[float, Any] = {}
    for back in -distance * 2.0 ** np.arange(ACCURACY.rounds):
        if value(found.get(min(found, default=0.0), point)) <= 0.0:
            break
        new = family.onward(point, float(back))
        if isinstance(new, Failure):
            break
        found = {float(back): new}
    return found
