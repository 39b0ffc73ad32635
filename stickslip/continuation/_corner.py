"""Beyond the last orbit of a mode sequence: the branch of the other sequence that meets it there."""

import jax
import jax.numpy as jnp
import numpy as np

from ._along import Problem, evaluated
from ._follow import Failure, Point, correct, strayed, tangent_of, turned

# How far from the border the motion is looked at for its other sequence, in parts of the motion's size.
BESIDE = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
# How far the first orbit beyond is from the border.
BEYOND = (1e-4, 1e-3, 1e-2, 1e-5)
NEAR = 1.0  # moves, that it is from where it was expected


def across(problem: Problem, last: Point) -> Point | None:
    """The first orbit of another sequence beyond the last one of this; None if there is none nearby.

    The return map is smooth in pieces. On the other side of the border between two pieces its
    derivative is another one, found from a state a little beside the orbit whose motion has the other
    sequence; the tangent of the branch there follows from it.
    """
    if not problem.system.guard_names:
        return None
    _, _, found = jax.device_get(evaluated(problem, jnp.asarray(last.u), last.modes, last.anchor))
    own = found.sequence.tolist()
    seen: list[np.ndarray] = []
    for beside in BESIDE:
        for direction in _directions(last):
            u = last.u + beside * direction
            _, jacobian, other = jax.device_get(
                evaluated(problem, jnp.asarray(u), last.modes, last.anchor)
            )
            if not np.all(other.good) or other.sequence.tolist() == own:
                continue
            tangent = tangent_of(jacobian, None)
            if tangent is None or any(abs(tangent @ t) > 1.0 - 1e-6 for t in seen):
                continue
            seen.append(tangent)
            for beyond in BEYOND:
                for way in (tangent, -tangent):
                    new = _beyond(problem, last, beyond * way, way)
                    if new is not None:
                        return new
    return None


def _beyond(problem: Problem, last: Point, move: np.ndarray, tangent: np.ndarray) -> Point | None:
    new = correct(problem, last.u + move, last.modes, last.anchor, tangent, tangent)
    if isinstance(new, Failure) or new.sequence == last.sequence:
        return None
    # Another orbit, from far away, is none of this branch: it stays away however short the move.
    if strayed(new, last.u + move, float(np.linalg.norm(move)), NEAR):
        return None
    away = new.u - last.u
    return new if away @ new.tangent >= 0 else turned(new)


def _directions(last: Point) -> list[np.ndarray]:
    """Along the branch, then along each unknown, both ways."""
    size = last.u.size
    axes = [last.tangent, *np.eye(size)]
    return [sign * axis for axis in axes for sign in (1.0, -1.0)]
