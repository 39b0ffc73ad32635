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
AROUND = NORMALS[:4, :2]  # contacts of the collar by (x, y)
LINES = np.stack([-AROUND[:, 1], AROUND[:, 0]], axis=1)  # along which they stick
_TURNS = np.pi * (np.arange(8) + 0.5) / 4.0
SECTORS = np.sign(np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1) @ AROUND.T)
TRAVELS = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])  # coordinates by (x, y)


def head_speeds(
    p: CoreXYParameters, belts: Belts, place: Any, motor: Stepper, command: Array, h: Any
) -> Float[Array, "step 2"]:
    r"""Speed of the collar [m/s] along `x` and `y` at times $nh$, from rest.

    In $u = q - q^c$, the coordinates relative to a machine that follows its command rigidly,

    $$M\ddot u + D\dot u + Ku = -M\ddot q^c - D_m\dot q^c - \sum_c n_c F_c\,\mathrm{Sign}(n_c\dot q)$$

    with $K$ of `resonances`, $D = \tau K_{belts} + D_m$. Steps of the linear part are exact for a
    command of constant acceleration and for the friction of the step before; the rest of friction acts
    as if all else accelerated the masses evenly within the step, with its stops, starts and reversals
    where they are (`_slid`): of second order in `h`, also through them. No span may become slack.

    What a motor at a larger lag has less than by its stiffness acts as the mean of both ends of a step.

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
    loads = jnp.stack([jnp.asarray(load, jnp.float64) for load in contact_loads(p)[:6]])
    # Two planes: that of the collar with its four contacts, and that of both motors with one each.
    limits = p.mu_k * jnp.stack([loads[:4], jnp.concatenate([loads[4:], jnp.zeros(2)])])
    planes, slid = (2, 2), jax.vmap(_slid, (0, 0, 0, 0, None))

    def weaker(z):
        turn = motor.periods * z[2:4] / motor.r
        less = motor.torque / motor.r * (turn - jnp.sin(turn))
        return jnp.concatenate([jnp.zeros(2), less / mass[2:]])

    def step(carry, row):
        z, v, rubs = carry
        free, ahead = row
        new = step_of[:8, :8] @ z + step_of[:8, 8:] @ rubs + free
        less = 0.5 * h * (weaker(z) + weaker(new))
        even = new[4:] + ahead + less
        pull = (even - v) / h - rubs
        w, way = slid(v.reshape(planes), pull.reshape(planes), mass.reshape(planes), limits, h)
        w, way = w.reshape(4), way.reshape(4)
        moved = new[:4] + way - 0.5 * h * (v + even - less)
        return (jnp.concatenate([moved, w - ahead]), w, (w - v) / h - pull), w[:2]

    start = jnp.zeros(8), rigid[0], jnp.zeros(4)
    _, speeds = jax.lax.scan(step, start, (pushed @ step_of[:8, 8:].T, rigid[1:]))
    return jnp.concatenate([jnp.zeros((1, 2)), speeds])


def _slid(v: Array, pull: Array, mass: Array, limits: Array, h: Any) -> tuple[Array, Array]:
    """Speeds of a plane after `h` and the way until then [m] under an even `pull` [m/s²] and friction,
    evenly accelerated from one line of a contact to the next."""
    rests = _rate(pull, mass, limits)
    give = jnp.sum(AROUND**2 / mass[None], axis=1)

    def further(carry):
        left, v, way = carry
        slips = _slips(v)
        still = (slips == 0.0) & (limits > 0.0)
        rubbed = pull - jnp.sum((jnp.sign(slips) * limits)[:, None] * AROUND, axis=0) / mass
        # On one line: along it, or off to a side.
        across = _slips(rubbed)
        stays = still & (jnp.abs(across) <= limits * give)
        along = jnp.sum(LINES * (mass * rubbed)[None], axis=1) / jnp.sum(LINES**2 * mass[None], axis=1)
        off = rubbed[None] - (jnp.sign(across) * limits)[:, None] * AROUND / mass[None]
        on = jnp.where(stays[:, None], along[:, None] * LINES, jnp.where(still[:, None], off, 0.0))
        rate = jnp.where(jnp.any(still), jnp.sum(on, axis=0), rubbed)
        rate = jnp.where(jnp.all(v == 0.0), rests, rate)
        slows = _slips(rate)
        stops = (slips * slows < 0.0) & (limits > 0.0)
        times = jnp.where(stops, -slips / jnp.where(stops, slows, 1.0), jnp.inf)
        first = (times == jnp.min(times)) & (times < left)
        lasts = jnp.minimum(jnp.min(times), left)
        way, new = way + lasts * (v + 0.5 * lasts * rate), v + lasts * rate
        # On the line to the last digit, by which the next round knows it; from one line to another it
        # is at rest.
        along = jnp.sum(LINES * new[None], axis=1) / jnp.sum(LINES**2, axis=1)
        onto = jnp.sum(jnp.where(first[:, None], along[:, None] * LINES, 0.0), axis=0)
        v = jnp.where(jnp.any(first), jnp.where(jnp.any(stays), 0.0, onto), new)
        return left - lasts, v, way

    start = jnp.asarray(h, jnp.float64), v, jnp.zeros(2)
    _, v, way = jax.lax.while_loop(lambda carry: carry[0] > 0.0, further, start)
    return v, way


def _slips(v: Array) -> Array:
    return jnp.asarray(AROUND[:, 0]) * v[0] + jnp.asarray(AROUND[:, 1]) * v[1]


def _rate(pull: Array, mass: Array, limits: Array) -> Array:
    r"""Acceleration from rest under a `pull` [m/s²] and friction of at most `limits` [N].

    It minimises $\tfrac12\sum_j m_j(a_j - p_j)^2 + \sum_c L_c|n_ca|$. In each of the eight sectors
    between the lines that is smooth, and along each line it is known where it is least; of these twelve
    places the least is the answer. (Contact by contact, in turn, converges slowly where they nearly
    hold.)
    """
    within = pull[None] - SECTORS @ (limits[:, None] * AROUND / mass[None])
    along = LINES @ (mass * pull)
    along = jnp.sign(along) * jnp.maximum(jnp.abs(along) - np.abs(LINES @ AROUND.T) @ limits, 0.0)
    places = jnp.concatenate([within, (along / (LINES**2 @ mass))[:, None] * LINES])
    costs = 0.5 * (places - pull[None]) ** 2 @ mass + jnp.abs(places @ AROUND.T) @ limits
    return places[jnp.argmin(costs)]
