r"""The four dynamic models DMN1-4, Eqs. (35)-(71).

$$M^\sigma [\ddot x, \ddot y]^T = b^\sigma + \tau^\sigma.$$

Rows are force times radius [N m], as printed. The signs that errata A1 and A2 correct are arguments.

Wrong arguments raise `ValueError` or `TypeError`.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip.checks import Numeric, Whole, check_positive, check_type

from ._arguments import dmn_number, finite, named, pair, the_errata, the_machine
from ._errata import Errata
from ._kinematics import PassivePulleys
from ._parameters import CoreXYParameters


class FrictionForces(NamedTuple):
    r"""Friction on every part, each in the positive sense of that part's own motion.

    - `f_x`, `f_y` [N]: rails. `pulleys` [N m]: torques $\tau_i^j$ on the passive pulleys.
    - `tau_1_0`, `tau_2_0` [N m]: ground on the motor pulleys.
    - `f_1_b`, `f_2_b` [N]: force of a belt on its slipping motor pulley, Eqs. (31)-(32); 0 rolling.
    """

    f_x: Any
    f_y: Any
    pulleys: PassivePulleys
    tau_1_0: Any
    tau_2_0: Any
    f_1_b: Any
    f_2_b: Any


class DynamicModel(NamedTuple):
    """Matrix `M` [kg m], friction `b` and drive `tau` [N m] of Eq. (35)."""

    M: Float[Array, "2 2"]
    b: Float[Array, "2"]
    tau: Float[Array, "2"]


class Inertia(NamedTuple):
    """Entries of the symmetric matrix M [kg m]."""

    x: Any
    y: Any
    coupling: Any


def inertia(p: CoreXYParameters, rolling_1: Any, rolling_2: Any) -> Inertia:
    """Matrix of (38), (47), (56), (65); `rolling` is 1 for a motor that rolls, else 0."""
    motors = (rolling_1 + rolling_2) * p.J / p.r
    coupling = (rolling_1 - rolling_2) * p.J / p.r
    m_x = p.m * p.r + 8.0 * p.J_passive / p.r + motors
    m_y = (p.M + p.m) * p.r + 4.0 * p.J_passive / p.r + motors
    return Inertia(m_x, m_y, coupling)


def _matrix(p, rolling_1, rolling_2):
    m = inertia(p, rolling_1, rolling_2)
    return jnp.stack([jnp.stack([m.x, m.coupling]), jnp.stack([m.coupling, m.y])])


def _friction(p, f: FrictionForces, errata, rolling_1, rolling_2):
    return jnp.stack(friction_rows(p, f, errata, rolling_1, rolling_2))


def friction_rows(
    p: CoreXYParameters, f: FrictionForces, errata: Errata, rolling_1: Any, rolling_2: Any
) -> tuple[Any, Any]:
    """Rows of b [N m], Eqs. (39), (48), (57), (66)."""
    t, one, two = f.pulleys, rolling_1 * f.tau_1_0, rolling_2 * f.tau_2_0
    outer = t.theta_1_1 + t.theta_2_1
    outer = -outer if errata.A1 else outer
    inner_1, inner_2 = t.theta_1_2 + t.theta_1_3, t.theta_2_2 + t.theta_2_3
    # What does not depend on rolling comes first, so that it is computed once for several models.
    b_x = inner_1 + inner_2 + t.theta_1_4 + t.theta_2_4
    b_y = inner_1 - inner_2
    return b_x + outer + f.f_x * p.r + (one + two), b_y + f.f_y * p.r + (one - two)


def belt_torque(p: CoreXYParameters, force: Any, errata: Errata) -> Any:
    """Torque [N m] that a slipping pulley feeds into its belt, which presses on it with `force`."""
    return (-force if errata.A2 else force) * p.r


def _drive(one, two):
    return jnp.stack([one + two, one - two])


def _check(p, f, torques, errata) -> tuple[Any, Any]:
    the_machine(p)
    named("f", f, FrictionForces)
    check_type("errata", errata, Errata, "an Errata")
    return pair("torques", torques, scalar=True)


def dmn_1(
    p: CoreXYParameters, f: FrictionForces, torques: tuple[Any, Any], errata: Errata
) -> DynamicModel:
    """RR, both motors roll: Eqs. (38)-(40). `torques`: those of the motors [N m]."""
    torques = _check(p, f, torques, errata)
    return DynamicModel(_matrix(p, 1, 1), _friction(p, f, errata, 1, 1), _drive(*torques))


def dmn_2(
    p: CoreXYParameters, f: FrictionForces, torques: tuple[Any, Any], errata: Errata
) -> DynamicModel:
    """SR, motor 1 slips, motor 2 rolls: Eqs. (47)-(49)."""
    torques = _check(p, f, torques, errata)
    drive = _drive(belt_torque(p, f.f_1_b, errata), torques[1])
    return DynamicModel(_matrix(p, 0, 1), _friction(p, f, errata, 0, 1), drive)


def dmn_3(
    p: CoreXYParameters, f: FrictionForces, torques: tuple[Any, Any], errata: Errata
) -> DynamicModel:
    """RS, motor 1 rolls, motor 2 slips: Eqs. (56)-(58)."""
    torques = _check(p, f, torques, errata)
    drive = _drive(torques[0], belt_torque(p, f.f_2_b, errata))
    return DynamicModel(_matrix(p, 1, 0), _friction(p, f, errata, 1, 0), drive)


def dmn_4(
    p: CoreXYParameters, f: FrictionForces, torques: tuple[Any, Any], errata: Errata
) -> DynamicModel:
    """SS, both motors slip: Eqs. (65)-(67)."""
    torques = _check(p, f, torques, errata)
    drive = _drive(belt_torque(p, f.f_1_b, errata), belt_torque(p, f.f_2_b, errata))
    return DynamicModel(_matrix(p, 0, 0), _friction(p, f, errata, 0, 0), drive)


def dynamic_model(
    number: Whole,
    p: CoreXYParameters,
    f: FrictionForces,
    torques: tuple[Any, Any],
    errata: Errata | None = None,
) -> DynamicModel:
    """Dynamic model of the given number, 1 RR, 2 SR, 3 RS, 4 SS, by `lax.switch`.

    All models are as printed unless `errata` says otherwise (A1, A2).
    """
    errata = the_errata(errata)
    torques = _check(p, f, torques, errata)
    dmn_number("number", number)
    branches = [
        lambda p, f, torques, model=model: model(p, f, torques, errata)
        for model in (dmn_1, dmn_2, dmn_3, dmn_4)
    ]
    index = jnp.clip(jnp.asarray(number, jnp.int32) - 1, 0, 3)
    operands = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), (p, f, tuple(torques)))
    return jax.lax.switch(index, branches, *operands)


def slipping_motor(p: CoreXYParameters, torque: Numeric, tau_0: Numeric, f_b: Numeric) -> Any:
    r"""Acceleration of a slipping motor pulley [rad/s²], $J\alpha = \tau^0 + \tau^E + f^b r$, Eqs.
    (50), (60), (68), (69); (60) prints $f_{2k}^E$ (erratum A10)."""
    the_machine(p)
    torque, tau_0, f_b = finite(torque=torque, tau_0=tau_0, f_b=f_b)
    return (tau_0 + torque + f_b * p.r) / p.J


def rolling_motors(ax: Numeric, ay: Numeric, r: Numeric) -> tuple[Any, Any]:
    """Accelerations of rolling motor pulleys [rad/s²], Eqs. (41), (42), (51), (59), (75), (76)."""
    check_positive("r", r)
    ax, ay, r = finite(ax=ax, ay=ay, r=r)
    return (ax + ay) / r, (ax - ay) / r


def solve(m: Inertia, x: Any, y: Any) -> tuple[Any, Any]:
    """Accelerations of x and y [m/s²] under the row torques `x`, `y` [N m]."""
    determinant = m.x * m.y - m.coupling * m.coupling
    return (m.y * x - m.coupling * y) / determinant, (m.x * y - m.coupling * x) / determinant
