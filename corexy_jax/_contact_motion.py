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

from stickslip.fastmath import where

from ._contacts import (
    BELT_1,
    BELT_2,
    MOTOR_1,
    MOTOR_2,
    NORMALS,
    SETS,
    Line,
    U,
    W,
    X,
    Y,
    line_force,
    set_number,
)
from ._rows import Row, any_through, each, first_greatest, row, through

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
NO_SHARE = -1.0  # share of such a line


class ContactMotion(NamedTuple):
    """Motion while each contact rests or slides in a known sense; each four numbers, as in `Line`.

    - `acceleration`: of the four line velocities [m/s²].
    - `reaction`: `M a - F`, force of all resting contacts together [N]; unique even where the
      single forces are not.
    """

    acceleration: Line | Row
    reaction: Line | Row


def contact_motion(mass: Line, drive: tuple[Any, Any], friction: Row, rest: Row) -> ContactMotion:
    """Acceleration and reaction while the contacts in `rest` hold.

    **Arguments:** `mass` [kg]; `drive`, forces of the motors on the belt line [N]; `friction`, forces
    on the contacts along their speeds [N], besides the reaction sought; `rest`, booleans, closed in
    the sense of `closure`.
    """
    if not isinstance(row(rest), tuple):
        return _by_tables(mass, drive, row(friction), row(rest))
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


def _by_tables(mass: Line, drive: tuple[Any, Any], friction: Row, rest: Row) -> ContactMotion:
    """The same for one machine: the freedoms come from a table, no number is computed in two places.

    The freedoms are pairs, the two of the carriage and the two motors that turn alone; each is found
    from the two by two equations of its pair.
    """
    masses, zero = row(mass), jnp.zeros_like(drive[0])
    force = through(NORMALS.T, friction) + row((zero, zero, *drive))
    here = set_number(rest)
    inertias = jnp.sum(jnp.asarray(_INERTIAS)[here] * masses[None, None, :], axis=-1)
    own, others, mixed = (inertias + jnp.asarray(_ABSENT)[here])[:, :, None]
    freedoms, partners = jnp.asarray(_FREEDOMS)[here]
    # All but the force stays what it is while the mode does, and is computed outside of the stages.
    mobility = (others * freedoms - mixed * partners) / (own * others - mixed * mixed)
    rates = jnp.sum(mobility * force[None, :], axis=1)
    acceleration = jnp.sum(freedoms * rates[:, None], axis=0)
    return ContactMotion(acceleration, masses * acceleration - force)


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


_OWN = np.stack([_freedoms(rest) for rest in SETS])  # [set, freedom, velocity]
_PARTNER = _OWN[:, [1, 0, 3, 2]]
_FREEDOMS = np.stack([_OWN, _PARTNER], axis=1)
_INERTIAS = np.stack([_OWN**2, _PARTNER**2, _OWN * _PARTNER], axis=1)
# A freedom that is absent has the inertia 1 and feels no force.
_ABSENT = np.all(_INERTIAS == 0.0, axis=-1) * np.array([1.0, 1.0, 0.0])[:, None]


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


def onset(limits: Row, rest: Row, reaction: Line | Row) -> Onset:
    """How far the contacts in `rest` with the static limits [N] are from giving way, and where.

    Of the lines that cannot hold, the one that is overloaded most in proportion to its resistance:
    it spans a facet of the set of forces that hold, sums of such lines do not.
    """
    rest = row(rest)
    held = each(lambda r, limit: where(r, limit, 0.0), rest, row(limits))
    resistances, loads = through(np.abs(ALONG), held), through(LINES, row(reaction))
    tiny = 1e-150  # its square is a number too, which derivatives divide by
    shares = each(
        lambda some, load, most: where(some, jnp.abs(load) / (most + tiny), NO_SHARE),
        any_through(ALONG, rest), loads, resistances,
    )  # fmt: skip
    reserves = each(lambda most, load: most - jnp.abs(load), resistances, loads)
    used, number, reserve, load = first_greatest(shares, NO_SHARE, reserves, loads)
    reserve = where(used > NO_SHARE, reserve, FREE)
    return Onset(used, reserve, number, where(load > 0.0, -1.0, 1.0))


def onset_signs(signs: Row, giving_way: Onset) -> Row:
    """Directions right after the contacts at rest gave way along a line."""
    along, sense = jnp.asarray(np.sign(ALONG))[giving_way.number], giving_way.sense
    signs = row(signs)
    if isinstance(signs, tuple):
        along = tuple(along[c] for c in range(len(signs)))
    return each(lambda s, d: where(s == 0.0, sense * d, s), signs, along)
