"""First-order methods of optax on the same problem."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from .._types import Given
from .._validation import check_callable
from ._descent import GradientDescent
from ._evaluate import solved
from ._fit import Fit
from ._unknowns import NamedUnknowns, NamedValues, scalars

if TYPE_CHECKING:
    import optax


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
    method = GradientDescent(optimiser, steps, tolerance)
    check_callable("residual", residual, "f(values)", {})
    space, values = scalars("start", start)
    return solved(method, residual, space, space.coordinates(values))
