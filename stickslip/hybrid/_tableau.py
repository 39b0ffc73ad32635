"""Butcher tableaus of explicit Runge-Kutta methods, one of them read from diffrax."""

from dataclasses import dataclass
from typing import Any

import diffrax as dfx
import numpy as np

from .._types import Given, Row, Rows
from .._validation import (
    check_count,
    check_finite,
    check_text,
    numbers,
    one_row,
    refusal,
    shape_refusal,
)
from . import _dop853


@dataclass(frozen=True)
class Tableau:
    r"""Coefficients of an explicit Runge-Kutta method, for `Integrator(method=Tableau(...))`.

    $k_i = f(t + c_i h,\ y + h \sum_{j<i} a_{ij} k_j)$ and $y_1 = y + h \sum_i b_i k_i$.

    - `name`: for messages. `order`: order of convergence of $y_1$.
    - `a`: a row per stage, zero from the diagonal on or ending there. `b`: a weight per stage.
      `c`: the sums of the rows of `a`, the first one 0.
    - `error_weights`: rows of one number per stage and, last, one for the slope at the end of the step.
      Each gives an error estimate $h \sum_i e_i k_i$. One row is the usual embedded method; of two, the
      second tames the first as in DOP853 (Hairer, Nørsett & Wanner, II.10). Without any, steps can only
      be fixed.

    A method whose last stage is the slope at the end of the step (first same as last) is given without
    that stage: the integrator carries this slope itself.

    **Errors** `ValueError` if the numbers of stages differ, a row of `a` has entries from the diagonal
    on, or the sums of `a` are not `c`, or those of `b` not 1, to 1e-12.
    """

    name: Given[str]
    order: Given[int]
    a: Rows
    b: Row
    c: Row
    error_weights: Rows = ()

    def __post_init__(self):
        check_text("name", self.name)
        check_count("order", self.order, 1)
        n = len(one_row("b", self.b))
        a, b, c = _square(self.a), numbers("b", self.b), numbers("c", self.c)
        none = isinstance(self.error_weights, list | tuple) and not self.error_weights
        weights = None if none else check_finite("error_weights", self.error_weights)
        weights = None if weights is None else numbers("error_weights", weights)
        if a.shape != (n, n):
            raise shape_refusal("a", self.a, f"{n} rows of {n} numbers, one per stage")
        if c.shape != (n,):
            raise shape_refusal("c", self.c, f"{n} numbers, one per stage")
        if weights is not None and (weights.ndim != 2 or weights.shape[1] != n + 1 or len(weights) > 2):
            raise shape_refusal(
                "error_weights", self.error_weights, f"one or two rows of {n + 1} numbers"
            )
        check_finite("a", a)
        check_finite("b", b)
        if np.any(np.triu(a)):
            raise refusal("a", self.a, "zero from the diagonal on: the method must be explicit")
        if not np.allclose(a.sum(1), c, rtol=0, atol=1e-12):
            raise refusal("c", self.c, f"the sums of the rows of a, {tuple(map(float, a.sum(1)))}")
        if not abs(b.sum() - 1.0) <= 1e-12:
            raise refusal("b", self.b, "numbers whose sum is 1")
        # Hashable and of Python's own numbers, whatever was given: methods are static.
        for key, rows in (("a", a), ("error_weights", () if weights is None else weights)):
            object.__setattr__(self, key, tuple(tuple(map(float, row)) for row in rows))
        for key, row in (("b", b), ("c", c)):
            object.__setattr__(self, key, tuple(map(float, row)))

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.b)

    @property
    def ends_twice(self) -> bool:
        """Whether the last stage is at the end of the step, whose own slope no error estimate sees."""
        unseen = all(bool(row[-1] == 0.0) for row in self.error_weights)
        return self.stages > 1 and bool(self.c[-1] == 1.0) and unseen


def _square(rows: Any) -> np.ndarray:
    """The rows of `a` as an array; such as end at the diagonal are filled up with zeros."""
    if not isinstance(rows, list | tuple):
        return numbers("a", rows)
    found = [
        np.zeros(0) if isinstance(row, list | tuple) and not row else numbers(f"a[{i}]", row)
        for i, row in enumerate(rows)
    ]
    if any(row.ndim != 1 or row.size > len(rows) for row in found):
        return np.zeros((0, 0))  # rejected for its shape
    return np.array([np.pad(row, (0, len(rows) - row.size)) for row in found], float)


def from_diffrax(solver: dfx.AbstractERK) -> Tableau:
    """Tableau of any explicit Runge-Kutta solver of diffrax.

    Its last stage is dropped where it is the slope at the end of the step (first same as last),
    since the integrator carries that slope itself.
    """
    source: Any = solver.tableau
    b = np.asarray(source.b_sol, float)
    n = len(b)
    a = np.zeros((n, n))
    for i, row in enumerate(source.a_lower):
        a[i + 1, : i + 1] = np.asarray(row, float)
    c = np.concatenate([[0.0], np.asarray(source.c, float)])
    error = np.asarray(source.b_error, float)
    if b[-1] == 0.0 and np.allclose(a[-1], b, rtol=0, atol=1e-15):
        weights = error
        a, b, c = a[:-1, :-1], b[:-1], c[:-1]
    else:
        weights = np.append(error, 0.0)
    order = int(solver.order(None) or 1)
    return Tableau(type(solver).__name__, order, a, b, c, [weights])


def _rk4() -> Tableau:
    a = np.zeros((4, 4))
    a[1, 0] = a[2, 1] = 0.5
    a[3, 2] = 1.0
    return Tableau("RK4", 4, a, np.array([1, 2, 2, 1]) / 6, a.sum(1))


# The fifth- and third-order estimates of Hairer, Norsett & Wanner, combined in `error_norm`.
DOP853 = Tableau("DOP853", 8, _dop853.A, _dop853.B, _dop853.C, (_dop853.E5, _dop853.E3))
RK4 = _rk4()
TSIT5 = from_diffrax(dfx.Tsit5())

NAMED = {"dop853": DOP853, "rk4": RK4, "tsit5": TSIT5}
