"""Robust losses: outliers pull less than their square."""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from .._argument_checks import check_arguments, instance, or_none, reals, static_number
from .._types import Numeric


class AbstractLoss(eqx.Module):
    r"""A loss $\rho(r)$ in place of $r^2$, as a weight on residuals: $\rho(r) = (w(r)\,r)^2$.

    The function minimised is $\tfrac12\sum\rho(r_i)$; priors keep their squares.
    """

    @abc.abstractmethod
    def weight(self, residual: Numeric) -> Any:
        """$w$ of residuals in standard deviations."""


loss_or_none = or_none(instance(AbstractLoss, "a loss such as Huber(), or None"))


@check_arguments(corner=static_number("positive"))
class Huber(AbstractLoss):
    r"""$\rho = r^2$ up to the `corner` $c$, $2c|r| - c^2$ beyond, in standard deviations.

    **Raises** `ValueError`, `TypeError` for a `corner` that is not a positive number of Python.

    Source: P. J. Huber, "Robust estimation of a location parameter", Ann. Math. Statist. 35, 1964.
    """

    corner: float = eqx.field(static=True, default=1.345)

    @check_arguments(residual=reals)
    def weight(self, residual: Numeric) -> Any:
        size = jnp.abs(residual)
        far = size > self.corner
        safe = jnp.where(far, size, 1.0)
        beyond = jnp.sqrt(2.0 * self.corner * safe - self.corner**2) / safe
        return jnp.where(far, jnp.where(far, beyond, 1.0), 1.0)


@check_arguments(corner=static_number("positive"))
class SoftL1(AbstractLoss):
    r"""$\rho = 2c^2(\sqrt{1 + (r/c)^2} - 1)$ with the `corner` $c$: smooth everywhere.

    **Raises** `ValueError`, `TypeError` for a `corner` that is not a positive number of Python.
    """

    corner: float = eqx.field(static=True, default=1.0)

    @check_arguments(residual=reals)
    def weight(self, residual: Numeric) -> Any:
        return jnp.sqrt(2.0 / (1.0 + jnp.hypot(1.0, jnp.asarray(residual) / self.corner)))
