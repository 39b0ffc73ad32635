"""A PID controller whose integrator is reset."""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, instance, number
from .._types import Given, Numeric, Whole
from .._validation import as_parameter
from ._pid import PID, Integral


class Reset(NamedTuple):
    """State of a `ResetPID`: the integral, and the error at the last sample."""

    integral: Any
    error: Any


class ResetPID(eqx.Module):
    """A `PID` whose integral is multiplied by `factor` where the error has changed its sign.

    Against hunting: what the integral has gathered to break away pushes in the wrong direction behind
    the set point. The factor is -1 by default, which holds the friction on the other side; 0 is Clegg's
    integrator. `state()`: both 0. **Errors** `ValueError`, `TypeError` naming the argument.

    ??? cite "Reference"

        R. Beerens et al., *Reset PID design for motion systems with Stribeck friction*, IEEE
        Transactions on Control Systems Technology, 2021, doi 10.1109/TCST.2021.3063420.
    """

    pid: PID
    factor: Float[Array, "..."]

    @check_arguments(pid=instance(PID, "a PID"), factor=number())
    def __init__(self, pid: Given[PID], factor: Numeric = -1.0):
        self.pid, self.factor = pid, as_parameter(factor)

    @property
    def period(self) -> Float[Array, "..."]:
        """The sample time [s]."""
        return self.pid.period

    def state(self) -> Reset:
        """The state before the first sample."""
        return Reset(0.0, 0.0)

    def __call__(self, k: Whole, t: Numeric, measured: PyTree, state: Reset, args: PyTree) -> tuple:
        """Output and state at sample `k`."""
        error = self.pid.reference(t, args)[0] - measured[0]
        integral = jnp.where(error * state.error < 0.0, self.factor, 1.0) * state.integral
        output, after = self.pid(k, t, measured, Integral(integral), args)
        return output, Reset(after.integral, error)
