"""The border between two basins: the unstable motion on it."""

import dataclasses
from collections.abc import Callable

import jax
import numpy as np
from jaxtyping import PyTree
from scipy.spatial import KDTree

from .._types import Given
from .._validation import check_in, check_type, refusal
from ..continuation import Equilibrium, PeriodicOrbit
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._attractor import Attractor, Found, motions_at
from ._basins import Basins, check_start, turns
from ._judged import Judged, codes_from
from ._lanes import Lanes, rows_of
from ._settle import Settle
from ._tube import distances


def border_motion(
    system: Given[AbstractHybridSystem],
    found: Given[Basins],
    between: Given[tuple[str, str]],
    settle: Given[Settle],
    *,
    integrator: Given[Integrator | None] = None,
    args: PyTree = None,
) -> Equilibrium | PeriodicOrbit:
    r"""The unstable motion on the border between the basins of two attractors.

    Between two starts of the map, one of each basin, the border is enclosed as narrowly as numbers
    allow. A motion from there stays beside the border for long and comes near to the motion on it, a
    saddle or an orbit, which then is solved by Newton's method.

    **Arguments**

    - `system`, `args`, `integrator`, `settle`: those of the map `found`.
    - `between`: names of two of its attractors.

    **Returns** an `Equilibrium` or a `PeriodicOrbit`; of a flow in a plane the latter *is* the border,
    and the former has it as its stable manifold (`border_shares`).

    **Errors** `ValueError`/`TypeError` naming the argument; `ValueError` where no start comes to one of
    the two, and where no unstable motion is found: the border may be a chaotic set.
    """
    check_type("found", found, Basins, "a Basins")
    check_type("settle", settle, Settle, "a Settle(duration)")
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator or None")
    names = [attractor.name for attractor in found.attractors]
    if not isinstance(between, tuple) or len(between) != 2 or between[0] == between[1]:
        raise refusal("between", between, f"a pair of two of {', '.join(names)}")
    rows = rows_of(found.starts, found.code.size)
    ends = []
    for name in between:
        ends.append(rows[np.ravel(found.code) == names.index(check_in("between", name, names))])
        if not len(ends[-1]):
            raise refusal("between", name, "an attractor that a start of `found` comes to")
    width = np.ptp(rows, axis=0)
    width = np.where(width > 0.0, width, 1.0)
    one, other = _nearest(ends[0] / width, ends[1] / width) * width
    axes = found.code.ndim
    first = jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[axes:])[0], found.starts)
    y0, _ = check_start(system, first, found.box, settle, args)
    lanes = Lanes(system, args, integrator, y0)
    turn = turns(system, y0)
    attractors = Judged(lanes, settle, rows[:1], turn, found.attractors).attractors
    names = [attractor.name for attractor in attractors]
    if not set(between) <= set(names):
        raise refusal("found", between, f"of the same system, whose attractors are {', '.join(names)}")
    first, second = (names.index(name) for name in between)
    low, high, _ = border_between(
        lanes, settle, attractors, (one, other), first, lambda code: code == second
    )
    motion = on_border(lanes, settle, one + 0.5 * (low + high) * (other - one), turn)
    if motion is None:
        allowed = "two attractors between whose basins there is an unstable fixed point or orbit"
        raise refusal("between", between, allowed, but="none was found")
    return motion


def border_between(
    lanes: Lanes, settle: Settle, attractors: list[Attractor], ends: tuple[np.ndarray, np.ndarray],
    own: int, is_other: Callable[[np.ndarray], np.ndarray],
) -> tuple[float, float, int]:  # fmt: skip
    """The way between two states where the code `own` ends, as narrowly as numbers allow: the parts
    beside the border, and the code beyond it, for which `is_other`. Motions that are not settled
    beside it are followed for up to eight times the duration."""
    one, other = ends
    low, high, after, few, longest = 0.0, 1.0, own, lanes.few, ACCURACY.few * settle.duration
    while True:
        part = np.linspace(low, high, few.block)
        code = codes_from(few, settle, attractors, one + part[:, None] * (other - one))
        # The last that comes to the first attractor before any that does not, the first to another.
        at = int(np.argmax(code != own)) - 1
        is_beyond = is_other(code[at + 1 :])
        beyond = at + 1 + int(np.argmax(is_beyond))
        enclosed, near = at >= 0 and np.any(is_beyond), beyond - at <= few.block // 2
        if enclosed and near and (part[at], part[beyond]) != (low, high):
            low, high, after = float(part[at]), float(part[beyond]), int(code[beyond])
        elif not enclosed or is_narrow(low, high) or settle.duration >= longest:
            return low, high, after
        else:
            # Beside a border that is hardly unstable motions stay for long.
            settle = dataclasses.replace(settle, duration=2.0 * settle.duration)


def is_narrow(low: float, high: float) -> bool:
    """Whether a border is enclosed to so small a part of the way between two states that shares have
    the digits they should."""
    return high - low <= ENGINE.same * ACCURACY.near


def on_border(
    lanes: Lanes, settle: Settle, y: np.ndarray, turn: np.ndarray
) -> Equilibrium | PeriodicOrbit | None:
    """The unstable motion that a motion from the border comes nearest to, while it stays beside it."""
    motion = Judged(lanes, settle, y[None], turn)
    best: tuple[float, Found | None] = (ACCURACY.near, None)
    for t in settle.times:
        motion.go_on(t)
        if not motion.open.size:
            break
        search, mode = motion.search, int(motion.mode[0])
        for found in motions_at(search, t, motion.y[0], mode):
            tube = found.attractor.tube
            assert tube is not None
            away = float(distances([tube], motion.y, motion.mode)[0, 0])
            if found.rate > 0.0 and away < best[0] and _stays(lanes, t, found):
                best = away, found
    return None if best[1] is None else best[1].attractor.motion


def _stays(lanes: Lanes, t: float, found: Found) -> bool:
    """Whether the system itself stays at a fixed point of a mode, which may be no state of it: friction
    holds where a slip would only just begin. Orbits were simulated when they were solved."""
    attractor, tube = found.attractor, found.attractor.tube
    if attractor.kind == "orbit" or tube is None:
        return True
    moved = lanes(t, t + 1.0 / found.rate, tube.start, [-1])
    return float(distances([tube], moved.y, moved.mode)[0, 0]) <= ENGINE.same


def _nearest(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The nearest two of two sets of points."""
    away, at = KDTree(other).query(one)
    i = int(np.argmin(away))
    return np.stack([one[i], other[int(np.ravel(at)[i])]])
