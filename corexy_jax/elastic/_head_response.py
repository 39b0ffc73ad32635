"""Speed of the head in small motions about a place, with exact steps of belts and dry friction."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._contacts import NORMALS, contact_loads, line_masses
from .._parameters import CoreXYParameters
from ._belts import Belts
from ._resonances import STRETCH
from ._stepper import Stepper

FIELD = np.array([0.0, 0.0, 1.0, 1.0])  # the coordinates that the field of a motor pulls at
TRAVELS = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])  # coordinates by (x, y)


def head_speeds(
    p: CoreXYParameters, belts: Belts, place: Any, motor: Stepper, command: Array, h: Any
) -> Float[Array, "step 2"]:
    r"""Speed of the collar [m/s] along `x` and `y` at times $nh$, from rest.

    In $u = q - q^c$, the coordinates relative to a machine that follows its command rigidly,

    $$M\ddot u + D\dot u + Ku = -M\ddot q^c - D_m\dot q^c - \sum_c n_c F_c\,\mathrm{Sign}(n_c\dot q)$$

    with $K$ of `resonances`, $D = \tau K_{belts} + D_m$. Steps of the linear part are exact for a
    command of constant acceleration within each; between them the impulses of kinetic friction act, not
    above $hF_c$, such that the mean of the speeds before and after has the sign of the force, or is 0
    (J. J. Moreau, 1988, with the rule of the midpoint). No span may become slack.

    What a motor at a larger lag has less than its stiffness says is one more impulse.

    **Arguments:** `place`: `x`, `y` [m]; `motor`, whose path and detent are not used; `command`: speeds
    `[step, 2]` [m/s] at the times; `h` [s].
    """
    mass = jnp.stack([jnp.asarray(m, jnp.float64) for m in line_masses(p)])
    holding, damping = (a / motor.r**2 * jnp.asarray(FIELD) for a in (motor.stiffness, motor.damping))
    grip = jnp.asarray(STRETCH)
    elastic = grip.T @ (jnp.stack(belts.stiffness(*place))[:, None] * grip)
    rates = jnp.zeros((12, 12)).at[:4, 4:8].set(jnp.eye(4)).at[4:8, 8:].set(jnp.eye(4))
    rates = rates.at[4:8, :4].set(-(elastic + jnp.diag(holding)) / mass[:, None])
    rates = rates.at[4:8, 4:8].set(-(belts.retardation * elastic + jnp.diag(damping)) / mass[:, None])
    step_of = jax.scipy.linalg.expm(h * rates)
    rigid = command @ jnp.asarray(TRAVELS.T)
    pushed = -(rigid[1:] - rigid[:-1]) / h - 0.5 * (rigid[1:] + rigid[:-1]) * (damping / mass)[None]
    limits = [h * p.mu_k * load for load in contact_loads(p)[:6]]

    def step(state, row):
        z, held = state
        free, ahead = row
        z = step_of[:8, :8] @ z + free
        turn = motor.periods * z[2:4] / motor.r
        weaker = motor.torque / motor.r * (turn - jnp.sin(turn))
        before = z[4:] + ahead + jnp.concatenate([jnp.zeros(2), h * weaker / mass[2:]])
        mean, held = _rubbed(before, held, 2.0 * mass, limits)
        after = 2.0 * mean - before
        return (jnp.concatenate([z[:4], after - ahead]), held), mean[:2]

    still = jnp.zeros(8), (jnp.zeros(()),) * 4
    _, speeds = jax.lax.scan(step, still, (pushed @ step_of[:8, 8:].T, rigid[1:]))
    return jnp.concatenate([jnp.zeros((1, 2)), speeds])


def _rubbed(v: Array, held: tuple, mass: Array, limits: list) -> tuple[Array, tuple]:
    """Speeds of masses after the impulses of friction, and these impulses [N s] of the contacts of the
    collar, from those of the step before on: it hangs at four, so that they are found in turn."""
    motors = [
        jnp.sign(v[k]) * jnp.maximum(jnp.abs(v[k]) - limits[2 + k] / mass[k], 0.0) for k in (2, 3)
    ]
    found = list(held)
    x = v[0] - sum(n * a for n, a in zip(NORMALS[:4, 0], held, strict=True)) / mass[0]
    y = v[1] - sum(n * a for n, a in zip(NORMALS[:4, 1], held, strict=True)) / mass[1]
    for _ in range(4):
        for i, (along, across, *_) in enumerate(NORMALS[:4]):
            give = along**2 / mass[0] + across**2 / mass[1]
            wanted = found[i] + (along * x + across * y) / give
            more = jnp.clip(wanted, -limits[i], limits[i]) - found[i]
            found[i] = found[i] + more
            x, y = x - along * more / mass[0], y - across * more / mass[1]
    return jnp.stack([x, y, *motors]), tuple(found)
