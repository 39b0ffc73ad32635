r"""The eight dry contacts of the machine: sliding speeds, loads, friction.

All quantities are those of the belt line: speeds in m/s, forces in N. A motor pulley has the line
speed $r\omega_i$; a friction torque $\mu N r_f$ on a pulley is the line force $\mu N r_f/r$. In the
velocities $q = (\dot x, \dot y, r\omega_1, r\omega_2)$ the kinetic energy is
$\tfrac12\sum_j M_j q_j^2$ and contact $c$ slides with the speed $n_c\cdot q$.
"""

from typing import Any, NamedTuple

import numpy as np

from stickslip.friction import Coulomb

from ._parameters import CoreXYParameters

X, Y, U, W, MOTOR_1, MOTOR_2, BELT_1, BELT_2 = range(8)
NUM_CONTACTS = 8

# The sliding speed of each contact: dx/dt, dy/dt, those of the virtual pulleys and of the motor
# pulleys, and what the belts turn slower or faster than their motors.
DIRECTIONS = {
    "rail and pulleys along x": {"x": 1},
    "rail along y": {"y": 1},
    "pulleys along x + y": {"x": 1, "y": 1},
    "pulleys along x - y": {"x": 1, "y": -1},
    "motor pulley 1": {"one": 1},
    "motor pulley 2": {"two": 1},
    "belt 1": {"x": -1, "y": -1, "one": 1},
    "belt 2": {"x": -1, "y": 1, "two": 1},
}
CONTACT_NAMES = tuple(DIRECTIONS)


class Line(NamedTuple):
    """One number per velocity: along `x`, along `y`, motor pulley 1, motor pulley 2."""

    x: Any
    y: Any
    one: Any
    two: Any


# Rows n_c in (dx/dt, dy/dt, r omega_1, r omega_2).
NORMALS = np.array([[row.get(name, 0) for name in Line._fields] for row in DIRECTIONS.values()], float)


def line_masses(p: CoreXYParameters) -> Line:
    r"""Diagonal of the mass matrix [kg]: $m + 8J'/r^2$, $M + m + 4J'/r^2$, $J/r^2$, $J/r^2$."""
    pulley, motor = p.J_passive / p.r**2, p.J / p.r**2
    return Line(p.m + 8.0 * pulley, p.M + p.m + 4.0 * pulley, motor, motor)


def sliding_speeds(q: Line) -> tuple[Any, ...]:
    """Sliding speed [m/s] of every contact, in the order of `CONTACT_NAMES`."""
    x, y, one, two = q
    along, against = x + y, x - y
    return x, y, along, against, one, two, one - along, two - against


def contact_loads(p: CoreXYParameters) -> tuple[Any, ...]:
    r"""Load of every contact [N], arm over radius included.

    Rails $mg$, $(M+m)g$; passive pulleys $\sqrt2 P_i$ each (the belt turns by 90°), motor pulleys
    $2P_i$ on the ground and in the belt (180°). Section 2.4 of the paper.
    """
    arm = p.r_f / p.r
    passive = 2.0 * 2.0**0.5 * arm
    return (
        p.m * p.g + passive * (p.P1 + p.P2),
        (p.M + p.m) * p.g,
        passive * p.P1,
        passive * p.P2,
        2.0 * p.P1 * arm,
        2.0 * p.P2 * arm,
        2.0 * p.P1,
        2.0 * p.P2,
    )


def friction_laws(p: CoreXYParameters) -> tuple[Coulomb, ...]:
    r"""Friction of every contact: of rails and pulleys with one pair of coefficients, of each belt.

    A contact that is held by less than it would slide with cannot leave rest (Filippov's sliding
    mode), hence `Coulomb` holds it with the greater coefficient (erratum A9).
    """
    rail = Coulomb(p.mu_s, p.mu_k)
    return (rail,) * 6 + (Coulomb(p.mu_1s_b, p.mu_1k_b), Coulomb(p.mu_2s_b, p.mu_2k_b))


def kinetic_limits(p: CoreXYParameters) -> tuple[Any, ...]:
    r"""Kinetic friction $\mu_k N$ of every contact [N], Eqs. (27), (31), (32)."""
    pairs = zip(friction_laws(p), contact_loads(p), strict=True)
    return tuple(law.kinetic_limit() * load for law, load in pairs)


def static_limits(p: CoreXYParameters) -> tuple[Any, ...]:
    r"""Greatest friction at rest $\max(\mu_s, \mu_k) N$ of every contact [N], Eqs. (26), (33), (34)."""
    pairs = zip(friction_laws(p), contact_loads(p), strict=True)
    return tuple(law.static_coefficient() * load for law, load in pairs)


def line_force(forces: tuple[Any, ...]) -> Line:
    """Force on every velocity [N] from the friction force of every contact along its speed [N]."""
    x, y, along, against, one, two, belt_1, belt_2 = forces
    along, against = along - belt_1, against - belt_2
    return Line(x + along + against, y + along - against, one + belt_1, two + belt_2)
