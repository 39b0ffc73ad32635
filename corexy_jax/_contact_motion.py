r"""Motion of the machine while each contact rests or slides in a known sense, in closed form.

Within a mode the acceleration is that of Gauss' principle with the resting contacts as constraints.
They leave the carriage two freedoms, one along a line, or none; and each motor pulley turns with its
belt, or alone, or stands. So no more than pairs of equations have to be solved.
"""

import jax
import jax.numpy as jnp
import numpy as np

from stickslip.fastmath import where

from ._contacts import BELT_1, BELT_2, MOTOR_1, MOTOR_2, NUM_CONTACTS, Line, U, W, X, Y

NumberRow = tuple | jax.Array  # numbers side by side, as `AbstractMechanism.motion_together` has them


def contact_motion(mass: Line, force: NumberRow, rest: NumberRow) -> tuple[NumberRow, NumberRow]:
    """Acceleration [m/s²] of the line velocities, and force of all resting contacts together [N].

    **Arguments:** `mass` [kg]; `force` on each velocity [N], besides the reaction sought; `rest`,
    whether each contact rests, with all contacts that the others hold.
    """
    if not isinstance(rest, tuple):
        return _by_tables(mass, jnp.asarray(force), rest)
    force = Line(*force)
    # A rolling motor belongs to the carriage, Eqs. (38), (47), (56), (65).
    roll_1, roll_2 = where(rest[BELT_1], mass.one, 0.0), where(rest[BELT_2], mass.two, 0.0)
    pull_1 = where(rest[BELT_1], force.one, 0.0)
    pull_2 = where(rest[BELT_2], force.two, 0.0)
    rolling, m_xy = roll_1 + roll_2, roll_1 - roll_2
    m_xx, m_yy = mass.x + rolling, mass.y + rolling
    f_x, f_y = force.x + (pull_1 + pull_2), force.y + (pull_1 - pull_2)
    # On a line the carriage has one coordinate: (ax, ay) = s (e_x, e_y).
    e_x = where(rest[X], 0.0, 1.0)
    e_y = where(rest[Y], 0.0, where(rest[U], -1.0, 1.0))
    stopped = where(rest[X] & rest[Y], 1.0, 0.0)  # keeps the quotient finite where both are zero
    m_line = e_x * e_x * m_xx + e_y * e_y * m_yy + 2.0 * e_x * e_y * m_xy + stopped
    on_line = (e_x * f_x + e_y * f_y) / m_line
    inverse = 1.0 / (m_xx * m_yy - m_xy * m_xy)
    tied = rest[X] | rest[Y] | rest[U] | rest[W]
    ax = where(tied, on_line * e_x, (m_yy * f_x - m_xy * f_y) * inverse)
    ay = where(tied, on_line * e_y, (m_xx * f_y - m_xy * f_x) * inverse)
    alone_1 = where(rest[MOTOR_1], 0.0, force.one * (1.0 / mass.one))
    alone_2 = where(rest[MOTOR_2], 0.0, force.two * (1.0 / mass.two))
    a = Line(ax, ay, where(rest[BELT_1], ax + ay, alone_1), where(rest[BELT_2], ax - ay, alone_2))
    return tuple(a), tuple(m * b - f for m, b, f in zip(mass, a, force, strict=True))


def _by_tables(mass: Line, force: jax.Array, rest: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The same for one machine: the freedoms come from a table, no number is computed in two places.

    The freedoms are pairs, the two of the carriage and the two motors that turn alone; each is found
    from the two by two equations of its pair.
    """
    masses = jnp.stack(mass)
    bits = 2 ** np.arange(NUM_CONTACTS, dtype=np.int32)
    here = jnp.sum(rest.astype(jnp.int32) * bits, dtype=jnp.int32)
    found = jnp.asarray(_TABLE)[here]
    inertias = jnp.sum(found[:12].reshape(3, 4, 4) * masses[None, None, :], axis=-1)
    own, others, mixed = (inertias + found[12:15])[:, :, None]
    freedoms, partners = found[15:19], found[19:]
    # All but the force stays what it is while the mode does, and is computed outside of the stages.
    mobility = (others * freedoms - mixed * partners) / (own * others - mixed * mixed)
    rates = jnp.sum(mobility * force[None, :], axis=1)
    acceleration = jnp.sum(freedoms * rates[:, None], axis=0)
    return acceleration, masses * acceleration - force


def _freedoms(rest: np.ndarray) -> np.ndarray:
    """Directions [freedom, velocity] in which the machine can move, zero where there are fewer."""
    found = np.zeros((4, 4))
    if not (rest[X] or rest[Y] or rest[U] or rest[W]):
        found[0, 0] = found[1, 1] = 1.0
    elif not (rest[X] and rest[Y]):
        found[0, :2] = 0.0 if rest[X] else 1.0, 0.0 if rest[Y] else (-1.0 if rest[U] else 1.0)
    for motor, belt, of_belt, turn in ((2, BELT_1, MOTOR_1, [1, 1]), (3, BELT_2, MOTOR_2, [1, -1])):
        if rest[belt]:
            found[:2, motor] = found[:2, :2] @ turn
        elif not rest[of_belt]:
            found[motor, motor] = 1.0
    return found


SETS = (np.arange(2**NUM_CONTACTS)[:, None] >> np.arange(NUM_CONTACTS)) % 2 == 1  # [set, contact]
_OWN = np.stack([_freedoms(rest) for rest in SETS])  # [set, freedom, velocity]
_PARTNER = _OWN[:, [1, 0, 3, 2]]
_FREEDOMS = np.stack([_OWN, _PARTNER], axis=1)
_INERTIAS = np.stack([_OWN**2, _PARTNER**2, _OWN * _PARTNER], axis=1)
# A freedom that is absent has the inertia 1 and feels no force.
_ABSENT = np.all(_INERTIAS == 0.0, axis=-1) * np.array([1.0, 1.0, 0.0])[:, None]
# One table, one look-up: [set, row, velocity or freedom].
_TABLE = np.concatenate([_INERTIAS.reshape(-1, 12, 4), _ABSENT, _FREEDOMS.reshape(-1, 8, 4)], axis=1)
_TABLE.flags.writeable = False
