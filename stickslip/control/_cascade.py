"""A position loop around a velocity loop."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from .._argument_checks import number, parameters
from .._types import Given, Numeric
from ._pid import Integral, Winding, as_reference, winding


class Cascade(eqx.Module):
    r"""A proportional position loop around a velocity loop with integral action, of one sample time.

    $$w = \dot r + k_x (r - x), \qquad I \leftarrow I + k_i T_s (w - v), \qquad u = k_v (w - v) + I$$

    of the measured pair $(x, v)$; limit and winding up as of a `PID`.

    - `k_position` [1/s], `k_velocity`, `k_integral`: gains; the others as of a `PID`.

    `Cascade.state()`: the integral, 0. **Errors** `ValueError`, `TypeError` naming the argument.
    """

    k_position: Float[Array, "..."]
    k_velocity: Float[Array, "..."]
    k_integral: Float[Array, "..."]
    winding: Winding
    reference: Callable

    @parameters(k_position=number(), k_velocity=number(), k_integral=number())
    def __init__(
        self,
        k_position: Numeric,
        k_velocity: Numeric,
        k_integral: Numeric,
        *,
        period: Numeric,
        reference: Any = 0.0,
        limit: Given[Numeric | None] = None,
        tracking_time: Given[Numeric | None] = None,
    ):
        self.winding = winding(period, limit, tracking_time)
        self.reference = as_reference(reference)

    @property
    def period(self) -> Float[Array, "..."]:
        """The sample time $T_s$ [s]."""
        return self.winding.period

    @staticmethod
    def state() -> Integral:
        """The state before the first sample."""
        return Integral(0.0)

    def __call__(self, k: Any, t: Any, measured: Any, state: Integral, args: Any) -> tuple:
        """Output and state at sample `k`."""
        x, v = measured
        position, velocity = self.reference(t, args)
        slow = velocity + self.k_position * (position - x) - v
        rest, growth = self.k_velocity * slow, self.k_integral * slow
        output, integral = self.winding.output(rest, growth, state.integral)
        return output, Integral(integral)
