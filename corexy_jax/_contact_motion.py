r"""Motion of the machine while each contact rests or slides in a known sense.

Within a mode the acceleration is that of Gauss' principle with the resting contacts as constraints;
it needs no search. The mode lasts while the reaction of the resting contacts lies in the zonotope
that their friction spans. In the arrangement of the eight planes, a facet of it is a face of one
dimension more than the mode's, and every such face contains one of the 14 lines in which all but one
degree of freedom are held (one motor pulley turns alone; the carriage moves along x, y, x + y or
x - y, each motor rolling or standing). So 14 inequalities decide, in every mode:

    |f · d| <= sum over resting contacts of R_c |n_c · d| ,   f = M a - F ,   d one of the lines
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip._fastmath import where
from stickslip.contact import resolve

from ._contacts import (
    BELT_1,
    BELT_2,
    MOTOR_1,
    MOTOR_2,
    NORMALS,
    NUM_CONTACTS,
    Line,
    U,
    W,
    X,
    Y,
    kinetic_limits,
    line_force,
    line_masses,
    static_limits,
)
from ._parameters import CoreXYParameters

LINES = np.array(
    [
        (0, 0, 1, 0),
        (0, 0, 0, 1),
        *((1, 0, one, two) for one in (0, 1) for two in (0, 1)),
        *((0, 1, one, -two) for one in (0, 1) for two in (0, 1)),
        *((1, -1, 0, two) for two in (0, 2)),
        *((1, 1, one, 0) for one in (0, 2)),
    ],
    float,
)
_ALONG = LINES @ NORMALS.T  # [line, contact]: sliding speed of the contact as the line is travelled
MAX_ROUNDS = 16  # of asking the law again at one instant
FREE = 1e30  # reserve of a line that no resting contact resists [N]


class ContactMotion(NamedTuple):
    """What follows from a state and the senses of its contacts.

    - `acceleration`: of the four line velocities [m/s²].
    - `reaction`: `M a - F`, force of all resting contacts together [N]; unique even where the
      single forces are not.
    - `friction`: force of each sliding contact along its speed [N], 0 where it rests.
    """

    acceleration: Line
    reaction: Line
    friction: tuple[Any, ...]


def kinetic_friction(p: CoreXYParameters, signs: tuple[Any, ...]) -> tuple[Any, ...]:
    """Friction of every sliding contact [N], against its sense, Eqs. (27), (31), (32)."""
    return tuple(-s * limit for s, limit in zip(signs, kinetic_limits(p), strict=True))


def contact_motion(
    p: CoreXYParameters, drive: tuple[Any, Any], signs: tuple[Any, ...]
) -> ContactMotion:
    """Acceleration and reaction under the motor torques `drive` [N m], contacts as in `signs`."""
    mass, friction = line_masses(p), kinetic_friction(p, signs)
    force = line_force(friction)
    force = force._replace(one=force.one + drive[0] / p.r, two=force.two + drive[1] / p.r)
    rest = [s == 0.0 for s in signs]
    # A rolling motor belongs to the carriage, Eqs. (38), (47), (56), (65).
    roll_1, roll_2 = (where(rest[belt], mass.one, 0.0) for belt in (BELT_1, BELT_2))
    pull_1 = where(rest[BELT_1], force.one, 0.0)
    pull_2 = where(rest[BELT_2], force.two, 0.0)
    m_xx, m_yy, m_xy = mass.x + roll_1 + roll_2, mass.y + roll_1 + roll_2, roll_1 - roll_2
    f_x, f_y = force.x + pull_1 + pull_2, force.y + pull_1 - pull_2
    determinant = m_xx * m_yy - m_xy * m_xy
    ax = (m_yy * f_x - m_xy * f_y) / determinant
    ay = (m_xx * f_y - m_xy * f_x) / determinant
    slanted_u = (f_x - f_y) / (m_xx + m_yy - 2.0 * m_xy)
    slanted_w = (f_x + f_y) / (m_xx + m_yy + 2.0 * m_xy)
    ax, ay = where(rest[U], slanted_u, ax), where(rest[U], -slanted_u, ay)
    ax, ay = where(rest[W], slanted_w, ax), where(rest[W], slanted_w, ay)
    only_x, only_y = f_x / m_xx, f_y / m_yy
    ax, ay = where(rest[Y], only_x, ax), where(rest[X], only_y, ay)
    ax, ay = where(rest[X], 0.0, ax), where(rest[Y], 0.0, ay)
    alone_1 = where(rest[MOTOR_1], 0.0, force.one / mass.one)
    alone_2 = where(rest[MOTOR_2], 0.0, force.two / mass.two)
    a = Line(ax, ay, where(rest[BELT_1], ax + ay, alone_1), where(rest[BELT_2], ax - ay, alone_2))
    reaction = Line(*(m * b - f for m, b, f in zip(mass, a, force, strict=True)))
    return ContactMotion(a, reaction, friction)


class Onset(NamedTuple):
    """The line along which the resting contacts are next to give way.

    - `reserve`: friction left along it [N]; below zero the contacts cannot hold.
    - `number` of the line in `LINES`, `sense` (1 or -1) in which it would be travelled.
    """

    reserve: Any
    number: Any
    sense: Any


def onset(p: CoreXYParameters, signs: tuple[Any, ...], reaction: Line) -> Onset:
    """How far the resting contacts are from giving way, and along which line they would."""
    rest = [s == 0.0 for s in signs]
    limits = [where(r, limit, 0.0) for r, limit in zip(rest, static_limits(p), strict=True)]
    best = Onset(jnp.full_like(reaction.x, FREE), jnp.zeros_like(rest[0], jnp.int32), reaction.x)
    for number, (line, along) in enumerate(zip(LINES, _ALONG, strict=True)):
        felt = [c for c in range(NUM_CONTACTS) if along[c]]
        resists = rest[felt[0]]
        for c in felt[1:]:
            resists = resists | rest[c]
        resistance = sum(abs(along[c]) * limits[c] for c in felt)
        load = sum(float(d) * f for d, f in zip(line, reaction, strict=True) if d)
        reserve = where(resists, resistance - jnp.abs(load), FREE)
        lower = reserve < best.reserve
        best = Onset(
            where(lower, reserve, best.reserve),
            where(lower, jnp.int32(number), best.number),
            where(lower, where(load > 0.0, -1.0, 1.0), best.sense),
        )
    return best


def onset_signs(signs: tuple[Any, ...], giving_way: Onset) -> tuple[Any, ...]:
    """Senses right after the resting contacts gave way along a line."""
    along = jnp.asarray(np.sign(_ALONG))[giving_way.number]
    return tuple(where(s == 0.0, giving_way.sense * along[c], s) for c, s in enumerate(signs))


def resolve_signs(
    p: CoreXYParameters,
    drive: tuple[Any, Any],
    signs: tuple[Any, ...],
    started: tuple[Any, ...] | None = None,
) -> tuple[Any, ...]:
    r"""Senses of all contacts an instant later: those without speed by the law of all contacts.

    What begins to slide is under kinetic friction from then on. That may make more contacts slide, or
    send one back that had only just begun, through rest and its static limit (erratum A12). So the
    law is asked again, as time stepping with steps of no length would, until the senses stay.

    **Arguments:** motor torques `drive` [N m]; `signs`, 0 for every contact at rest; `started`, which
    contacts with a sense have no speed yet.
    """
    p, drive, signs = jax.lax.stop_gradient((p, drive, signs))
    mass, normals = jnp.diag(jnp.stack(line_masses(p))), jnp.asarray(NORMALS)
    static, kinetic = jnp.stack(static_limits(p)), jnp.stack(kinetic_limits(p))
    given = jnp.stack(signs)
    forced = jnp.zeros(given.shape, bool) if started is None else jnp.stack(started)
    standing = (given == 0.0) | forced
    # At its limit without a drop of friction a contact begins with no acceleration, but it begins.
    creeping = forced & (static == kinetic)

    def ask(state):
        signs, _, count = state
        # A contact with a sense but no speed has kinetic friction ahead and static friction behind.
        bias = jnp.where(standing, 0.5 * signs * (static - kinetic), -signs * kinetic)
        limits = jnp.where(signs == 0.0, static, 0.5 * (static + kinetic))
        force = line_force(tuple(bias))
        force = jnp.stack([force.x, force.y, force.one + drive[0] / p.r, force.two + drive[1] / p.r])
        found = resolve(mass, force, normals, limits, active=standing)
        new = jnp.where(standing, jnp.sign(found.contact_acceleration), signs)
        new = jnp.where(creeping & (new == 0.0), given, new)
        return new, jnp.any(new != signs), count + 1

    def unsettled(state):
        return state[1] & (state[2] < MAX_ROUNDS)

    settled, *_ = lax.while_loop(unsettled, ask, (given, jnp.asarray(True), jnp.int32(0)))
    return tuple(settled[c] for c in range(NUM_CONTACTS))
