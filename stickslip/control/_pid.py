"""PID control, with a limit and an integrator that does not wind up."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._argument_checks import number, parameters
from .._types import Given, Numeric, Whole
from .._validation import as_parameter, one_number
from ._trees import as_tree, pair_of


class Integral(NamedTuple):
    """State of a controller with one integrator: its share of the output [unit of the output]."""

    integral: Any


def as_reference(reference: Any) -> Any:
    """A reference as `reference(t, args) -> (position, velocity)`, of a number too."""
    if not callable(reference):
        return SetPoint(reference)
    return as_tree("reference", reference, "reference(t, args) -> (position, velocity)", 0.0, None)


class SetPoint(eqx.Module):
    """A `reference` that is a number: it rests there."""

    reference: Float[Array, "..."]

    @parameters(reference=number())
    def __init__(self, reference: Numeric): ...

    def __call__(self, t: Numeric, args: PyTree) -> tuple[Any, Any]:
        """Position and velocity at time `t` [s]."""
        return self.reference, 0.0


class Winding(eqx.Module):
    """How an integrator grows, and how it is kept from growing where the output is limited.

    Without `tracking_time` it does not grow further into the limit (clamping); with one, the excess of
    the output takes it back, in this time [s] (back-calculation).
    """

    period: Float[Array, "..."]
    limit: Float[Array, "..."] | None = None
    tracking_time: Float[Array, "..."] | None = None

    def output(self, rest: Any, growth: Any, integral: Any) -> tuple[Any, Any]:
        """Output and integral; `rest`: the output without the integral, `growth` of it per second."""
        wound = integral + self.period * growth
        free = rest + wound
        if self.limit is None:
            return free, wound
        output = jnp.clip(free, -self.limit, self.limit)
        if self.tracking_time is not None:
            return output, wound + self.period / self.tracking_time * (output - free)
        wound = jnp.where((free != output) & (growth * free > 0.0), integral, wound)
        return jnp.clip(rest + wound, -self.limit, self.limit), wound


class PID(eqx.Module):
    r"""Proportional, integral and derivative action, sampled, with a limit and without winding up.

    At every sample, with $e = r - x$ of the measured pair $(x, v)$:

    $$I \leftarrow I + K_i T_s e, \qquad u = K_p e + I + K_d(\dot r - v)$$

    Where $|u|$ would exceed `limit`, it is the limit, and $I$ does not grow further into it (clamping),
    or, with a `tracking_time` $T_t$, $I \leftarrow I + (u - u_{free})\,T_s/T_t$ (back-calculation).

    - `kp`, `ki`, `kd`: gains, by units of the output and of $x$; `period` $T_s$ [s].
    - `reference`: a number, or a function `reference(t, args) -> (position, velocity)`.
    - `limit`: of the output, positive, in its unit; None: none. `tracking_time` [s], positive.

    `state()`: the integral, 0. **Errors** `ValueError`, `TypeError` naming the argument.

    ??? cite "Reference"

        K. J. Åström and T. Hägglund, *Advanced PID Control*, ISA, 2006, section 3.5.
    """

    kp: Float[Array, "..."]
    ki: Float[Array, "..."]
    kd: Float[Array, "..."]
    winding: Winding
    reference: Callable

    @parameters(kp=number(), ki=number(), kd=number())
    def __init__(
        self,
        kp: Numeric,
        ki: Numeric,
        kd: Numeric,
        *,
        period: Numeric,
        reference: Given[Numeric | Callable] = 0.0,
        limit: Given[Numeric | None] = None,
        tracking_time: Given[Numeric | None] = None,
    ):
        optional = [
            None if value is None else as_parameter(one_number(name, value, "positive"))
            for name, value in (("limit", limit), ("tracking_time", tracking_time))
        ]
        self.winding = Winding(as_parameter(one_number("period", period, "positive")), *optional)
        self.reference = as_reference(reference)

    @property
    def period(self) -> Float[Array, "..."]:
        """The sample time $T_s$ [s]."""
        return self.winding.period

    def state(self) -> Integral:
        """The state before the first sample."""
        return Integral(0.0)

    def __call__(self, k: Whole, t: Numeric, measured: PyTree, state: Integral, args: PyTree) -> tuple:
        """Output and state at sample `k`."""
        x, v = pair_of(measured)
        position, velocity = self.reference(t, args)
        return answer(self, position - x, velocity - v, state)


def answer(pid: PID, error: Any, rate: Any, state: Integral) -> tuple:
    """Output and state of the controller behind an error, and its rate."""
    rest = pid.kp * error + pid.kd * rate
    output, integral = pid.winding.output(rest, pid.ki * error, state.integral)
    return output, Integral(integral)
