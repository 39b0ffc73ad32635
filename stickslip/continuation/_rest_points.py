"""Special points between two equilibria: functions whose zeros they are, and where these lie."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import brentq

from ._rest import Field, Measure, Rest, corrected, described, of_length_one, scales_of

# A function that changes its sign has a zero there if it comes down to this part of its larger value.
ZERO = 1e-3
NONE = {"LP": 1e-12, "BP": 1e-12, "HB": 1e-11}  # values that are zero
ODD = ("LP", "BP")  # of the other sign where the branch is followed the other way
OFF_AXIS = 1e-9  # part of its size beside the real axis of an eigenvalue that is not real
NEARER, EVALUATIONS, CLOSE = 30, 20, 1e-13  # of the search for a branch point
NULL = 1e-9  # of the defect of an equation at a solution
LEVEL = 1e-5  # rate of the parameter along the branch, at a branch point where it turns

Test = Callable[[Rest, Measure], float]


def turning(rest: Rest, measure: Measure) -> float:
    """Rate of the parameter along the branch: zero at a fold."""
    return float(measure.part(rest.tangent)[-1])


def crossing(rest: Rest, measure: Measure) -> float:
    """Least singular value of the derivative, with the sign of its determinant with the tangent."""
    matrix = measure.balanced(rest.jacobian)
    found = np.linalg.svd(matrix, compute_uv=False)
    row = rest.tangent / measure.columns
    sign = np.linalg.slogdet(np.vstack([matrix, row / np.linalg.norm(row)]))[0]
    return float(sign * found[-1])


def pairs(rest: Rest, measure: Measure | None = None) -> float:
    r"""$\prod_{i<j}(\lambda_i + \lambda_j)$, by the sizes: zero with a pair on the imaginary axis."""
    found, product = rest.eigenvalues, 1.0 + 0.0j
    for i in range(found.size):
        for j in range(i):
            product *= (found[i] + found[j]) / max(abs(found[i]), abs(found[j]), 1e-300)
    return float(np.real(product)) if found.size > 1 else 1.0


TESTS: dict[str, Test] = {"LP": turning, "BP": crossing, "HB": pairs}


def signs(rest: Rest, measure: Measure) -> dict[str, int]:
    """Signs of all functions, 0 where one is zero."""
    values = {label: test(rest, measure) for label, test in TESTS.items()}
    return {label: 0 if abs(v) <= NONE[label] else int(np.sign(v)) for label, v in values.items()}


def axis_pair(rest: Rest) -> int | None:
    """Number of the eigenvalue above the axis whose pair is on it; None if both are real."""
    found = rest.eigenvalues
    near = [(abs(a + b), i) for i, a in enumerate(found) for b in found[:i]]
    if not near:
        return None
    at = min(near)[1]
    if not abs(found[at].imag) > OFF_AXIS * abs(found[at]):
        return None
    return int(np.argmin(np.abs(found - 1j * abs(found[at].imag))))


def labelled(
    field: Field, rest: Rest, new: Rest, distance: float, measure: Measure, changed: list[str]
) -> list[tuple[str, Rest, str]]:
    """Special points between two equilibria where functions change their sign, in order.

    Where two branches cross, the parameter may turn along one of them: it is no fold, although its
    rate passes zero, since beyond it another branch goes on. No Hopf point is where the eigenvalues
    whose sum passes zero are real, on both sides if it is not located.
    """
    found, known, crossed = [], {0.0: rest, distance: new}, None
    for label in sorted(changed):  # the branch point first
        point: Rest | str
        bracket, test = [0.0, distance], TESTS[label]
        if abs(test(rest, measure)) <= NONE[label]:
            point = rest
        elif label == "BP":
            point = _branch_point(field, rest, new, distance, measure)
            if not isinstance(point, str):
                crossed = float(measure.along(rest.tangent) @ (point.z - rest.z))
                known[crossed] = point
        else:
            if label == "LP" and crossed is not None:
                rate = turning(known[crossed], measure)
                if abs(rate) <= LEVEL:
                    continue
                bracket[0 if rate * turning(rest, measure) > 0.0 else 1] = crossed
            point = located(field, rest, bracket, known, measure, lambda p, t=test: t(p, measure))
        if label == "HB" and isinstance(point, str) and axis_pair(rest) is axis_pair(new) is None:
            continue
        if isinstance(point, str):
            words = f"not located: between here and {new.value:.10g}, {point}"
            found.append((f"{label}?", rest, words))
        elif label != "HB" or axis_pair(point) is not None:
            found.append((label, point, ""))
    return sorted(found, key=lambda m: measure.length(m[1].z - rest.z))


def located(
    field: Field, before: Rest, bracket: list[float], known: dict[float, Rest], measure: Measure,
    test: Callable[[Rest], float],
) -> Rest | str:  # fmt: skip
    """The equilibrium where a test is zero, by Brent's method, or why there is none.

    `bracket`: distances along the tangent of the one before, of which `known` has the equilibria.
    """
    ends = dict(known)
    along = measure.along(before.tangent)
    largest = max(abs(test(ends[at])) for at in bracket)

    def value(at: float) -> float:
        if at not in ends:
            found = corrected(field, before.z + at * before.tangent, along, before.tangent, measure)
            if found is None:
                raise ArithmeticError("Newton's method finds no equilibrium there")
            ends[at] = found
        return test(ends[at])

    try:
        found: Any = brentq(value, *bracket, xtol=1e-15, rtol=1e-14)  # pyright: ignore[reportArgumentType]
        root = float(found)
        if abs(value(root)) > ZERO * largest:
            return "the function jumps there"
    except (ArithmeticError, ValueError) as error:
        return str(error)
    return ends[root]


def _branch_point(field: Field, rest: Rest, new: Rest, distance: float, measure: Measure) -> Rest | str:
    """The equilibrium where the derivative has a second null vector.

    At it Newton's method for equilibria is singular, and near it ill-conditioned. A larger system,
    for the point and the left null vector together, is not; it is tried from ever nearer.
    """
    along = measure.along(rest.tangent)
    low, high = (0.0, rest, crossing(rest, measure)), (distance, new, crossing(new, measure))
    largest, reason = max(abs(low[2]), abs(high[2])), "Newton's method finds no equilibrium there"
    for _ in range(NEARER):
        part = float(np.clip(low[2] / (low[2] - high[2]), 0.05, 0.95))
        guess = low[1].z + part * (high[1].z - low[1].z)
        point = _singular(field, guess, measure)
        width = measure.length(high[1].z - low[1].z)
        if point is not None and measure.length(point - guess) <= width:
            at = along @ (point - rest.z)
            if low[0] - 0.1 * width <= at <= high[0] + 0.1 * width:
                return _at_branch_point(field, point, high[1].z - low[1].z, measure)
        middle = 0.5 * (low[0] + high[0])
        found = corrected(field, rest.z + middle * rest.tangent, along, rest.tangent, measure)
        if found is None:
            return reason
        value = crossing(found, measure)
        if value * low[2] > 0.0:
            low = middle, found, value
        else:
            high = middle, found, value
    if min(abs(low[2]), abs(high[2])) > ZERO * largest:
        return "the function jumps there"
    return reason


def _singular(field: Field, z: np.ndarray, measure: Measure) -> np.ndarray | None:
    r"""Solution of $f + \beta\phi = 0$, $\phi^T f' = 0$, $|\phi| = 1$ with $\beta = 0$, near `z`."""
    rows, columns = measure.rows, measure.columns
    n = rows.size
    phi, beta = np.linalg.svd(measure.balanced(field(z)[1]))[0][:, -1], 0.0
    before = np.inf
    for _ in range(EVALUATIONS):
        values, jacobian = field(z)
        slope, bend = measure.balanced(jacobian), field.curvature(z, phi * rows)
        bend = bend * columns[:, None] * columns[None, :]
        matrix = np.block(
            [
                [slope, beta * np.eye(n), phi[:, None]],
                [bend, slope.T, np.zeros((n + 1, 1))],
                [np.zeros((1, n + 1)), 2.0 * phi[None, :], np.zeros((1, 1))],
            ]
        )
        right = np.concatenate([values * rows + beta * phi, slope.T @ phi, [phi @ phi - 1.0]])
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right))):
            return None
        lines, stacks = scales_of(matrix)
        scaled = matrix * lines[:, None] * stacks[None, :]
        move = stacks * np.linalg.lstsq(scaled, right * lines, rcond=1e-15)[0]
        z, phi, beta = z - move[: n + 1] * columns, phi - move[n + 1 : -1], beta - move[-1]
        parts = measure.part(move[: n + 1] * columns)
        longest = float(np.max(np.abs(np.concatenate([parts, move[n + 1 :]]))))
        if longest <= CLOSE or (longest <= NULL and longest >= 0.5 * before):
            least = np.linalg.svd(measure.balanced(field(z)[1]), compute_uv=False)[-1]
            return z if abs(beta) <= NULL and least <= 1e-6 else None
        before = longest
    return None


def _at_branch_point(field: Field, z: np.ndarray, chord: np.ndarray, measure: Measure) -> Rest | str:
    """The branch point, with that of the two tangents which is nearer to a chord."""
    slope = measure.balanced(field(z)[1])
    left, _, right = np.linalg.svd(slope)
    plane = right[-2:]
    bend = field.curvature(z, left[:, -1] * measure.rows)
    bend = plane @ (bend * measure.columns[:, None] * measure.columns[None, :]) @ plane.T
    # A quadratic form is zero on two lines: half-way between them lies an eigenvector.
    values, vectors = np.linalg.eigh(bend)
    if values[0] < 0.0 < values[1]:
        one, other = np.sqrt(values[1]), np.sqrt(-values[0])
        lines = [(one * vectors[:, 0] + s * other * vectors[:, 1]) @ plane for s in (1.0, -1.0)]
        ways = [of_length_one(line * measure.columns, chord, measure) for line in lines]
        parts = [abs(measure.part(way) @ measure.part(chord)) for way in ways]
        tangent = ways[int(np.argmax(parts))]
    else:
        tangent = of_length_one(chord, chord, measure)
    point = described(field, z, tangent, measure)
    if point is None:
        return "Newton's method finds no equilibrium there"
    return Rest(point.z, tangent, point.jacobian, point.eigenvalues, point.vectors)
