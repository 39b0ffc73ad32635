"""Which contacts begin to slide, and in which sense: the law of all contacts at one instant."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip.fastmath import where

from ._contact_motion import contact_motion, onset, onset_signs
from ._contacts import NUM_CONTACTS, Line, closure, sliding_speeds
from ._modes import NO_SENSE
from ._rows import Row, any_of, each, first_greatest, row, through, with_place

MAX_PIVOTS = 128
SLACK = 1e-11  # of all forces: overloads below it are rounding


class _Search(NamedTuple):
    signs: Row  # the face of the search
    given: Row  # senses that the friction of contacts without speed belongs to
    acceleration: Row
    pivots: Any
    settled: Any


def resolve_signs(
    mass: Line,
    drive: tuple[Any, Any],
    static: Row,
    kinetic: Row,
    signs: Row,
    started: Row,
) -> Row:
    r"""Senses of all contacts an instant later: those without speed by the law of all contacts.

    $$a = \arg\min \tfrac12 a^T M a - a^T F + \sum_{c\ \text{without speed}} \phi_c(n_c\cdot a)$$

    For a contact at rest $\phi_c(v) = R_c|v|$. What begins to slide is under kinetic friction from
    then on, $\phi_c(v) = K_c v$ ahead and $R_c|v|$ behind. That may make more contacts slide, or send
    one back that had only just begun, through rest and its static limit (erratum A12). So the law is
    asked again, as time stepping with steps of no length would, until the senses stay.

    The minimum is found by the primal active-set method on the faces of the arrangement of the eight
    planes: go to the minimum of the face, or to the first contact that stops on the way and rest it;
    at the minimum, release the line on which the resting contacts are overloaded most. The function
    falls from face to face, so none returns. The same problem as `stickslip.contact.resolve`, in the
    terms of this machine: a quarter of the operations.

    **Arguments:** masses [kg], motor forces [N] on the belt line, static and kinetic limits [N];
    `signs`, 0 for every contact at rest; `started`, which contacts with a sense have no speed yet.

    **Returns** the senses; `NO_SENSE` for all, which is no mode, if the search does not end.
    """
    static, kinetic, signs, started = map(row, (static, kinetic, signs, started))
    mass, drive, static, kinetic, signs = lax.stop_gradient((mass, drive, static, kinetic, signs))
    standing = each(lambda s, start: (s == 0.0) | start, signs, started)
    # At its limit without a drop of friction a contact begins with no acceleration, but it begins.
    creeping = each(lambda start, R, K: start & (R == K), started, static, kinetic)
    size = through(np.ones((1, NUM_CONTACTS)), static)[0] + jnp.abs(drive[0]) + jnp.abs(drive[1])
    still = SLACK * size
    # Slower than what an overload of this size brings about.
    slow = 0.1 * still / (mass.x + mass.y + mass.one + mass.two)
    # The two kinds of friction of what has begun: half their difference and half their sum.
    drop, middle = (each(lambda R, K, s=s: 0.5 * (R + s * K), static, kinetic) for s in (-1.0, 1.0))

    def pivot(now: _Search) -> _Search:
        limits = each(lambda given, R, m: where(given == 0.0, R, m), now.given, static, middle)
        friction = each(
            lambda s, given, stands, K, d, width: where(
                stands, given * where(given == 0.0, 0.0, d) - s * width, -s * K
            ),
            now.signs, now.given, standing, kinetic, drop, limits,
        )  # fmt: skip
        rest = each(lambda s: s == 0.0, now.signs)
        found = contact_motion(mass, drive, friction, rest)
        before, after = row(sliding_speeds(now.acceleration)), row(sliding_speeds(found.acceleration))

        def path(s, v0, v1, stands, rests):
            v0, v1 = jnp.maximum(s * v0, 0.0), s * v1
            stops = stands & ~rests & (v1 < slow)
            return where(stops, -v0 / (v0 - v1 + 2.0 * slow), -2.0)

        # The part of the way to the first contact that stops.
        paths = each(path, now.signs, before, after, standing, rest)
        share, first = first_greatest(paths, -2.0)
        blocked, part = share > -2.0, jnp.clip(-share, 0.0, 1.0)
        reached = each(
            lambda a, b: where(blocked, a + part * (b - a), b), now.acceleration, found.acceleration
        )
        at_rest = closure(with_place(rest, first))
        giving_way = onset(limits, rest, found.reaction)
        overloaded = ~blocked & (giving_way.reserve < -still)
        new = each(
            lambda r, out, s: where(blocked & r, 0.0, where(overloaded, out, s)),
            at_rest, onset_signs(now.signs, giving_way), now.signs,
        )  # fmt: skip
        minimum = ~blocked & ~overloaded
        found_signs = each(
            lambda creeps, old, s: where(creeps & (s == 0.0), old, s), creeping, signs, now.signs
        )
        changed = any_of(each(lambda s, given: s != given, found_signs, now.given))
        again, settled = minimum & changed, minimum & ~changed
        # The next search begins at rest: started on the face found, all its speeds zero, it could
        # stop and release the same contacts for ever.
        new = each(
            lambda stands, found, s: where(again & stands, 0.0, where(settled, found, s)),
            standing, found_signs, new,
        )  # fmt: skip
        return _Search(
            new,
            each(lambda s, given: where(again, s, given), found_signs, now.given),
            each(lambda a: where(again, 0.0, a), reached),
            now.pivots + 1,
            settled,
        )

    def unsettled(now: _Search):
        return ~now.settled & (now.pivots < MAX_PIVOTS)

    zero = jnp.zeros_like(size)
    at_rest = each(lambda stands, s: where(stands, 0.0, s), standing, signs)
    start = _Search(
        at_rest, signs, row(Line(zero, zero, zero, zero)), jnp.zeros_like(size, jnp.int32), size < -1.0
    )
    end = lax.while_loop(unsettled, pivot, jax.tree.map(jnp.asarray, start))
    return each(lambda s: where(end.settled, s, NO_SENSE), end.signs)
