"""Frequencies and shapes of the vibrations of an elastic CoreXY, in closed form."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip.checks import Given, Numeric, check_nonnegative, check_type

from .._arguments import finite, the_machine
from .._contacts import line_masses
from .._parameters import CoreXYParameters
from ._belts import Belts

# Stretch of the belts by the coordinates x, y, and the lengths that the motors have taken in.
STRETCH = np.array([[-1.0, -1.0, 1.0, 0.0], [-1.0, 1.0, 0.0, 1.0]])


class Resonances(NamedTuple):
    """Small vibrations about a position, by rising frequency; batch axes in front.

    - `frequencies` [Hz]: four; those of rigid motions, and of motors that are held, are 0.
    - `damping`: part of the critical one, 0 where the frequency is.
    - `shapes`: one row for each, `x`, `y` and both lengths of belt line; the kinetic energy of a
      row is 1/2.
    """

    frequencies: Float[Array, "*batch mode"]
    damping: Float[Array, "*batch mode"]
    shapes: Float[Array, "*batch mode coordinate"]


def resonances(
    parameters: Given[CoreXYParameters],
    belts: Given[Belts],
    x: Numeric = 0.0,
    y: Numeric = 0.0,
    holding: Numeric = 0.0,
) -> Resonances:
    r"""Solutions of $\det(K - \omega^2 M) = 0$ at a position, without friction and slack.

    $$K = k_1 g_1g_1^T + k_2 g_2g_2^T + \frac{k_\theta}{r^2}\,\mathrm{diag}(0, 0, 1, 1), \qquad
      g_1 = (-1, -1, 1, 0),\ g_2 = (-1, 1, 0, 1)$$

    **Arguments**

    - `parameters`, `belts` of an `ElasticCoreXY`; `x`, `y`: the position [m], numbers or arrays that
      broadcast: a map of the bed.
    - `holding` $k_\theta$ [N m/rad]: stiffness of the motors against their command, of a stepper
      `Stepper.stiffness`; 0: motors without current; infinite: motors that do not turn.

    **Returns** `Resonances`. **Raises** `TypeError`, `ValueError` naming the argument.
    """
    p = the_machine(parameters, "parameters")
    check_type("belts", belts, Belts, "Belts")
    x, y = (jnp.asarray(a, jnp.float64) for a in finite(x=x, y=y))
    holding = jnp.asarray(check_nonnegative("holding", holding, infinite=True), jnp.float64)
    x, y, holding = jnp.broadcast_arrays(x, y, holding)
    mass = line_masses(p)
    free = jnp.isfinite(holding)
    turning = jnp.where(free, 1.0 / mass.one, 0.0)
    inverse = jnp.stack(
        [jnp.full_like(x, 1.0 / mass.x), jnp.full_like(x, 1.0 / mass.y), turning, turning], -1
    )
    held = jnp.where(free, holding, 0.0) / p.r**2
    nothing = jnp.zeros_like(held)
    springs = jnp.stack([nothing, nothing, held, held], -1)[..., None, :] * jnp.eye(4)
    k = jnp.stack([jnp.broadcast_to(a, x.shape) for a in belts.stiffness(x, y)], -1)
    elastic = jnp.einsum("...i,ij,ik->...jk", k, STRETCH, STRETCH)
    root = jnp.sqrt(inverse)
    both = root[..., :, None] * root[..., None, :]
    squares, columns = jnp.linalg.eigh(both * (elastic + springs))
    # Those of rigid motions are rounding.
    least = 1e-12 * squares[..., -1:]
    omega = jnp.sqrt(jnp.where(squares > least, squares, 0.0))
    rows = jnp.swapaxes(columns, -1, -2)
    loss = jnp.einsum("...ij,...jk,...ik->...i", rows, both * elastic, rows) * belts.retardation
    moving = omega > 0.0
    damping = jnp.where(moving, 0.5 * loss / jnp.where(moving, omega, 1.0), 0.0)
    return Resonances(omega / (2.0 * jnp.pi), damping, rows * root[..., None, :])
