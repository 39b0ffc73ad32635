"""Fits of a residual function from one start, by methods with their usual settings."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from .._argument_checks import callable_as, check_arguments, number
from .._types import Given
from ._descent import GradientDescent
from ._evaluate import solve_residual
from ._fit import Fit
from ._gauss_newton import SETTINGS
from ._levenberg_marquardt import LevenbergMarquardt
from ._losses import AbstractLoss
from ._methods import AbstractIterativeMethod
from ._unknowns import NamedUnknowns, NamedValues, scalars

if TYPE_CHECKING:
    import optax


@check_arguments(
    residual=callable_as("f(values)", {}), damping=number("positive"), **SETTINGS
)  # fmt: skip
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
      what the next step would gain if the residual were linear. `max_steps`: limit, those not taken
      included.
    - `loss`: a robust loss such as `Huber()` in place of squares, or `None`.

    **Returns** a `Fit`. **Raises** `TypeError`, `ValueError` if `start` is not a mapping from names to
    unknowns or positive numbers, or if another number is not positive. The residual is traced at every
    call, and compiled where its program is a new one. Works under `jit` and `vmap`; the estimate is
    not differentiated, because that would take second derivatives of the motion.
    """
    return _solve(LevenbergMarquardt(damping, tolerance, max_steps, loss), residual, start)


@check_arguments(residual=callable_as("f(values)", {}))
def gradient_descent(
    residual: Callable[[NamedValues], Any],
    start: NamedUnknowns,
    *,
    optimiser: Given["optax.GradientTransformation | None"] = None,
    steps: int = 300,
    tolerance: float = 0.1,
) -> Fit:
    r"""Minimise $\tfrac12\|r(p)\|^2$ by an optimiser of optax, in the coordinates of the unknowns.

    For noise in the objective, schedules and constraints of your own; `least_squares` takes far fewer
    runs. The gradient is $J^T r$ with the Jacobian by forward mode through all events.

    **Arguments:** `residual`, `start` as for `least_squares`; `optimiser`, by default Adam with a rate
    that falls from 0.03 to 0 along a cosine; `steps`, how many; `tolerance`: a fit is successful if the
    minimum is nearer than this, in standard errors, by the linearised problem. **Returns** the best
    `Fit` on the way. **Raises** as `least_squares`, and `TypeError` if `optimiser` is not an
    `optax.GradientTransformation`.
    """
    return _solve(GradientDescent(optimiser, steps, tolerance), residual, start)


def _solve(method: AbstractIterativeMethod, residual: Any, start: Any) -> Fit:
    space, values = scalars("start", start)
    return solve_residual(method, residual, space, space.coordinates(values))
