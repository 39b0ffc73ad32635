"""Constant directions of contacts: null spaces, lines, inverses; small whole numbers stay exact."""

import itertools

import numpy as np

from stickslip.hybrid.accuracy import ACCURACY as ENGINE


def completed_inverse(J: np.ndarray) -> np.ndarray:
    """Inverse of `J` completed by unit rows to a square matrix; whole numbers stay exact."""
    n = J.shape[1]
    rows = list(J)
    for unit in np.eye(n):
        if len(rows) < n and np.linalg.matrix_rank(np.array([*rows, unit])) > len(rows):
            rows.append(unit)
    inverse = np.linalg.inv(np.array(rows).reshape(n, n))
    return _whole(inverse)


def _whole(A: np.ndarray) -> np.ndarray:
    nearest = np.round(A)
    return np.where(np.abs(A - nearest) < ENGINE.slack, nearest, A) + 0.0


def null_space(A: np.ndarray, n: int) -> np.ndarray:
    """Columns that span the null space, by the reduced row echelon form: small numbers stay exact."""
    A = np.array(A, float).reshape(-1, n)
    pivots: list[int] = []
    row = 0
    for column in range(n):
        if row == len(A):
            break
        best = row + int(np.argmax(np.abs(A[row:, column])))
        if abs(A[best, column]) < ENGINE.zero:
            continue
        A[[row, best]] = A[[best, row]]
        A[row] /= A[row, column]
        others = [i for i in range(len(A)) if i != row]
        A[others] -= np.outer(A[others, column], A[row])
        pivots.append(column)
        row += 1
    free = [c for c in range(n) if c not in pivots]
    basis = np.zeros((n, len(free)))
    for k, c in enumerate(free):
        basis[c, k] = 1.0
        basis[pivots, k] = -A[: len(pivots), c]
    return np.where(np.abs(basis) < ENGINE.slack, 0.0, basis)


def lines_of(J: np.ndarray) -> np.ndarray:
    """All lines on which all but one of the degrees of freedom that contacts can hold are held."""
    rank = int(np.linalg.matrix_rank(J))
    held = np.linalg.svd(J)[2][:rank]
    found: list[np.ndarray] = []
    for some in itertools.combinations(range(len(J)), rank - 1):
        part = J[list(some)]
        if np.linalg.matrix_rank(part) < rank - 1:
            continue
        line = null_space(part @ held.T, rank)[:, 0] @ held
        line = np.where(np.abs(line) < ENGINE.slack, 0.0, line)
        line = line / np.abs(line[np.abs(line) > ENGINE.zero]).min()
        whole = np.round(line)
        line = np.where(np.abs(line - whole) < ENGINE.zero, whole, line)
        if not any(np.allclose(line, s * other) for other in found for s in (1, -1)):
            found.append(line)
    return np.array(found)
