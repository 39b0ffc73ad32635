"""Newton's method for one orbit, with derivatives that are renewed only where they must be."""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np

from ._accuracy import ACCURACY
from ._along import Anchor, Problem, equations_at, residual_at
from ._closing import Closure
from ._family import Failure


class Start(NamedTuple):
    """Where the method begins: unknowns, modes at the knots, anchor; `along` it does not move."""

    u: np.ndarray
    modes: Any
    anchor: Anchor
    along: np.ndarray


class Solved(NamedTuple):
    """Where it ended, with the equations there. `evaluations` tell how far away it began."""

    u: np.ndarray
    modes: Any
    residual: np.ndarray
    jacobian: np.ndarray
    closing: Closure
    evaluations: int | float


@runtime_checkable  # as types are checked at call time
class Near(Protocol):
    """An orbit nearby of the same anchor, with its equations."""

    @property
    def jacobian(self) -> np.ndarray: ...
    @property
    def closing(self) -> Closure: ...


def solve(problem: Problem, start: Start) -> Solved | Failure:
    """With the derivative at each guess: converges from farthest away."""
    u, modes, best = start.u, start.modes, np.inf
    for evaluation in range(1, ACCURACY.evaluations + 1):
        residual, jacobian, found = jax.device_get(
            equations_at(problem, jnp.asarray(u), modes, start.anchor)
        )
        if not _is_good(residual, found):
            return Failure("guess_failed")
        norm = _size(residual)
        if _is_solved(norm, best):
            return Solved(u, modes, residual, jacobian, found, evaluation)
        if norm > ACCURACY.far * best:
            break
        best = min(best, norm)
        step = _step(np.vstack([jacobian, start.along]), residual, u, start)
        if step is None:
            return Failure("singular")
        u, modes = u + step, _next_modes(found)
    return Failure("not_converged")


def solve_near(problem: Problem, start: Start, near: Near, rough: bool) -> Solved | Failure:
    """With the derivative of an orbit nearby, and what each step tells of it (Broyden 1965).

    A derivative costs as much as several motions for each ten unknowns. It is taken anew where a step
    has not brought a digit, and of the orbit that is found, but for a `rough` one. A residual that
    grows is a failure: then `solve` is asked.
    """
    u, modes, last = start.u, start.modes, np.inf
    neutral = near.closing.neutral
    matrix, cost = np.vstack([near.jacobian, start.along]), 0.0
    step = before = np.zeros(u.size)
    for _ in range(ACCURACY.evaluations):
        residual, found = jax.device_get(
            residual_at(problem, jnp.asarray(u), modes, start.anchor, jnp.asarray(neutral))
        )
        cost += ACCURACY.shorter  # two of these bring as much as one with a derivative of its own
        if not _is_good(residual, found):
            break
        norm = _size(residual)
        if rough and _is_solved(norm, last):
            closing = found._replace(pieces=near.closing.pieces, neutral=neutral)
            return Solved(u, modes, residual, near.jacobian, closing, cost)
        solved = _is_solved(norm, last)
        if not solved and norm > last:
            break
        if solved or norm > ACCURACY.swerves * last:
            residual, fresh, found = jax.device_get(
                equations_at(problem, jnp.asarray(u), modes, start.anchor)
            )
            cost += 1.0
            if not _is_good(residual, found):
                break
            norm = _size(residual)
            if _is_solved(norm, last):
                return Solved(u, modes, residual, fresh, found, cost)
            matrix, neutral = np.vstack([fresh, start.along]), found.neutral
        elif np.isfinite(last):
            away = np.append(residual, start.along @ (u - start.u)) - before - matrix @ step
            matrix = matrix + np.outer(away, step) / (step @ step)
        before = np.append(residual, start.along @ (u - start.u))
        found_step = _step(matrix, residual, u, start)
        if found_step is None:
            break
        last, step = norm, found_step
        u, modes = u + step, _next_modes(found)
    return Failure("not_converged")


def _is_good(residual: np.ndarray, found: Closure) -> bool:
    return bool(np.all(found.good)) and bool(np.all(np.isfinite(residual)))


def _size(residual: np.ndarray) -> float:
    return float(np.max(np.abs(residual)))


def _is_solved(norm: float, best: float) -> bool:
    tolerance = ACCURACY.solved
    return norm <= tolerance or (norm < ACCURACY.stalled * tolerance and norm > 0.5 * best)


def _step(matrix: np.ndarray, residual: np.ndarray, u: np.ndarray, start: Start) -> np.ndarray | None:
    right = np.append(residual, start.along @ (u - start.u))
    try:
        step = np.linalg.lstsq(matrix, right, rcond=ACCURACY.rounding)[0]
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite(step)):
        return None
    return -step * min(1.0, 5.0 / max(np.max(np.abs(step)), 5.0))


def _next_modes(found: Closure) -> Any:
    modes = np.roll(found.modes, 1)
    modes[0] = found.modes[-1]
    return modes
