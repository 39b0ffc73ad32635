"""A position loop around a velocity loop."""

from collections.abc import Callable

from jaxtyping import Array, Float

from .._argument_checks import number, parameters
from .._types import Given, Numeric
from ._pid import AbstractIntegrating, Winding, as_reference, winding


class Cascade(AbstractIntegrating):
    r"""A proportional position loop around a velocity loop with integral action, of one sample time.

    $$w = \dot r + k_x (r - x), \qquad I \leftarrow I + k_i T_s (w - v), \qquad u = k_v (w - v) + I$$

    of the measured pair $(x, v)$; limit and winding up as of a `PID`.

    - `k_position` [1/s], `k_velocity`, `k_integral`: gains; the others as of a `PID`.

    `state()`: the integral, 0. **Errors** `ValueError`, `TypeError` naming the argument.
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
        reference: Given[Numeric | Callable] = 0.0,
        limit: Given[Numeric | None] = None,
        tracking_time: Given[Numeric | None] = None,
    ):
        self.winding = winding(period, limit, tracking_time)
        self.reference = as_reference(reference)

    def _parts(self, error, velocity, v):
        slow = velocity + self.k_position * error - v
        return self.k_velocity * slow, self.k_integral * slow
