"""Friction of every part of the machine in the paper's terms, Eqs. (26)-(34).

Wrong arguments raise `ValueError` or `TypeError`.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from stickslip.checks import Numeric, check_nonnegative

from ._arguments import finite, named, the_machine
from ._dynamics import FrictionForces
from ._kinematics import PassivePulleys
from ._parameters import CoreXYParameters


class SlipDirections(NamedTuple):
    """Direction (-1, 0, 1) of `x`, `y`, `x + y`, `x - y` and of the motor pulleys `one`, `two`."""

    x: Any
    y: Any
    along: Any
    against: Any
    one: Any
    two: Any


def ground_friction(p: CoreXYParameters, mu: Numeric, senses: SlipDirections) -> FrictionForces:
    r"""Friction $-\mu N\,\mathrm{sign}$ of all contacts with the ground, Eqs. (26)-(27); belts 0.

    Normal forces of section 2.4: rails $mg$, $(M+m)g$; passive pulleys $\sqrt2 P_i$, motor pulleys
    $2P_i$, both at the arm `r_f`.
    """
    the_machine(p)
    check_nonnegative("mu", mu)
    (mu,) = finite(mu=mu)
    named("senses", senses, SlipDirections)
    passive_1, passive_2 = (2.0**0.5 * mu * P * p.r_f for P in (p.P1, p.P2))
    s = senses
    pulleys = PassivePulleys(
        theta_1_1=passive_1 * s.x,
        theta_1_2=-passive_1 * s.along,
        theta_1_3=-passive_1 * s.along,
        theta_1_4=-passive_1 * s.x,
        theta_2_1=passive_2 * s.x,
        theta_2_2=-passive_2 * s.against,
        theta_2_3=-passive_2 * s.against,
        theta_2_4=-passive_2 * s.x,
    )
    zero = jnp.zeros_like(p.r)
    return FrictionForces(
        f_x=-mu * p.m * p.g * s.x,
        f_y=-mu * (p.M + p.m) * p.g * s.y,
        pulleys=pulleys,
        tau_1_0=-mu * 2.0 * p.P1 * p.r_f * s.one,
        tau_2_0=-mu * 2.0 * p.P2 * p.r_f * s.two,
        f_1_b=zero,
        f_2_b=zero,
    )


def belt_friction(p: CoreXYParameters, sense_1: Numeric, sense_2: Numeric) -> tuple[Any, Any]:
    r"""Kinetic friction of the belts on the motor pulleys [N], Eqs. (31)-(32), from the senses of
    $\omega_i - \dot\theta_i^v$."""
    the_machine(p)
    sense_1, sense_2 = finite(sense_1=sense_1, sense_2=sense_2)
    return -2.0 * p.mu_1k_b * p.P1 * sense_1, -2.0 * p.mu_2k_b * p.P2 * sense_2
