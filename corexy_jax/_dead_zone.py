r"""The dead zone of the mechanism: a zonotope of motor torques and its image in the voltages.

Wrong arguments raise `ValueError` or `TypeError`.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip.checks import Numeric
from stickslip.contact import zonotope_vertices

from ._arguments import finite, the_machine
from ._contacts import MOTOR_1, MOTOR_2, U, W, X, Y, contact_loads
from ._motors import voltage_for_torque
from ._parameters import CoreXYParameters

# Sliding speed of x, y, x + y, x - y by the line speeds of two rolling motors.
_BY_MOTORS = np.array([[0.5, 0.5], [0.5, -0.5], [1.0, 0.0], [0.0, 1.0]])


def torque_dead_zone(p: CoreXYParameters) -> Float[Array, "8 2"]:
    r"""Corners of the dead zone in the plane of motor torques $(\tau_1, \tau_2)$ [N m].

    $$Z = \Bigl\{r \sum_c \lambda_c n_c : |\lambda_c| \le \mu_s N_c\Bigr\}$$

    over the six ground contacts, both motors rolling: the torques under which the machine at rest
    stays so as long as its belts hold. Counterclockwise, a zonotope with four edges and their
    mirror images; along one axis it is Eq. (30).
    """
    the_machine(p)
    loads = contact_loads(p)
    limits = [
        p.mu_s * p.r * n
        for n in (loads[X], loads[Y], loads[U] + loads[MOTOR_1], loads[W] + loads[MOTOR_2])
    ]
    return zonotope_vertices(jnp.asarray(_BY_MOTORS), jnp.stack(limits))


def voltage_dead_zone(p: CoreXYParameters) -> Float[Array, "8 2"]:
    r"""The same corners in the plane $(v_1, v_2)$ [V]: $v = R\tau/K_t$ at rest, Eq. (3)."""
    the_machine(p)
    return voltage_for_torque(p, torque_dead_zone(p), 0.0)


def motor_dead_zone(p: CoreXYParameters) -> tuple[Any, Any]:
    r"""Greatest static torque $2\mu_s P_i r_f$ of the ground on each motor pulley [N m].

    The voltages that the paper's figures 5, 8 and 11 call the mapped dead zone of motor i are
    $\pm R/K_t$ times it.
    """
    the_machine(p)
    return 2.0 * p.mu_s * p.P1 * p.r_f, 2.0 * p.mu_s * p.P2 * p.r_f


def axis_dead_zones(p: CoreXYParameters, rolls_1: Numeric, rolls_2: Numeric) -> tuple[Any, Any]:
    """Bounds of the dead zones along x and y [N m] with motors rolling (1.0) or slipping (0.0): static
    friction of every ground contact that moves with the axis, as in figures 4b, 7b and 10b."""
    the_machine(p)
    rolls_1, rolls_2 = finite(rolls_1=rolls_1, rolls_2=rolls_2)
    n = [p.mu_s * p.r * load for load in contact_loads(p)]
    both = n[U] + n[W] + rolls_1 * n[MOTOR_1] + rolls_2 * n[MOTOR_2]
    return n[X] + both, n[Y] + both
