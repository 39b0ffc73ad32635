"""Butcher tableaus of explicit Runge-Kutta methods, one of them read from diffrax."""

from dataclasses import dataclass, field
from typing import Any

import diffrax as dfx
import numpy as np

from . import _dop853


@dataclass(frozen=True)
class Tableau:
    """Coefficients of an explicit Runge-Kutta method of `stages` stages.

    `k_i = f(t + c_i h, y + h sum_j a_ij k_j)`, `y_1 = y + h sum_i b_i k_i`. Each row of
    `error_weights` gives one error estimate `h sum_i e_i k_i` over the stages and, as its last entry,
    the slope at the end of the step.
    """

    name: str
    order: int
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    error_weights: tuple[tuple[float, ...], ...]
    error_order: int
    stages: int = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "stages", len(self.b))


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
    return _freeze(type(solver).__name__, order, a, b, c, [weights], order)


def _rk4() -> Tableau:
    a = np.zeros((4, 4))
    a[1, 0] = a[2, 1] = 0.5
    a[3, 2] = 1.0
    return _freeze("RK4", 4, a, np.array([1, 2, 2, 1]) / 6, a.sum(1), [], 4)


def _freeze(name, order, a, b, c, error_weights, error_order) -> Tableau:
    return Tableau(
        name=name,
        order=order,
        a=tuple(tuple(map(float, row)) for row in a),
        b=tuple(map(float, b)),
        c=tuple(map(float, c)),
        error_weights=tuple(tuple(map(float, row)) for row in error_weights),
        error_order=error_order,
    )


# The fifth- and third-order estimates of Hairer, Norsett & Wanner, combined in `error_norm`.
DOP853 = _freeze("DOP853", 8, _dop853.A, _dop853.B, _dop853.C, [_dop853.E5, _dop853.E3], 8)
RK4 = _rk4()
TSIT5 = from_diffrax(dfx.Tsit5())

NAMED = {"dop853": DOP853, "rk4": RK4, "tsit5": TSIT5}
