"""Fits of a residual function from one start."""

from collections.abc import Callable
from typing import Any

from .._argument_checks import callable_as, check_arguments, instance, or_none
from .._compiled_once import compiled_once
from .._types import Given
from ..progress import showing
from ._evaluate import with_operands
from ._fit import Fit
from ._gauss_newton import LevenbergMarquardt
from ._methods import AbstractIterativeMethod
from ._unknowns import NamedUnknowns, NamedValues, scalars

A_METHOD = or_none(instance(AbstractIterativeMethod, "a method such as LevenbergMarquardt(), or None"))


@check_arguments(residual=callable_as("f(values)", {}), method=A_METHOD)
@showing("least_squares")
def least_squares(
    residual: Callable[[NamedValues], Any],
    start: NamedUnknowns,
    method: Given[AbstractIterativeMethod | None] = None,
) -> Fit:
    r"""Minimise $\tfrac12\|r(p)\|^2$ over the unknowns $p$, in their unbounded coordinates.

    The Jacobian of the residuals is taken by forward mode, so that it is exact through the events of a
    simulation, and once per step.

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
    - `method`: by default `LevenbergMarquardt()`; or `GaussNewton(...)`, `GradientDescent(...)`.

    **Returns** a `Fit`. **Raises** `TypeError`, `ValueError` if `start` is not a mapping from names to
    unknowns or positive numbers, or if `method` is not one. The residual is traced at every
    call, and compiled where its program is a new one. Works under `jit` and `vmap`; the estimate is
    not differentiated, because that would take second derivatives of the motion.
    """
    used: Any = LevenbergMarquardt() if method is None else method
    space, values = scalars("start", start)
    z = space.coordinates(values)
    # Compiled once for all residuals that differ in their data only.
    consts, evaluate = with_operands(residual, space, z, used.loss)
    return compiled_once(lambda z, consts: used.solve(evaluate(consts), space, z), z, consts)
