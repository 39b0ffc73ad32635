"""Frequencies and shapes of the vibrations of an elastic CoreXY, in closed form."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from stickslip.checks import Given, Numeric, check_between, check_type

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
    finite(x=x, y=y)
    check_between("holding", holding, 0, jnp.inf)
    given = (jnp.asarray(a, jnp.float64) for a in (x, y, holding))
    return Resonances(*_vibrations(p, belts, *given))


@jax.jit
@functools.partial(jnp.vectorize, excluded={0, 1}, signature="(),(),()->(m),(m),(m,c)")
def _vibrations(p: CoreXYParameters, belts: Belts, x: Array, y: Array, holding: Array) -> tuple:
    """Frequencies, damping and shapes at one position."""
    mass, free = line_masses(p), jnp.isfinite(holding)
    root = jnp.sqrt(1.0 / jnp.stack(mass)) * jnp.where(jnp.array([True, True, free, free]), 1.0, 0.0)
    held = jnp.where(free, holding, 0.0) / p.r**2 * jnp.array([0.0, 0.0, 1.0, 1.0])
    stretch = jnp.asarray(STRETCH) * root[None, :]
    elastic = stretch.T @ (jnp.stack(belts.stiffness(x, y))[:, None] * stretch)
    # Motors that are held have squares apart, without which their shapes would have no derivative.
    apart = jnp.where(free, 0.0, jnp.array([0.0, 0.0, -1.0, -2.0]))
    squares, columns = jnp.linalg.eigh(elastic + jnp.diag(held * root**2 + apart))
    rings = squares > 1e-12 * squares[-1]  # those of rigid motions are rounding
    omega = jnp.sqrt(jnp.where(rings, squares, 1.0))
    loss = jnp.sum(columns * (elastic @ columns), axis=0) * belts.retardation
    omega, damping = (jnp.where(rings, a, 0.0) for a in (omega, 0.5 * loss / omega))
    return omega / (2.0 * jnp.pi), damping, columns.T * root[None, :]
