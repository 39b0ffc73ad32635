"""DC motors by their voltage, as the drive of an elastic CoreXY."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
from jaxtyping import PyTree

from stickslip.checks import Given, Numeric, check_callable

from .._arguments import the_machine
from .._motors import motor_torque
from .._parameters import CoreXYParameters


class DCMotors(eqx.Module):
    r"""Two DC motors, $\tau_i = \frac{K_t}{R}(u_i - K_e\dot\theta_i)$, without inductance.

    In the loop of a sampled controller, whose output is the pair of voltages, it is a servo drive:
    `DCMotors(lambda t, args: args.output, parameters)` in the machine of a
    `stickslip.control.WithController`.

    **Arguments:** `voltages(t, args)`: those of both motors [V], by the time [s] and what a run is
    given; `parameters`: `CoreXYParameters`, of which `R`, `K_t` and `K_e` are used. **Raises**
    `TypeError` naming the argument.
    """

    voltages: Callable
    parameters: CoreXYParameters

    def __init__(self, voltages: Given[Callable], parameters: Given[CoreXYParameters]):
        self.voltages = check_callable("voltages", voltages, "voltages(t, args)", 0.0, None)
        self.parameters = the_machine(parameters, "parameters")

    def __call__(self, t: Numeric, angles: tuple, speeds: tuple, args: PyTree) -> tuple[Any, Any]:
        """Torques of both motors [N m]."""
        first, second = self.voltages(t, args)
        p = self.parameters
        return motor_torque(p, first, speeds[0]), motor_torque(p, second, speeds[1])
