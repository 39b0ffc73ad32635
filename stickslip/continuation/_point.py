"""Pseudo-arclength continuation: tangent, corrector, step; plain Python around compiled pieces."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid import SaveAt, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Anchor, Problem, anchor_at, equations_at, orbit_at, system_at
from ._closing import Closure
from ._family import Failure
from ._guess import OrbitGuess, gained_by
from ._newton import newton
from ._orbit import PeriodicOrbit


@dataclasses.dataclass(frozen=True)
class Candidate:
    """An orbit as Newton's method found it, with what the next step starts from.

    `values`, `[parameter]`. `tangent`: of the branch, `[unknown]`; with two parameters an orthonormal
    basis of the plane of orbits, `[2, unknown]`.
    """

    u: np.ndarray
    modes: Any
    anchor: Anchor
    tangent: np.ndarray
    jacobian: np.ndarray
    closing: Closure
    evaluations: int
    values: np.ndarray

    def begins_like(self, other: "Candidate") -> bool:
        """Whether both have the same events from one instant on; False may say nothing."""
        return self.anchor is other.anchor and same_events(self.closing, other.closing)


@dataclasses.dataclass(frozen=True)
class Point(Candidate):
    """An orbit on the branch: it was simulated once more, from wherever its period begins."""

    orbit: PeriodicOrbit

    @property
    def value(self) -> float:
        """Value of the one parameter."""
        return float(self.values[0])

    @property
    def sequence(self) -> tuple:
        """Guards and modes of one period, from wherever it begins."""
        return round_trip(self.orbit)

    @property
    def rates(self) -> np.ndarray:
        """Rate of the parameter along the branch."""
        return self.tangent[-1:]

    @property
    def place(self) -> np.ndarray:
        """The parameters in parts of the bounds' distances."""
        return self.u[-self.values.size :]

    def backward(self) -> "Point":
        """The same orbit, with the branch followed the other way."""
        return dataclasses.replace(self, tangent=-self.tangent)


def round_trip(orbit: PeriodicOrbit) -> tuple:
    """The sequence of (guard, mode after) along the orbit, turned to its smallest form."""
    count = int(orbit.events.count)
    pairs = list(
        zip(
            np.asarray(orbit.events.guard)[:count].tolist(),
            np.asarray(orbit.events.mode_after)[:count].tolist(),
            strict=True,
        )
    )
    if not pairs:
        return (int(orbit.mode0),)
    return tuple(min(pairs[i:] + pairs[:i] for i in range(count)))


def tangent_of(jacobian: np.ndarray, before: np.ndarray | None) -> np.ndarray | None:
    """Unit vector that the Jacobian takes to zero, in the sense of the one before.

    Where it takes a plane to zero, the basis of it that is nearest to the one before.
    """
    if not np.all(np.isfinite(jacobian)):
        return None
    rows, unknowns = jacobian.shape
    kernel = np.linalg.svd(jacobian)[2][rows:]
    if unknowns - rows > 1:
        if before is None:
            return kernel
        left, _, right = np.linalg.svd(before @ kernel.T)
        return left @ right @ kernel
    tangent = kernel[0]
    sense = tangent[-1] if before is None else float(tangent @ before)
    return tangent if sense >= 0 else -tangent


def begin(problem: Problem, orbit: PeriodicOrbit | OrbitGuess, value: Any) -> Point | Failure:
    """The first point of a branch: an orbit that is corrected at its own parameters."""
    value = np.atleast_1d(value)
    phase = jnp.asarray(float(orbit.t0) / float(orbit.period) % 1.0)
    anchor, u, modes = anchor_at(
        problem,
        jnp.asarray(value, jnp.float64),
        orbit.y0,
        orbit.mode0,
        phase,
        jnp.asarray(float(orbit.period)),
        gained=gained_by(problem.system, orbit),
    )
    along = np.zeros((value.size, u.shape[0]))
    along[:, -value.size :] = np.eye(value.size)
    return correct(problem, np.asarray(u), modes, anchor, along, None)


def correct(
    problem: Problem, u: np.ndarray, modes: Any, anchor: Anchor, along: np.ndarray,
    sense: np.ndarray | None, tolerance: float = ENGINE.solved,
) -> Point | Failure:  # fmt: skip
    """Newton's method in the plane through `u` perpendicular to `along`, or to each of its rows; the
    orbit is simulated again."""
    found = solve(problem, u, modes, anchor, along, sense, tolerance)
    return found if isinstance(found, Failure) else describe(problem, found)


def same_events(one: Closure, other: Closure) -> bool:
    """Whether the motions of two closures have the same events."""
    return np.array_equal(one.sequence, other.sequence) and np.array_equal(
        one.num_events, other.num_events
    )


def solve(
    problem: Problem, u: np.ndarray, modes: Any, anchor: Anchor, along: np.ndarray,
    sense: np.ndarray | None, tolerance: float = ENGINE.solved, like: Candidate | None = None,
) -> Candidate | Failure:  # fmt: skip
    """Newton's method alone; through motions only whose events are `like` those of another."""
    start = u

    def step(last, number):
        u, modes, best = last[-3:]
        residual, jacobian, found = jax.device_get(equations_at(problem, jnp.asarray(u), modes, anchor))
        if not np.all(found.good) or not np.all(np.isfinite(residual)):
            return Failure("guess_failed"), np.nan
        if like is not None and not same_events(found, like.closing):
            return Failure("mode_differs"), np.nan
        norm = float(np.max(np.abs(residual)))
        if norm > ACCURACY.far * best:
            return Failure("not_converged"), np.nan
        rows, right = np.vstack([jacobian, along]), np.append(residual, along @ (u - start))
        try:
            du = np.linalg.lstsq(rows, right, rcond=ENGINE.slack)[0]
        except np.linalg.LinAlgError:
            return Failure("singular"), np.nan
        if not np.all(np.isfinite(du)):
            return Failure("singular"), np.nan
        onward = u - du * min(1.0, 5.0 / max(np.max(np.abs(du)), 5.0))
        return (u, modes, jacobian, found, onward, np.roll(found.modes, 1), min(best, norm)), norm

    end = newton(
        step, (u, modes, np.inf), enough=tolerance, nearly=ACCURACY.stalled * tolerance,
        most=ACCURACY.rounds,
    )  # fmt: skip
    if isinstance(end.carried, Failure):
        return end.carried
    if not end.solved:
        return Failure("not_converged")
    u, modes, jacobian, found, *_ = end.carried
    tangent = tangent_of(jacobian, sense)
    if tangent is None:
        return Failure("singular")
    values = u[-len(problem.names) :] * np.asarray(problem.unit)
    return Candidate(u, modes, anchor, tangent, jacobian, found, int(end.steps), values)


def describe(problem: Problem, found: Candidate) -> Point | Failure:
    """The orbit that was found, simulated once more; a failure where it does not close."""
    if isinstance(found, Point):
        return found
    orbit = orbit_at(
        problem, jnp.asarray(found.u), jnp.asarray(found.modes), found.anchor,
        (found.closing.residual, found.jacobian, found.closing),
    )  # fmt: skip
    return Point(**vars(found), orbit=orbit) if bool(orbit.successful) else Failure(str(orbit.result))


def ahead(
    problem: Problem, point: Candidate, distance: float, way: np.ndarray | None = None
) -> Point | Failure:
    """The point at a distance along the tangent of this one, or another way in the plane of orbits."""
    found = solve_ahead(problem, point, distance, way)
    return found if isinstance(found, Failure) else describe(problem, found)


def solve_ahead(
    problem: Problem, point: Candidate, distance: float, way: np.ndarray | None = None,
    like: Candidate | None = None,
) -> Candidate | Failure:  # fmt: skip
    """The same, with the orbit not simulated again; `like` as for `solve`."""
    way = point.tangent if way is None else way
    there = point.u + distance * way
    along = point.tangent
    found = solve(problem, there, point.modes, point.anchor, along, along, like=like)
    if is_astray(found, there, distance, ACCURACY.strays):
        return Failure("not_converged")
    if isinstance(found, Failure):
        return found
    return _in_family(problem, point, found, there)


def _in_family(
    problem: Problem, point: Candidate, found: Candidate, there: np.ndarray
) -> Candidate | Failure:
    """The orbit of a family whose conserved numbers are those of where it was looked for.

    A slider that sticks all the time is anywhere. Where Newton's method comes across states in which it
    slips, these move it, and the orbit would stick up to elsewhere than the others of its branch.
    """
    away = _moved_in_family(found, there)
    if not np.any(np.abs(away) > ENGINE.solved) or not _same_sequence(problem, point, found):
        return found
    rows = np.vstack([found.jacobian, point.tangent])
    right = np.append(away, np.zeros(len(rows) - away.size))
    back = found.u - np.linalg.lstsq(rows, right, rcond=ENGINE.slack)[0]
    again = solve(problem, back, found.modes, found.anchor, point.tangent, point.tangent)
    if isinstance(again, Failure) or not _same_sequence(problem, point, again):
        return Failure("not_converged")
    away = _moved_in_family(again, there)
    return Failure("not_converged") if np.any(np.abs(away) > ENGINE.solved) else again


def _same_sequence(problem: Problem, one: Candidate, other: Candidate) -> bool:
    """Whether two orbits have one sequence of modes, wherever their periods begin in it."""
    if one.begins_like(other):
        return True
    points = [describe(problem, found) for found in (one, other)]
    sequences = [None if isinstance(point, Failure) else point.sequence for point in points]
    return sequences[0] is not None and sequences[0] == sequences[1]


def _moved_in_family(found: Candidate, there: np.ndarray) -> np.ndarray:
    """By how much the conserved numbers of an orbit are others than those of these unknowns."""
    conserved = found.closing.conserved
    if conserved is None:
        return np.zeros(1)
    return np.asarray(conserved) @ (found.u - there)[: conserved.shape[1]]


def correct_from(problem: Problem, point: Point, move: np.ndarray) -> Point | Failure:
    """The orbit that Newton's method finds from a move away from a point: maybe on another branch."""
    return correct(problem, point.u + move, point.modes, point.anchor, point.tangent, point.tangent)


def is_astray(found: Candidate | Failure, expected: np.ndarray, distance: float, most: float) -> bool:
    """Whether an orbit is farther from where it was expected than so many steps."""
    if isinstance(found, Failure):
        return False
    return bool(np.linalg.norm(found.u - expected) > most * abs(distance) + ENGINE.same)


def leaps(point: Point, new: Point, distance: float) -> bool:
    """Whether an orbit of the same sequence, a step ahead, is farther away than the branch bends, or
    repeats itself: branches that double an orbit pass near that one."""
    if int(new.orbit.repeats) > int(point.orbit.repeats):
        return True
    angle = float(np.arccos(np.clip(new.tangent @ point.tangent, -1.0, 1.0)))
    return is_astray(new, point.u + distance * point.tangent, distance, ACCURACY.swerves + angle)


def remeasure(problem: Problem, point: Point) -> Point:
    """The same orbit measured around itself, where that is possible; begun elsewhere if an event is
    near its start.

    The plane of its first point is then across the motion there, and nearby orbits have no event at
    their start, which is put into the middle of the longest time without event.
    """
    found = beginning_elsewhere(problem, point)
    if isinstance(found, Failure):
        return point
    new, shift = found
    around = new.anchor
    before, after = (_direction(problem, p, around.size) for p in (point, new))
    if shift:  # states at different places of the orbit are not comparable
        ends = slice(-2, None) if problem.forcing_period is None else slice(-1, None)
        before, after = before[ends], after[ends]
    return new if before @ after >= 0 else new.backward()


def beginning_elsewhere(problem: Problem, point: Point) -> tuple[Point, float] | Failure:
    """The same orbit measured around itself, and by how much later it begins [s]."""
    orbit, anchor = point.orbit, point.anchor
    period, shift, y, mode = float(orbit.period), _shift(orbit), orbit.y0, orbit.mode0
    if shift:
        run = simulate(
            system_at(problem, point.values), orbit.t0, orbit.t0 + shift, y, mode, problem.args,
            integrator=problem.integrator, saveat=SaveAt(max_events=None),
        )  # fmt: skip
        y, mode = run.y1, run.mode1
    phase = (float(anchor.phase) + shift / period) % 1.0
    around, u, modes = anchor_at(
        problem,
        jnp.asarray(point.values),
        y,
        mode,
        jnp.asarray(phase),
        jnp.asarray(period),
        (anchor, not shift),
    )
    # No direction is held: the nearest orbit of the branch, also where the parameter turns.
    new = correct(problem, np.asarray(u), modes, around, np.zeros(u.shape[0]), None)
    return new if isinstance(new, Failure) else (new, shift)


def _shift(orbit: PeriodicOrbit) -> float:
    """Time from the start to the middle of the longest time without event; 0 if no event is near."""
    count, period = int(orbit.events.count), float(orbit.period)
    if not count:
        return 0.0
    times = np.asarray(orbit.events.t)[:count] - float(orbit.t0)
    if ACCURACY.near * period < times[0] and times[-1] < (1.0 - ACCURACY.near) * period:
        return 0.0
    gaps = np.diff(np.append(times, times[0] + period))
    at = int(np.argmax(gaps))
    return float((times[at] + 0.5 * gaps[at]) % period)


def _direction(problem: Problem, point: Point, size: Any) -> np.ndarray:
    """Tangent of the branch in parts of one size: state at the first knot, period, parameter."""
    states = size.shape[0]
    first = point.tangent[:states] * np.asarray(point.anchor.size) / size
    if problem.forcing_period is not None:
        return np.append(first, point.tangent[-1])
    return np.concatenate([first, point.tangent[-2:]])
