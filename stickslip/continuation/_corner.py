"""Beyond the last orbit of a mode sequence: the branch of the other sequence that meets it there."""

import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem, equations_at
from ._family import Failure
from ._point import Point, ahead, correct, leaps, tangent_of
from ._touches import decades


def across(problem: Problem, last: Point, seen: Point | Failure) -> list[Point] | None:
    """Orbits of another sequence from the last one of this on, outwards; None if there are none nearby.

    `seen`: an orbit of another sequence that was found beyond. Otherwise: the return map is smooth in
    pieces. On the other side of the border between two pieces its derivative is another one, found from
    a state a little beside the orbit whose motion has the other sequence; the tangent of the branch
    there follows from it.
    """
    if not problem.system.guard_names:
        return None
    if isinstance(seen, Point):
        way = led_back(problem, last, seen)
        if way is not None:
            return way
    _, _, found = jax.device_get(equations_at(problem, jnp.asarray(last.u), last.modes, last.anchor))
    own = found.sequence.tolist()
    tangents: list[np.ndarray] = []
    # Beside the orbit, not on it: there rounding decides which of the two pieces is met.
    for beside in decades(ENGINE.same, ACCURACY.near):
        for direction in _directions(last):
            u = last.u + beside * direction
            _, jacobian, other = jax.device_get(
                equations_at(problem, jnp.asarray(u), last.modes, last.anchor)
            )
            if not np.all(other.good) or other.sequence.tolist() == own:
                continue
            tangent = tangent_of(jacobian, None)
            # A piece that was seen from another side already has the same tangent.
            if tangent is None or any(abs(tangent @ t) > 1.0 - ENGINE.same for t in tangents):
                continue
            tangents.append(tangent)
            # So far from the border, in parts of the motion's size, the first orbit behind it may lie.
            for beyond in (*decades(ACCURACY.little, ACCURACY.near), 0.1 * ACCURACY.little):
                for side in (1.0, -1.0):
                    way = _beyond(problem, last, side * beyond * tangent, side * tangent)
                    if way is not None:
                        return way
    return None


def _beyond(problem: Problem, last: Point, move: np.ndarray, tangent: np.ndarray) -> list[Point] | None:
    new = correct(problem, last.u + move, last.modes, last.anchor, tangent, tangent)
    if isinstance(new, Failure) or new.sequence == last.sequence:
        return None
    if np.linalg.norm(new.u - last.u) > ACCURACY.far * np.linalg.norm(move):
        return None
    return led_back(problem, last, new)


def led_back(problem: Problem, last: Point, new: Point) -> list[Point] | None:
    """Orbits of the branch of another sequence from the border on to one of them, outwards.

    The branch is followed back to the border. None if it does not lead there: then it is another one
    that passes by; or if it leads back along the branch that ends there.
    """
    way = [new if (last.u - new.u) @ new.tangent > 0 else new.backward()]
    whole = float(np.linalg.norm(last.u - new.u))
    left = whole
    while left > ACCURACY.little and len(way) < ACCURACY.samples:
        point = _nearer(problem, last, way[-1], left)
        if point is None:
            break
        way.append(point)
        left = float(np.linalg.norm(last.u - point.u))
    if left > max(ACCURACY.little, ACCURACY.shrinks * whole):
        return None
    outwards = [point.backward() for point in reversed(way)]
    # The branch itself, back again, with events that only rounding makes of it.
    return None if outwards[0].tangent @ last.tangent < ENGINE.same - 1.0 else outwards


def _nearer(problem: Problem, last: Point, point: Point, left: float) -> Point | None:
    """The next orbit of a branch that leads back to a border; None where it does not."""
    for k in range(1, ACCURACY.few + 1):
        # Half of the way at most: the border, where Newton's method has no orbit, is not to be met.
        step = left * ACCURACY.shorter**k
        new = ahead(problem, point, step)
        if isinstance(new, Failure) or new.sequence != point.sequence or leaps(point, new, step):
            continue
        if np.linalg.norm(last.u - new.u) < left:
            return new
    return None


def _directions(last: Point) -> list[np.ndarray]:
    """Along the branch, then along each unknown, both ways."""
    size = last.u.size
    axes = [last.tangent, *np.eye(size)]
    return [sign * axis for axis in axes for sign in (1.0, -1.0)]
