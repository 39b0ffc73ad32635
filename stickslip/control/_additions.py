"""Additions to a controller: friction to come, disturbances as observed, a hold of first order."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from .._argument_checks import parameters
from .._types import Given, Numeric, Whole
from ._pid import as_reference
from ._trees import UPDATE, as_tree
from ._with_controller import Ramp


class FrictionFeedforward(eqx.Module):
    r"""A controller and the friction of its motion, $u = u_c + F(w)$.

    - `controller`: a `PID` or the like; `state()` is its own, and a limit is that of its part alone.
    - `friction(w)`: force at a speed, such as `Regularised(law, v_reg).mu`.
    - `reference(t, args) -> (position, velocity)`: $w$ is its velocity. None: $w$ is the second number
      measured; at rest that pushes nothing.
    """

    controller: Callable
    friction: Callable
    reference: Callable | None

    def __init__(
        self, controller: Callable, friction: Callable, reference: Given[Callable | None] = None
    ):
        self.controller = as_tree("controller", controller, UPDATE, *range(5))
        self.friction = as_tree("friction", friction, "friction(w)", 0.0)
        self.reference = None if reference is None else as_reference(reference)

    @property
    def period(self) -> Any:
        """The sample time of the controller [s]; None where it says none."""
        return getattr(self.controller, "period", None)

    def state(self) -> Any:
        """The state of the controller before the first sample."""
        return self.controller.state()

    def __call__(self, k: Whole, t: Numeric, measured: PyTree, state: PyTree, args: PyTree) -> tuple:
        """Output and state at sample `k`."""
        output, state = self.controller(k, t, measured, state, args)
        speed = measured[1] if self.reference is None else self.reference(t, args)[1]
        return output + self.friction(speed), state


class Observed(NamedTuple):
    """State of a `DisturbanceObserver`: that of the controller, the observer's, the last output."""

    controller: Any
    observer: Any
    output: Any


class DisturbanceObserver(eqx.Module):
    r"""A controller, less the disturbance that its observer sees: $u = u_c - \hat d$.

    Of a nominal axis $m \dot v = u + d$ with measured $v$, sampled:
    $p \leftarrow p - T_s L (u + p + L m v)$ and $\hat d = p + L m v$, at the rate $L$ behind $d$.

    - `controller`: a `PID` or the like; `mass` $m$ [kg], `bandwidth` $L$ [1/s], `period` $T_s$ [s]:
      positive. A limit of the controller is that of its part alone.

    `state()`: before the first sample, of an axis at rest; with that of the controller.
    """

    controller: Callable
    mass: Float[Array, "..."]
    bandwidth: Float[Array, "..."]
    period: Float[Array, "..."]

    @parameters(mass="positive", bandwidth="positive", period="positive")
    def __init__(self, controller: Callable, mass: Numeric, bandwidth: Numeric, *, period: Numeric):
        self.controller = as_tree("controller", controller, UPDATE, *range(5))

    def state(self) -> Observed:
        """The state before the first sample."""
        return Observed(self.controller.state(), 0.0, 0.0)

    def __call__(self, k: Whole, t: Numeric, measured: PyTree, state: Observed, args: PyTree) -> tuple:
        """Output and state at sample `k`."""
        momentum = self.bandwidth * self.mass * measured[1]
        seen = state.observer + momentum
        output, inner = self.controller(k, t, measured, state.controller, args)
        output = output - seen
        observer = state.observer - self.period * self.bandwidth * (output + seen)
        return output, Observed(inner, observer, output)


class Extrapolated(NamedTuple):
    """State of a `FirstOrderHold`: that of the controller, and its last output."""

    controller: Any
    output: Any


class FirstOrderHold(eqx.Module):
    r"""A controller whose output goes on along the line through its last two.

    $$u(t) = u_k + \frac{t - t_k}{T_s}(u_k - u_{k-1})$$

    from where $u_k$ acts until the next one does; before the first one $u$ is zero.

    - `controller`: a `PID` or the like, of one number; a limit is that of $u_k$. `period` $T_s$ [s].

    `state()`: before the first sample; with that of the controller.

    ??? cite "Reference"

        G. F. Franklin, J. D. Powell and M. Workman, *Digital Control of Dynamic Systems*, 1998.
    """

    controller: Callable
    period: Float[Array, "..."]

    @parameters(period="positive")
    def __init__(self, controller: Callable, *, period: Numeric):
        self.controller = as_tree("controller", controller, UPDATE, *range(5))

    def state(self) -> Extrapolated:
        """The state before the first sample."""
        return Extrapolated(self.controller.state(), 0.0)

    def __call__(
        self, k: Whole, t: Numeric, measured: PyTree, state: Extrapolated, args: PyTree
    ) -> tuple:
        """Output and state at sample `k`."""
        output, inner = self.controller(k, t, measured, state.controller, args)
        return Ramp(output, (output - state.output) / self.period), Extrapolated(inner, output)
