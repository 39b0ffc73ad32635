"""The two DC motors, Eqs. (1)-(3). Wrong arguments raise `ValueError` or `TypeError`."""

from typing import Any

from stickslip.checks import Numeric

from ._arguments import finite, the_machine
from ._parameters import CoreXYParameters


def motor_current(p: CoreXYParameters, v: Numeric, omega: Numeric) -> Any:
    r"""Current $i = (v - K_e\omega)/R$ [A], Eq. (2), at voltage `v` [V] and speed `omega` [rad/s]."""
    the_machine(p)
    v, omega = finite(v=v, omega=omega)
    return (v - p.K_e * omega) / p.R


def motor_torque(p: CoreXYParameters, v: Numeric, omega: Numeric) -> Any:
    r"""Torque $\tau^E = K_t i = \frac{K_t}{R}(v - K_e\omega)$ [N m], Eqs. (1)-(3)."""
    the_machine(p)
    v, omega = finite(v=v, omega=omega)
    return p.K_t * motor_current(p, v, omega)


def voltage_for_torque(p: CoreXYParameters, torque: Numeric, omega: Numeric) -> Any:
    """Voltage [V] at which the motor gives `torque` [N m] at `omega` [rad/s]; inverse of Eq. (3)."""
    the_machine(p)
    torque, omega = finite(torque=torque, omega=omega)
    return p.R / p.K_t * torque + p.K_e * omega
