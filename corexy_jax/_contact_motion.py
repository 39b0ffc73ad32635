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

import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where

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
    line_force,
)

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
ALONG = LINES @ NORMALS.T  # [line, contact]: sliding speed of the contact as the line is travelled
FREE = 1e30  # reserve of a line that no resting contact resists [N]


class ContactMotion(NamedTuple):
    """Motion while each contact rests or slides in a known sense.

    - `acceleration`: of the four line velocities [m/s²].
    - `reaction`: `M a - F`, force of all resting contacts together [N]; unique even where the
      single forces are not.
    """

    acceleration: Line
    reaction: Line


def contact_motion(
    mass: Line, drive: tuple[Any, Any], friction: tuple[Any, ...], rest: tuple[Any, ...]
) -> ContactMotion:
    """Acceleration and reaction while the contacts in `rest` hold.

    **Arguments:** `mass` [kg]; `drive`, forces of the motors on the belt line [N]; `friction`, forces
    on the contacts along their speeds [N], besides the reaction sought; `rest`, booleans, closed in
    the sense of `closure`.
    """
    force = line_force(friction)
    force = force._replace(one=force.one + drive[0], two=force.two + drive[1])
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
    determinant = m_xx * m_yy - m_xy * m_xy
    tied = rest[X] | rest[Y] | rest[U] | rest[W]
    ax = where(tied, on_line * e_x, (m_yy * f_x - m_xy * f_y) / determinant)
    ay = where(tied, on_line * e_y, (m_xx * f_y - m_xy * f_x) / determinant)
    alone_1 = where(rest[MOTOR_1], 0.0, force.one / mass.one)
    alone_2 = where(rest[MOTOR_2], 0.0, force.two / mass.two)
    a = Line(ax, ay, where(rest[BELT_1], ax + ay, alone_1), where(rest[BELT_2], ax - ay, alone_2))
    reaction = Line(*(m * b - f for m, b, f in zip(mass, a, force, strict=True)))
    return ContactMotion(a, reaction)


class Onset(NamedTuple):
    """The line along which the resting contacts are next to give way.

    - `share`: part of the friction along it that is used up; beyond 1 the contacts cannot hold. -1
      where no contact rests. Unlike the reserve it does not jump where another line comes first.
    - `reserve`: friction left along it [N].
    - `number` of the line in `LINES`, `sense` (1 or -1) in which it would be travelled.
    """

    share: Any
    reserve: Any
    number: Any
    sense: Any


def onset(limits: tuple[Any, ...], rest: tuple[Any, ...], reaction: Line) -> Onset:
    """How far the contacts in `rest` with the static limits [N] are from giving way, and where.

    Of the lines that cannot hold, the one that is overloaded most in proportion to its resistance:
    it spans a facet of the set of forces that hold, sums of such lines do not.
    """
    held = [where(r, limit, 0.0) for r, limit in zip(rest, limits, strict=True)]
    resistances, loads, resists = [], [], []
    for line, along in zip(LINES, ALONG, strict=True):
        once = [held[c] for c in range(NUM_CONTACTS) if abs(along[c]) == 1.0]
        twice = [held[c] for c in range(NUM_CONTACTS) if abs(along[c]) == 2.0]
        total = sum(once[1:], once[0]) if once else None
        if twice:
            both = 2.0 * sum(twice[1:], twice[0])
            total = both if total is None else total + both
        resistances.append(total)
        felt = [rest[c] for c in range(NUM_CONTACTS) if along[c]]
        some = felt[0]
        for r in felt[1:]:
            some = some | r
        resists.append(some)
        terms = [
            f if d == 1 else (-f if d == -1 else float(d) * f)
            for d, f in zip(line, reaction, strict=True)
            if d
        ]
        loads.append(sum(terms[1:], terms[0]))
    tiny = 1e-200
    used, reserve = jnp.full_like(reaction.x, -1.0), jnp.full_like(reaction.x, FREE)
    number, load = jnp.zeros_like(rest[0], jnp.int32), reaction.x
    for i in range(len(LINES)):
        share = where(resists[i], jnp.abs(loads[i]) / (resistances[i] + tiny), -1.0)
        more = share > used
        used = where(more, share, used)
        reserve = where(more, resistances[i] - jnp.abs(loads[i]), reserve)
        number = where(more, jnp.int32(i), number)
        load = where(more, loads[i], load)
    return Onset(used, reserve, number, where(load > 0.0, -1.0, 1.0))


def onset_signs(signs: tuple[Any, ...], giving_way: Onset) -> tuple[Any, ...]:
    """Senses right after the contacts at rest gave way along a line."""
    along = jnp.asarray(np.sign(ALONG))[giving_way.number]
    return tuple(where(s == 0.0, giving_way.sense * along[c], s) for c, s in enumerate(signs))
