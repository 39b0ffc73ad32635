"""How much of a slow motion is lost where it turns back, in closed form."""

from typing import Any

import jax.numpy as jnp

from stickslip.checks import Given, Numeric, check_between, check_type

from .._arguments import finite, the_machine
from .._contacts import MOTOR_1, MOTOR_2, U, W, X, Y, contact_loads
from .._parameters import CoreXYParameters
from ._belts import Belts


def lost_motion(
    parameters: Given[CoreXYParameters],
    belts: Given[Belts],
    x: Numeric = 0.0,
    y: Numeric = 0.0,
    holding: Numeric = jnp.inf,
) -> tuple[Any, Any]:
    r"""Command [m] that is lost where a slow motion along `x`, or along `y`, turns back.

    The head stays, while the motors unwind what friction had stretched and wind it up the other way;
    printers show it as backlash. With the changes $\Delta_i$ of the pulls of both belts, which are in
    balance with twice the friction that moves with the head, $\Delta_1 + \Delta_2 = 2R$, and the
    other axis and its command at rest,

    $$\ell = \frac12\sum_i \left(\Delta_i\Bigl(\frac1{k_i} + \frac{r^2}{k_\theta}\Bigr)
      + 2R_i\frac{r^2}{k_\theta}\right), \qquad
      a_1\Delta_1 - a_2\Delta_2 = 2(R_2 - R_1)\frac{r^2}{k_\theta}$$

    with $a_i = 1/k_i + r^2/k_\theta$ and the friction $R_i$ of the motor pulleys. Exact to the order of
    $R/EA$ for equal static and kinetic friction; otherwise what breaks loose counts with half of
    either, and the motors, which turn all the time, with the kinetic one.

    **Arguments**

    - `parameters`, `belts` of an `ElasticCoreXY` with Coulomb friction; `x`, `y`: the position [m],
      numbers or arrays that broadcast: a map of the bed.
    - `holding` $k_\theta$ [N m/rad]: stiffness of the motors against their command, not negative;
      infinite: motors that follow exactly.

    **Returns** a number along `x` and one along `y`; NaN where the other axis would give way too, and
    of motors that hold nothing.
    **Raises** `TypeError`, `ValueError` naming the argument.
    """
    p = the_machine(parameters, "parameters")
    check_type("belts", belts, Belts, "Belts")
    x, y = finite(x=x, y=y)
    check_between("holding", holding, 0, jnp.inf)
    motor = p.r**2 / jnp.asarray(holding, jnp.float64)
    give_1, give_2 = (1.0 / k + motor for k in belts.stiffness(x, y))
    loads = contact_loads(p)
    loose = (p.mu_k + jnp.maximum(p.mu_s, p.mu_k),) * 4
    # Of what moves with the head: from sliding one way to breaking loose the other way.
    along_x, along_y, one, two = (mu * loads[i] for mu, i in zip(loose, (X, Y, U, W), strict=True))
    wound_1, wound_2 = (2.0 * p.mu_k * loads[i] * motor for i in (MOTOR_1, MOTOR_2))

    def lost(own: Any, other: Any) -> Any:
        all_of_it = own + one + two
        first = (give_2 * all_of_it - (wound_1 - wound_2)) / (give_1 + give_2)
        second = all_of_it - first
        holds = jnp.abs(first - second - (one - two)) <= other
        way = 0.5 * (give_1 * first + give_2 * second + wound_1 + wound_2)
        return jnp.where(holds, way, jnp.nan)

    return lost(along_x, along_y), lost(along_y, along_x)
