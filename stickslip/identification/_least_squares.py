"""Levenberg-Marquardt with exact Jacobians."""

from collections.abc import Callable
from typing import Any

from .._types import Given
from .._validation import check_callable
from ._evaluate import solved
from ._fit import Fit
from ._levenberg_marquardt import LevenbergMarquardt
from ._losses import AbstractLoss
from ._unknowns import NamedUnknowns, NamedValues, scalars


def least_squares(
    residual: Callable[[NamedValues], Any],
    start: NamedUnknowns,
    *,
    damping: float = 1.0,
    tolerance: float = 1e-8,
    max_steps: int = 64,
    loss: Given[AbstractLoss | None] = None,
) -> Fit:
    r"""Minimise $\tfrac12\|r(p)\|^2$ over the unknowns $p$, in their unbounded coordinates.

    Levenberg-Marquardt of optimistix. The Jacobian of the residuals is taken by forward mode, so that
    it is exact through the events of a simulation, and once per step.

    >>> import jax.numpy as jnp
    >>> t = jnp.linspace(0.0, 1.0, 20)
    >>> data = 3.0 * jnp.exp(-2.0 * t)
    >>> fit = least_squares(
    ...     lambda p: (p["size"] * jnp.exp(-p["rate"] * t) - data) / 0.01, dict(size=1.0, rate=1.0)
    ... )
    >>> print(f"{float(fit.values['size']):.6f} {float(fit.values['rate']):.6f}")
    3.000000 2.000000

    **Arguments**

    - `residual(values)`: one row of residuals in units of their standard deviation. A row that is not
      finite, e.g. of a run that failed, counts as a step too far.
    - `start`: by name, an `Unknown` with its start, bounds and prior; or a plain positive number, which
      is estimated in its logarithm.
    - `damping` $\lambda$ of the first step, $(J^TJ + \lambda D^2)\,\delta = -J^Tr$ with the lengths $D$
      of the columns of $J$, so that units and noise do not matter. More makes the first steps shorter.
    - `tolerance`: relative and absolute, of the coordinates and the residuals; or of the cost, by
      what the next step would gain if the residual were linear. `max_steps`: limit, refused ones
      included.
    - `loss`: a robust loss such as `Huber()` in place of squares, or `None`.

    **Returns** a `Fit`. **Raises** `TypeError`, `ValueError` if `start` is not a mapping from names to
    unknowns or positive numbers, or if another number is not positive. The residual is traced at every
    call, and compiled where its program is a new one. Works under `jit` and `vmap`; the estimate is
    not differentiated, because that would take second derivatives of the motion.
    """
    method = LevenbergMarquardt(damping, tolerance, max_steps, loss)
    check_callable("residual", residual, "f(values)", {})
    space, values = scalars("start", start)
    return solved(method, residual, space, space.coordinates(values))
