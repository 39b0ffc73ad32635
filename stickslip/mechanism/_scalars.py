"""Linear algebra on a few scalars, written out while tracing.

Python numbers and NumPy constants are structure: a product with 0 is left out of the program, one with
1 costs nothing. So a declared mechanism costs what the same equations written by hand would cost, and
runs in the compiled loop over fixed-size lanes, whose body may hold no call.
"""

import functools
import operator
from collections.abc import Iterable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import SMOOTH, where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE


def is_zero(x: Any) -> bool:
    """Whether `x` is the constant 0, known while tracing."""
    return isinstance(x, int | float | np.number) and bool(x == 0)


def times(a: Any, b: Any) -> Any:
    """Product; without an operation where one factor is the constant 0, 1 or -1."""
    if is_zero(a) or is_zero(b):
        return 0.0
    for c, x in ((a, b), (b, a)):
        if isinstance(c, int | float | np.number):
            return x if c == 1 else -x if c == -1 else float(c) * x
    return a * b


def total(terms: Iterable[Any]) -> Any:
    """Sum of the terms that are not the constant 0."""
    terms = [term for term in terms if not is_zero(term)]
    return functools.reduce(operator.add, terms) if terms else 0.0


def minus(a: Any, b: Any) -> Any:
    """Difference."""
    return total((a, times(-1.0, b)))


def over(n: Any) -> Any:
    """One over `n`; 0 where it vanishes while the program runs."""
    if isinstance(n, int | float | np.number):
        return 1.0 / n
    return 1.0 / where(n == 0.0, np.inf, n)


def dot(a: Sequence[Any], b: Any) -> Any:
    """Scalar product."""
    return total(times(x, y) for x, y in zip(a, b, strict=True))


def any_of(conditions: Iterable[Any]) -> Any:
    """Whether one of them holds."""
    return functools.reduce(operator.or_, conditions)


def choose(condition: Any, yes: Any, no: Any) -> Any:
    """`where`, without an operation where both are the constant 0."""
    return 0.0 if is_zero(yes) and is_zero(no) else where(condition, yes, no)


def without_slope(tree: Any) -> Any:
    """`stop_gradient` that leaves constants what they are: as arrays their zeros would be unknown."""

    def as_constant(x: Any) -> Any:
        return x if isinstance(x, int | float | np.number) else jax.lax.stop_gradient(x)

    return jax.tree.map(as_constant, tree)


class Factors:
    """$A = L D L^T$ of a symmetric positive definite matrix given by rows; constant zeros stay zeros.

    Without square roots, which cost more than all the rest where the matrix is small. `semidefinite`: a
    row may depend on those before it. Its part of a solution is then 0, or NaN where there is none.
    """

    def __init__(self, A: Sequence[Sequence[Any]], semidefinite: bool = False):
        n = len(A)
        self.depends: list[Any] = []  # of each row; empty if none may
        self.low: list[list[Any]] = [[0.0] * i for i in range(n)]
        self.inverse: list[Any] = []  # one over the entries of D
        for i in range(n):
            scaled: list[Any] = []  # row of L D
            for j in range(i):
                past = (times(scaled[k], self.low[j][k]) for k in range(j))
                scaled.append(minus(A[i][j], total(past)))
            self.low[i] = [times(s, self.inverse[j]) for j, s in enumerate(scaled)]
            pivot = minus(A[i][i], dot(scaled, self.low[i]))
            if semidefinite:
                with jax.named_scope(SMOOTH):
                    self.depends.append(pivot <= ENGINE.slack * A[i][i])
                    pivot = where(self.depends[i], np.inf, pivot)
            self.inverse.append(1.0 / pivot)

    def solve(self, b: Sequence[Any]) -> list[Any]:
        """$A^{-1} b$."""
        x: list[Any] = []
        for i, value in enumerate(b):
            x.append(minus(value, dot(self.low[i], x)))
            if self.depends:
                with jax.named_scope(SMOOTH):
                    terms = total(jnp.abs(times(n, y)) for n, y in zip(self.low[i], x, strict=False))
                    differs = jnp.abs(x[i]) > ENGINE.zero * (jnp.abs(value) + terms)
                    x[i] = where(self.depends[i] & differs, np.nan, x[i])
        x = [times(value, inverse) for value, inverse in zip(x, self.inverse, strict=True)]
        for i in reversed(range(len(x))):
            x[i] = minus(x[i], total(times(self.low[k][i], x[k]) for k in range(i + 1, len(x))))
        return x


class Mass:
    """A mass matrix, diagonal or full, of constants and traced numbers."""

    def __init__(
        self, diagonal: Sequence[Any] | None = None, full: Sequence[Sequence[Any]] | None = None
    ):
        self.diagonal, self.full = diagonal, full

    def of(self, columns: Sequence[int]) -> "Mass":
        """The block of some velocities; diagonal if it is."""
        if self.diagonal is not None:
            return Mass([self.diagonal[j] for j in columns])
        assert self.full is not None
        rows = [[self.full[i][j] for j in columns] for i in columns]
        n = range(len(columns))
        if all(is_zero(rows[i][j]) for i in n for j in n if i != j):
            return Mass([rows[i][i] for i in n])
        return Mass(full=rows)

    def times(self, v: Sequence[Any]) -> list[Any]:
        """Momenta of the velocities `v`."""
        if self.diagonal is not None:
            return [times(m, x) for m, x in zip(self.diagonal, v, strict=True)]
        assert self.full is not None
        return [dot(row, v) for row in self.full]

    @functools.cached_property
    def _factors(self) -> Factors:
        assert self.full is not None
        return Factors(self.full)

    def solve(self, force: Any) -> list[Any]:
        """Accelerations under the forces."""
        if self.diagonal is not None:
            return [f if is_zero(f) else f / m for f, m in zip(force, self.diagonal, strict=True)]
        return self._factors.solve(force)
