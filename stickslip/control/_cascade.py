"""A position loop around a velocity loop."""

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, instance, number
from .._types import Given, Numeric, Whole
from .._validation import as_parameter
from ._pid import PID, Integral, answer
from ._trees import pair_of


class Cascade(eqx.Module):
    r"""A proportional position loop around a velocity loop with integral action, of one sample time.

    $$w = \dot r + k_x (r - x), \qquad I \leftarrow I + K_i T_s (w - v), \qquad u = K_p (w - v) + I$$

    of the measured pair $(x, v)$; $K_d$ is not used. `k_position` $k_x$ [1/s]; `pid`: the velocity
    loop, with the reference of the position.

    `state()`: the integral, 0. **Errors** `ValueError`, `TypeError` naming the argument.
    """

    k_position: Float[Array, "..."]
    pid: PID

    @check_arguments(k_position=number(), pid=instance(PID, "a PID"))
    def __init__(self, k_position: Numeric, pid: Given[PID]):
        self.k_position, self.pid = as_parameter(k_position), pid

    @property
    def period(self) -> Float[Array, "..."]:
        """The sample time [s]."""
        return self.pid.period

    def state(self) -> Integral:
        """The state before the first sample."""
        return self.pid.state()

    def __call__(self, k: Whole, t: Numeric, measured: PyTree, state: Integral, args: PyTree) -> tuple:
        """Output and state at sample `k`."""
        x, v = pair_of(measured)
        position, velocity = self.pid.reference(t, args)
        return answer(self.pid, velocity + self.k_position * (position - x) - v, 0.0, state)
