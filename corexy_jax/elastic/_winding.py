"""Windings of a stepper motor at a limited voltage: how its torque falls with the speed."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip import absolute, positive_part
from stickslip.checks import Numeric, as_parameter, check_nonnegative, check_positive

from .._arguments import finite


class Winding(eqx.Module):
    r"""Two windings in quadrature, whose driver regulates the current as long as its voltage suffices.

    In each, of the amplitudes, $U = (R + j\omega L)I + K\dot\theta$ with $\omega = N\dot\theta$, and
    $K$ is both the torque by the current and the voltage by the speed, $K = T_m/I_m$. The two give
    $K I\cos\angle(I, K\dot\theta)$, which at a voltage of amplitude $U$ is greatest where its angle is
    that of the impedance:

    $$T_U(\dot\theta) = \frac{K U}{Z} - \frac{K^2 R\,|\dot\theta|}{Z^2}, \qquad
      Z^2 = R^2 + (N L\dot\theta)^2, \qquad T = \min\left(T_m, \max(T_U, 0)\right)$$

    Up to the corner speed it is the torque $T_m$ of the regulated current. Beyond, it falls nearly as
    $1/\dot\theta$, the pull-out curve of data sheets. A motor that brakes has more, which is left out.

    **Arguments**

    - `voltage` $U$ [V]: greatest amplitude, that of the supply; `current` $I_m$ [A]: amplitude in each
      winding at standstill, positive. Data sheets give the torque of both windings with the rated
      current each, $\sqrt2$ times that of a sine of this amplitude.
    - `resistance` $R$ [ohm] of a winding, positive; `inductance` $L$ [H], not negative.

    **Raises** `TypeError`, `ValueError` naming the argument.

    ??? cite "Reference"

        P. P. Acarnley, *Stepping Motors: a guide to theory and practice*, 4th edition, IEE, 2002,
        chapter 5: the pull-out torque of a hybrid motor at high speed.
    """

    voltage: Float[Array, "..."]
    current: Float[Array, "..."]
    resistance: Float[Array, "..."]
    inductance: Float[Array, "..."]

    def __init__(self, voltage: Numeric, current: Numeric, resistance: Numeric, inductance: Numeric):
        self.voltage = as_parameter(check_positive("voltage", voltage))
        self.current = as_parameter(check_positive("current", current))
        self.resistance = as_parameter(check_positive("resistance", resistance))
        self.inductance = as_parameter(check_nonnegative("inductance", inductance))

    def pull_out(self, torque: Numeric, periods: Numeric, speed: Numeric) -> Any:
        """Greatest torque [N m] at a speed [rad/s], of a motor that has `torque` [N m] at rest and
        whose field repeats `periods` times a turn."""
        torque, periods, speed = finite(torque=torque, periods=periods, speed=speed)
        K, R = torque / self.current, self.resistance
        Z = jnp.sqrt(R**2 + (periods * self.inductance * speed) ** 2)
        limited = positive_part(K / Z * (self.voltage - K * R * absolute(speed) / Z))
        return torque - positive_part(torque - limited)
