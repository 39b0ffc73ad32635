"""Events of motions near an orbit: whether it touches a guard, and which border lies beyond."""

import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._along import Problem, events_along
from ._point import Point


def decades(first: float, last: float) -> list[float]:
    """Powers of ten from one number to another."""
    return (10.0 ** np.arange(round(np.log10(first)), round(np.log10(last)) + 0.5)).tolist()


# How far beside an orbit that touches a guard, as well as it is known, motions have other events.
TOUCHING = decades(ENGINE.zero, ENGINE.same)


def events_of(problem: Problem, point: Point, u: np.ndarray) -> list | None:
    """Guards and modes of one period from these unknowns on."""
    log, good = jax.device_get(events_along(problem, jnp.asarray(u), point.modes, point.anchor))
    if not good:
        return None
    return list(zip(log.guard[: log.count].tolist(), log.mode_after[: log.count].tolist(), strict=True))


def touches(problem: Problem, point: Point, ways: list[np.ndarray]) -> bool:
    """Whether an orbit touches a guard: motions next to it, both ways, have other events."""
    if not problem.system.guard_names:
        return False
    # At a touch the derivative is that of one side: only motions beside it show the other.
    own = events_of(problem, point, point.u)
    sides = [sign * way for way in ways for sign in (1.0, -1.0)]
    found = (events_of(problem, point, point.u + d * way) for d in TOUCHING for way in sides)
    return any(events is not None and events != own for events in found)


def first_difference(own: list | None, other: list | None) -> tuple | None:
    """Where another list of events first differs, and the event there."""
    if own is None or other is None or own == other:
        return None
    both = zip(own, other, strict=False)
    at = next((i for i, (a, b) in enumerate(both) if a != b), min(len(own), len(other)))
    return (at, *(other[at] if at < len(other) else ()))
