"""Levenberg-Marquardt, from the parts that optimistix offers."""

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import optimistix as optx

from .._argument_checks import check_arguments, number
from .._types import Numeric
from ._gauss_newton import SETTINGS, AbstractGaussNewton, descent_step, sensitivities
from ._losses import AbstractLoss

REGION = optx.ClassicalTrustRegion(high_cutoff=0.75, high_constant=5.0)


@check_arguments(damping=number("positive"), **SETTINGS)
class LevenbergMarquardt(AbstractGaussNewton):
    """Levenberg-Marquardt: the damped descent and the trust region of optimistix, step by step.

    **Arguments:** `damping`, `tolerance`, `max_steps` as for `least_squares`; `loss`, a robust loss
    such as `Huber()`, or `None`. **Raises** `TypeError`, `ValueError` for anything else.
    """

    damping: Numeric = 1.0
    tolerance: float = eqx.field(static=True, default=1e-8)
    max_steps: int = 64
    loss: AbstractLoss | None = None
    _search: ClassVar = REGION

    def _sizes(self, matrix, bend):
        return sensitivities(matrix, bend)

    def _limited_step(self, size, full, y, rows, whole):
        return damped_step(size / self.damping, full, y, rows, whole)


def damped_step(size: Any, full: Any, y: Any, rows: Any, whole: Any) -> tuple[Any, Any]:
    """The step within the trust region of this size, which begins with 1."""
    # It waits for the full one: two batched factorisations side by side block each other for ever
    # where XLA has two threads, each holding one and waiting for help with its batch.
    return descent_step(size, y, rows, whole + 0.0 * jnp.sum(full))
