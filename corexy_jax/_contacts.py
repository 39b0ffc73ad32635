r"""The eight dry contacts of the machine: sliding speeds, loads, friction.

All quantities are those of the belt line: speeds in m/s, forces in N. A motor pulley has the line
speed $r\omega_i$; a friction torque $\mu N r_f$ on a pulley is the line force $\mu N r_f/r$. In the
velocities $q = (\dot x, \dot y, r\omega_1, r\omega_2)$ the kinetic energy is
$\tfrac12\sum_j M_j q_j^2$ and contact $c$ slides with the speed $n_c\cdot q$.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from stickslip.fastmath import where

from ._parameters import CoreXYParameters
from ._rows import Row, each, row, through

CONTACT_NAMES = (
    "rail and pulleys along x",
    "rail along y",
    "pulleys along x + y",
    "pulleys along x - y",
    "motor pulley 1",
    "motor pulley 2",
    "belt 1",
    "belt 2",
)
X, Y, U, W, MOTOR_1, MOTOR_2, BELT_1, BELT_2 = range(8)
NUM_CONTACTS = 8

# Rows n_c in (dx/dt, dy/dt, r omega_1, r omega_2).
NORMALS = np.array(
    [
        [1, 0, 0, 0],
        [0, 1, 0, 0],
        [1, 1, 0, 0],
        [1, -1, 0, 0],
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [-1, -1, 1, 0],
        [-1, 1, 0, 1],
    ],
    float,
)


class Line(NamedTuple):
    """One number per velocity: along `x`, along `y`, motor pulley 1, motor pulley 2."""

    x: Any
    y: Any
    one: Any
    two: Any


def line_masses(p: CoreXYParameters) -> Line:
    r"""Diagonal of the mass matrix [kg]: $m + 8J'/r^2$, $M + m + 4J'/r^2$, $J/r^2$, $J/r^2$."""
    pulley, motor = p.J_passive / p.r**2, p.J / p.r**2
    return Line(p.m + 8.0 * pulley, p.M + p.m + 4.0 * pulley, motor, motor)


def sliding_speeds(q: Line | Row) -> Row:
    """Sliding speed [m/s] of every contact, in the order of `CONTACT_NAMES`."""
    if not isinstance(q, tuple):
        return through(NORMALS, q)
    x, y, one, two = q
    along, against = x + y, x - y
    return x, y, along, against, one, two, one - along, two - against


def contact_loads(p: CoreXYParameters) -> tuple[Any, ...]:
    r"""Load of every contact [N], arm over radius included.

    Rails $mg$, $(M+m)g$; passive pulleys $\sqrt2 P_i$ each (the belt turns by 90°), motor pulleys
    $2P_i$ on the ground and in the belt (180°). Section 2.4 of the paper.
    """
    arm = p.r_f / p.r
    passive = 2.0 * 2.0**0.5 * arm
    return (
        p.m * p.g + passive * (p.P1 + p.P2),
        (p.M + p.m) * p.g,
        passive * p.P1,
        passive * p.P2,
        2.0 * p.P1 * arm,
        2.0 * p.P2 * arm,
        2.0 * p.P1,
        2.0 * p.P2,
    )


def kinetic_limits(p: CoreXYParameters) -> tuple[Any, ...]:
    r"""Kinetic friction $\mu_k N$ of every contact [N], Eqs. (27), (31), (32)."""
    mu = (p.mu_k,) * 6 + (p.mu_1k_b, p.mu_2k_b)
    return tuple(m * n for m, n in zip(mu, contact_loads(p), strict=True))


def static_limits(p: CoreXYParameters) -> tuple[Any, ...]:
    r"""Greatest friction at rest $\max(\mu_s, \mu_k) N$ of every contact [N], Eqs. (26), (33), (34).

    A contact that is held by less than it would slide with cannot leave rest (Filippov's sliding
    mode), hence the greater of the two (erratum A9).
    """
    mu_s = (p.mu_s,) * 6 + (p.mu_1s_b, p.mu_2s_b)
    mu_k = (p.mu_k,) * 6 + (p.mu_1k_b, p.mu_2k_b)
    pairs = zip(mu_s, mu_k, contact_loads(p), strict=True)
    return tuple(where(s > k, s, k) * n for s, k, n in pairs)


def kinetic_friction(p: CoreXYParameters, signs: Row) -> Row:
    """Friction of every sliding contact [N], against its sense, Eqs. (27), (31), (32)."""
    return each(lambda s, limit: -s * limit, row(signs), row(kinetic_limits(p)))


def line_force(forces: Row) -> Line:
    """Force on every velocity [N] from the friction force of every contact along its speed [N]."""
    if not isinstance(forces, tuple):
        return Line(*through(NORMALS.T, forces))
    x, y, along, against, one, two, belt_1, belt_2 = forces
    along, against = along - belt_1, against - belt_2
    return Line(x + along + against, y + along - against, one + belt_1, two + belt_2)


def closure(rest: Row) -> Row:
    """Contacts that cannot slide while those in `rest` (booleans) do not.

    Two of the four contacts of the carriage stop it; belt, motor pulley and virtual pulley are all at
    rest as soon as two of them are.
    """
    if not isinstance(rest, tuple):
        return jnp.asarray(_CLOSED)[set_number(rest)]
    return _closed(rest)


def _closed(rest: tuple[Any, ...]) -> tuple[Any, ...]:
    x, y, along, against, one, two, belt_1, belt_2 = rest
    along, against = along | (one & belt_1), against | (two & belt_2)
    stopped = (x & y) | (along & against) | ((x | y) & (along | against))
    along, against = along | stopped, against | stopped
    first, second = along & (one | belt_1), against & (two | belt_2)
    return (
        x | stopped,
        y | stopped,
        along,
        against,
        one | first,
        two | second,
        belt_1 | first,
        belt_2 | second,
    )


SETS = (np.arange(2**NUM_CONTACTS)[:, None] >> np.arange(NUM_CONTACTS)) % 2 == 1  # [set, contact]
_CLOSED = np.stack(_closed(tuple(SETS.T)), axis=1)


def set_number(contacts: Any) -> Any:
    """Number in `SETS` of a vector of booleans: its bits."""
    return jnp.sum(jnp.where(contacts, jnp.asarray(2 ** np.arange(NUM_CONTACTS), jnp.int32), 0))


def project(q: Line, rest: tuple[Any, ...]) -> Line:
    """The nearest of the velocities at which the contacts in `rest` do not slide, exactly so.

    `rest` must be closed, see `closure`; `q` must have these speeds zero but for rounding.
    """
    x, y, along, against, one, two, belt_1, belt_2 = rest
    zero = jnp.zeros_like(q.x)
    vx, vy = where(x, zero, q.x), where(y, zero, q.y)
    half = 0.5 * (q.x - q.y)
    slanted = along & ~x
    vx, vy = where(slanted, half, vx), where(slanted, -half, vy)
    half = 0.5 * (q.x + q.y)
    slanted = against & ~x
    vx, vy = where(slanted, half, vx), where(slanted, half, vy)
    return Line(
        vx,
        vy,
        where(belt_1, vx + vy, where(one, zero, q.one)),
        where(belt_2, vx - vy, where(two, zero, q.two)),
    )
