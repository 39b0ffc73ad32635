"""`continue_equilibrium`: a branch of equilibria over one parameter, with its Hopf points and folds."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree
from scipy.optimize import brentq

from .._types import Given, Mode
from .._validation import check_count, check_flag, one_concrete, refusal
from ..analysis._observable import with_parameters
from ..hybrid import AbstractHybridSystem
from ..hybrid._arguments import check_field, start_of, the_system
from ..hybrid._tree import with_float_arrays
from ._arguments import bounds_of, value_of
from ._closing import check_autonomous
from ._equilibrium import EquilibriumBranch, EquilibriumPoint

EVALUATIONS = 20  # of Newton's method
CLOSE = 1e-13  # a step as short as this, in parts of the sizes, ends it
ROUNDING = 1e-9  # or one that is no shorter than the one before and below this
BEND = 0.95  # cosine between two tangents: sharper bends get shorter steps
SHORTEST = 2.0**-12
SWERVES = 0.1  # of a step: farther than this and its bend from where it was expected, it is another one
OFF_AXIS = 1e-9  # part of its size beside the real axis of an eigenvalue that is not real


@dataclasses.dataclass(frozen=True)
class _Rest:
    """An equilibrium: unknowns in parts of the sizes, the parameter last."""

    u: np.ndarray
    tangent: np.ndarray
    jacobian: np.ndarray
    eigenvalues: np.ndarray
    vectors: np.ndarray


class _Field:
    """The field of one mode and its derivatives by all unknowns, compiled once."""

    def __init__(self, system, name: str, t0, y0: PyTree, mode, args, size: np.ndarray):
        self.name, self.size = name, size
        _, self.unravel = ravel_pytree(y0)
        self.given = system, t0, mode, args, self.unravel

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = _slopes(self.name, *self.given, jnp.asarray(u * self.size))
        return np.asarray(values), np.asarray(slopes) * self.size[None, :]


@eqx.filter_jit
def _slopes(name, system, t0, mode, args, unravel, z):
    def field(z):
        there = with_parameters(system, {name: z[-1]})
        return ravel_pytree(there.vector_field(t0, unravel(z[:-1]), mode, args))[0]

    return field(z), jax.jacfwd(field)(z)


def continue_equilibrium(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    parameter: Given[str],
    bounds: Given[tuple[float, float]],
    *,
    mode0: Mode | None = None,
    step: Given[float] = 0.02,
    max_points: Given[int] = 200,
    both: Given[bool] = True,
    args: PyTree = None,
) -> EquilibriumBranch:
    r"""Follow an equilibrium, $f(y; p) = 0$ in one mode, over one parameter, through folds.

    Pseudo-arclength continuation with exact derivatives; each state is a solution of Newton's method.
    Where a real eigenvalue or a pair of the linear motion about it crosses the imaginary axis, the
    point is located by root finding along the branch. The guards of the system are not looked at: an
    equilibrium of a mode that the system would leave is one of the mode's field alone.

    **Arguments**

    - `system`, `args`: without dependence on the time; `parameter` has the value where `y0` is.
    - `y0`: a state near the equilibrium; `mode0`: in which mode, by default that of the system there.
    - `bounds`: least and greatest value of the parameter.
    - `step`: first and longest step, in parts of the bounds' distance (and of the state's size).
    - `max_points`: states on each of the two halves. `both`: follow to both sides of `y0`; otherwise
      to larger values of the parameter.

    **Returns** an `EquilibriumBranch` with the special points `LP` (fold), `BP` (branch point), `HB`
    (Hopf: a pair crosses the imaginary axis) and `EP` (end, with the reason). From an `HB` point
    `continue_orbit` follows the periodic orbits that are born there. It runs outside `jit`.

    **Errors** `ValueError`/`TypeError` naming the argument; also where Newton's method finds no
    equilibrium from `y0`.
    """
    the_system(system)
    value = value_of(system, parameter)
    low, high = bounds_of("bounds", bounds)
    if not low <= value <= high:
        raise refusal("bounds", (low, high), f"around the value of {parameter}, {value}")
    step = float(one_concrete("step", step, "positive"))
    check_count("max_points", max_points, 1)
    check_flag("both", both)
    y0, mode = start_of(system, 0.0, y0, mode0, args)
    check_field(system, 0.0, y0, mode, args)
    check_autonomous("system", system, 0.0, y0, mode, args, "without dependence on the time")
    flat = np.asarray(ravel_pytree(y0)[0], float)
    size = np.append(np.where(flat != 0.0, np.abs(flat), 1.0), high - low)
    field = _Field(with_float_arrays(system), parameter, 0.0, y0, mode, args, size)
    hold = np.zeros(size.size)
    hold[-1] = 1.0
    first = _corrected(field, np.append(flat, value) / size, hold, hold)
    if first is None:
        raise refusal("y0", y0, "near an equilibrium of this mode: Newton's method finds none")
    ends = (low, high)
    forward, marks = _half(field, first, ends, step, max_points)
    if both:
        back = dataclasses.replace(first, tangent=-first.tangent)
        backward, before = _half(field, back, ends, step, max_points)
        forward, marks = backward[:0:-1] + forward, before[::-1] + marks
    states = np.stack([p.u * size for p in forward])
    tree = jax.vmap(field.unravel)(jnp.asarray(states[:, :-1]))
    return EquilibriumBranch(
        parameter, states[:, -1], int(mode), jax.tree.map(np.asarray, tree),
        np.stack([p.eigenvalues for p in forward]),
        tuple(_special(field, int(mode), *mark) for mark in marks), system,
    )  # fmt: skip


def _corrected(field: _Field, u: np.ndarray, along: np.ndarray, sense: np.ndarray) -> _Rest | None:
    """The equilibrium in the plane through `u` across `along`; None where Newton's method fails."""
    start, before = u, np.inf
    for _ in range(EVALUATIONS):
        values, jacobian = field(u)
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(jacobian))):
            return None
        # Rows in parts of their own size: rates may differ by many orders.
        rows = np.maximum(np.max(np.abs(jacobian), axis=1), 1e-300)
        matrix = np.vstack([jacobian / rows[:, None], along])
        move = np.linalg.lstsq(matrix, np.append(values / rows, along @ (u - start)), rcond=1e-14)[0]
        u = u - move
        length = float(np.max(np.abs(move)))
        if length <= CLOSE or (length <= ROUNDING and length >= 0.5 * before):
            break
        before = length
    else:
        return None
    _, jacobian = field(u)
    rows = np.maximum(np.max(np.abs(jacobian), axis=1), 1e-300)
    tangent = np.linalg.svd(jacobian / rows[:, None])[2][-1]
    tangent = tangent if tangent @ sense >= 0 else -tangent
    # In the state's own units: of a scaled matrix they are the same, but not the vectors.
    own = jacobian[:, :-1] / field.size[None, :-1]
    rates, vectors = np.linalg.eig(own)
    order = np.lexsort((-np.imag(rates), -np.real(rates)))
    return _Rest(u, tangent, jacobian / rows[:, None], rates[order], vectors[:, order])


def _turning(rest: _Rest) -> float:
    return float(rest.tangent[-1])


def _crossing(rest: _Rest) -> float:
    return float(np.linalg.det(np.vstack([rest.jacobian, rest.tangent])))


def _pairs(rest: _Rest) -> float:
    r"""$\prod_{i<j}(\lambda_i + \lambda_j)$, by the sizes: zero with a pair on the imaginary axis."""
    found, product = rest.eigenvalues, 1.0 + 0.0j
    for i in range(found.size):
        for j in range(i):
            product *= (found[i] + found[j]) / max(abs(found[i]), abs(found[j]), 1e-300)
    return float(np.real(product)) if found.size > 1 else 1.0


TESTS: dict[str, Callable[[_Rest], float]] = {"LP": _turning, "BP": _crossing, "HB": _pairs}


def _axis_pair(rest: _Rest) -> int | None:
    """Number of the eigenvalue above the axis whose pair is on it; None if both are real."""
    found = rest.eigenvalues
    pairs = [(abs(a + b), i) for i, a in enumerate(found) for b in found[:i]]
    if not pairs:
        return None
    at = min(pairs)[1]
    if not abs(found[at].imag) > OFF_AXIS * abs(found[at]):
        return None
    return int(np.argmin(np.abs(found - 1j * abs(found[at].imag))))


def _half(field: _Field, start: _Rest, ends, step: float, most: int):
    """Equilibria from `start` along its tangent; special points as (label, where, words)."""
    points, marks, distance = [start], [], step
    while len(points) < most:
        rest = points[-1]
        new = _corrected(field, rest.u + distance * rest.tangent, rest.tangent, rest.tangent)
        leaps = new is not None and _leaps(rest, new, distance)
        if new is None or leaps or new.tangent @ rest.tangent < BEND:
            if distance > SHORTEST * step:
                distance *= 0.5
                continue
            if new is None or leaps:
                marks.append(("EP", rest, "not_converged: the next equilibrium was not found"))
                return points, marks
        found = []
        for label, test in TESTS.items():
            if test(rest) * test(new) < 0:
                at = _located(field, rest, new, distance, test)
                if at is not None and (label != "HB" or _axis_pair(at) is not None):
                    found.append((label, at, ""))
        marks += sorted(found, key=lambda m: float(np.linalg.norm(m[1].u - rest.u)))
        value = new.u[-1] * field.size[-1]
        if not ends[0] <= value <= ends[1]:
            bound = ends[0] if value < ends[0] else ends[1]
            test = _beyond(bound / field.size[-1])
            last = _located(field, rest, new, distance, test) or rest
            inside = [m for m in marks if ends[0] <= m[1].u[-1] * field.size[-1] <= ends[1]]
            return [*points, last], [*inside, ("EP", last, "bounds")]
        points.append(new)
        distance = min(1.5 * distance, step)
    return points, [*marks, ("EP", points[-1], "max_points")]


def _leaps(rest: _Rest, new: _Rest, distance: float) -> bool:
    """Whether an equilibrium, a step ahead, is farther away than the branch bends: on another one."""
    angle = float(np.arccos(np.clip(new.tangent @ rest.tangent, -1.0, 1.0)))
    away = np.linalg.norm(new.u - rest.u - distance * rest.tangent)
    return bool(away > (SWERVES + angle) * distance + ROUNDING)


def _beyond(bound: float) -> Callable[[_Rest], float]:
    return lambda rest: float(rest.u[-1] - bound)


def _located(field: _Field, before: _Rest, after: _Rest, distance: float, test) -> _Rest | None:
    """The equilibrium between two others where a test is zero, by Brent's method."""
    known: dict[float, _Rest] = {0.0: before, distance: after}

    def value(at: float) -> float:
        if at not in known:
            found = _corrected(field, before.u + at * before.tangent, before.tangent, before.tangent)
            if found is None:
                raise ArithmeticError
            known[at] = found
        return test(known[at])

    try:
        root: Any = brentq(value, 0.0, distance, xtol=1e-15, rtol=1e-14)  # pyright: ignore[reportArgumentType]
        value(float(root))
    except (ArithmeticError, ValueError):
        return None
    return known[float(root)]


def _special(field: _Field, mode: int, label: str, rest: _Rest, words: str) -> EquilibriumPoint:
    z = rest.u * field.size
    period, swing = np.nan, np.zeros(z.size - 1)
    pair = _axis_pair(rest) if label == "HB" else None
    if pair is not None:
        period, swing = 2.0 * np.pi / abs(rest.eigenvalues[pair].imag), np.real(rest.vectors[:, pair])
    y = jax.tree.map(np.asarray, field.unravel(jnp.asarray(z[:-1])))
    return EquilibriumPoint(label, float(z[-1]), y, mode, rest.eigenvalues, period, swing, words)
