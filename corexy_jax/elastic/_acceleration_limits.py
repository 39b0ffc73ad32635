"""Accelerations at which the head rings too much, a span becomes slack or a motor lacks torque."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from stickslip.checks import Given, Numeric, Row, check_between, check_positive, check_type, one_number
from stickslip.control import InputShaper

from .._arguments import finite, the_machine, unit_row
from .._contacts import Line, kinetic_limits, line_force, line_masses, sliding_speeds
from .._parameters import CoreXYParameters
from ._belts import Belts
from ._head_response import TRAVELS
from ._resonances import STRETCH, resonances


class AccelerationLimits(NamedTuple):
    """Accelerations [m/s²] up to which the head rings no more, no span is slack, torque suffices."""

    ringing: Any
    slack: Any
    torque: Any


def acceleration_limits(
    parameters: Given[CoreXYParameters],
    belts: Given[Belts],
    x: Numeric = 0.0,
    y: Numeric = 0.0,
    *,
    direction: Row,
    tolerance: Numeric,
    holding: Numeric = jnp.inf,
    torque: Numeric = jnp.inf,
    shaper: Given[InputShaper | None] = None,
) -> AccelerationLimits:
    r"""Limits of a jump of the commanded acceleration, from 0 to $a$ or $-a$, at a position.

    Behind a command along the unit row $d$ the machine moves by $M\ddot z + C\dot z + Kz = -MGd\,a$
    with $Gd = (d_x, d_y, d_x + d_y, d_x - d_y)$: each mode $\phi_k$ of `resonances` about
    $c_ka = \phi_kMGd\,a/\omega_k^2$, on the way up to $P_kc_ka$, in the end with the amplitude
    $V_kc_ka$; $P_k = 1 + V_k$ and $V_k\sqrt{1 - \zeta_k^2} = 1$, or `peak` and `residual` of a shaper.

    - `ringing`: `tolerance` by the greatest $|\sum_k \pm V_kc_k\phi_k|_{xy}$; friction is left out.
    - `slack`: where the $P_kc_k$ that stretch a belt one way, and friction, take the tension of a span.
    - `torque`: where they, and the inertia of rotors that follow exactly, take that of a motor.

    Exact for one mode without damping; otherwise on the safe side, unless strong damping couples modes.
    Friction is kinetic, and twice, as a machine that starts meets it suddenly. What earlier jumps have
    left comes on top; one from $-a$ to $a$ rings twice as much.

    **Arguments**

    - `parameters`, `belts` of an `ElasticCoreXY`; `x`, `y` [m]: the position. It and `tolerance`,
      `holding`, `torque` are numbers or arrays that broadcast: a map of the bed.
    - `direction` $d$: a row of any length but 0. `tolerance` [m], positive: amplitude of the head.
    - `holding` [N m/rad], not negative: stiffness of the motors against their command; infinite: they
      follow exactly. `torque` [N m], not negative: that of a motor. `shaper` of the command.

    **Returns** `AccelerationLimits`; 0 where friction alone takes all, NaN of motors that hold nothing
    and beyond the critical damping. **Raises** `TypeError`, `ValueError` naming the argument.
    """
    p = the_machine(parameters, "parameters")
    check_type("belts", belts, Belts, "Belts")
    finite(x=x, y=y)
    along = jnp.asarray(unit_row("direction", direction))
    check_positive("tolerance", tolerance)
    check_between("holding", holding, 0, jnp.inf)
    check_between("torque", torque, 0, jnp.inf)
    check_type("shaper", shaper, InputShaper | None, "an InputShaper or None")
    if shaper is not None:
        own = (one_number(f"shaper.{name}", getattr(shaper, name)) for name in ("omega", "damping"))
        shaper = InputShaper(0.0, shaper.kind, *own)
    given = (jnp.asarray(a, jnp.float64) for a in (x, y, tolerance, holding, torque))
    return AccelerationLimits(*_limits(p, belts, shaper, along, *given))


@jax.jit
@functools.partial(jnp.vectorize, excluded={0, 1, 2, 3}, signature="(),(),(),(),()->(),(),()")
def _limits(p, belts, shaper, along, x, y, tolerance, holding, torque) -> tuple:
    """The limits at one position."""
    frequencies, damping, shapes = resonances(p, belts, x, y, holding)
    omega, free, bounded = 2.0 * jnp.pi * frequencies, jnp.isfinite(holding), jnp.isfinite(torque)
    rings, mass, rigid = omega > 0.0, jnp.stack(line_masses(p)), jnp.asarray(TRAVELS) @ along
    lag = shapes @ (mass * rigid) / jnp.where(rings, omega, 1.0) ** 2
    behind = (shapes * jnp.where(rings, lag, jnp.where(free, jnp.nan, 0.0))[:, None]).T
    root = jnp.sqrt(1.0 - damping**2)
    left, peak = jnp.ones(4), 1.0 + 1.0 / root
    if shaper is not None:
        left, peak = shaper.residual(omega, damping), shaper.peak(omega, damping)
    # Of all phases that modes may have.
    signs = 1.0 - 2.0 * (np.arange(16) >> np.arange(4)[:, None] & 1)
    swings = (behind[:2] * (left / root)[None]) @ signs
    pull = -jnp.stack(belts.stiffness(x, y))[:, None] * (jnp.asarray(STRETCH) @ behind)
    slides = zip(kinetic_limits(p)[:6], sliding_speeds(Line(*rigid))[:6], strict=True)
    rub = line_force((*(most * jnp.sign(speed) for most, speed in slides), 0.0, 0.0))
    drawn, own = jnp.stack([rub.x + rub.y, rub.x - rub.y]), jnp.stack([rub.one, rub.two])
    short, long = jnp.sort(jnp.stack(belts.frame.lengths(x, y)).reshape(2, 2)).T
    room = jnp.stack([p.P1, p.P2]) * (1.0 + short / long) - jnp.abs(drawn)
    has = jnp.where(bounded, torque, 1.0) / p.r - jnp.abs(drawn + 2.0 * own)
    field = jnp.where(free, jnp.where(free, holding, 0.0) / p.r**2 * behind[2:], pull)
    rotors = jnp.where(free, 0.0, mass * rigid)[2:, None]
    most = _most(has, jnp.concatenate([field * peak[None], rotors], axis=1))
    ringing = tolerance / jnp.sqrt(jnp.max(jnp.sum(swings**2, axis=0)))
    return ringing, _most(room, pull * peak[None]), jnp.where(bounded, most, jnp.inf)


def _most(room: Any, parts: Any) -> Any:
    """Acceleration at which parts of one sign take the room of either belt or motor."""
    peaks = (jnp.sum(jnp.maximum(sign * parts, 0.0), axis=1) for sign in (1.0, -1.0))
    return jnp.maximum(jnp.min(room / jnp.maximum(*peaks)), 0.0)
