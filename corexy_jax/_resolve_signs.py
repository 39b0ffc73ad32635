"""Which contacts begin to slide, and in which sense: the law of all contacts at one instant."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from stickslip._fastmath import where

from ._contact_motion import contact_motion, onset, onset_signs
from ._contacts import NUM_CONTACTS, Line, closure, sliding_speeds
from ._modes import NO_SENSE

MAX_PIVOTS = 128
SLACK = 1e-11  # of all forces: overloads below it are rounding


class _Search(NamedTuple):
    signs: tuple[Any, ...]  # the face of the search
    given: tuple[Any, ...]  # senses that the friction of contacts without speed belongs to
    acceleration: Line
    pivots: Any
    settled: Any


def resolve_signs(
    mass: Line,
    drive: tuple[Any, Any],
    static: tuple[Any, ...],
    kinetic: tuple[Any, ...],
    signs: tuple[Any, ...],
    started: tuple[Any, ...],
) -> tuple[Any, ...]:
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
    mass, drive, static, kinetic, signs = lax.stop_gradient((mass, drive, static, kinetic, signs))
    standing = tuple((s == 0.0) | start for s, start in zip(signs, started, strict=True))
    # At its limit without a drop of friction a contact begins with no acceleration, but it begins.
    creeping = tuple(s & (R == K) for s, R, K in zip(started, static, kinetic, strict=True))
    size = sum(static[1:], static[0]) + jnp.abs(drive[0]) + jnp.abs(drive[1])
    still = SLACK * size
    # Slower than what an overload of this size brings about.
    slow = 0.1 * still / (mass.x + mass.y + mass.one + mass.two)

    def pivot(now: _Search) -> _Search:
        friction, limits = [], []
        for s, given, stands, R, K in zip(now.signs, now.given, standing, static, kinetic, strict=True):
            drop, width = where(given == 0.0, 0.0, 0.5 * (R - K)), where(given == 0.0, R, 0.5 * (R + K))
            friction.append(where(stands, given * drop - s * width, -s * K))
            limits.append(width)
        rest = tuple(s == 0.0 for s in now.signs)
        found = contact_motion(mass, drive, tuple(friction), rest)
        before, after = sliding_speeds(now.acceleration), sliding_speeds(found.acceleration)
        share, first = jnp.full_like(size, 2.0), jnp.full_like(now.pivots, -1)
        for c in range(NUM_CONTACTS):
            v0, v1 = now.signs[c] * before[c], now.signs[c] * after[c]
            stops = standing[c] & ~rest[c] & (v1 < slow)
            path = where(stops, jnp.maximum(v0, 0.0) / (jnp.maximum(v0, 0.0) - v1 + 2.0 * slow), 2.0)
            sooner = path < share
            share, first = where(sooner, path, share), where(sooner, jnp.int32(c), first)
        blocked = first >= 0
        part = jnp.clip(share, 0.0, 1.0)
        reached = Line(*(
            where(blocked, a + part * (b - a), b)
            for a, b in zip(now.acceleration, found.acceleration, strict=True)
        ))  # fmt: skip
        at_rest = closure(tuple(r | (first == c) for c, r in enumerate(rest)))
        giving_way = onset(tuple(limits), rest, found.reaction)
        overloaded = ~blocked & (giving_way.reserve < -still)
        released = onset_signs(now.signs, giving_way)
        new = tuple(
            where(blocked & r, 0.0, where(overloaded, out, s))
            for r, out, s in zip(at_rest, released, now.signs, strict=True)
        )
        minimum = ~blocked & ~overloaded
        found_signs = tuple(
            where(creeps & (s == 0.0), old, s)
            for creeps, old, s in zip(creeping, signs, now.signs, strict=True)
        )
        changed = jnp.zeros_like(blocked)
        for s, given in zip(found_signs, now.given, strict=True):
            changed = changed | (s != given)
        again, settled = minimum & changed, minimum & ~changed
        # The next search begins at rest: started on the face found, all its speeds zero, it could
        # stop and release the same contacts for ever.
        new = tuple(
            where(again & stands, 0.0, where(settled, found, s))
            for stands, found, s in zip(standing, found_signs, new, strict=True)
        )
        return _Search(
            new,
            tuple(where(again, s, given) for s, given in zip(found_signs, now.given, strict=True)),
            Line(*(where(again, 0.0, a) for a in reached)),
            now.pivots + 1,
            settled,
        )

    def unsettled(now: _Search):
        return ~now.settled & (now.pivots < MAX_PIVOTS)

    zero = jnp.zeros_like(size)
    at_rest = tuple(where(stands, 0.0, s) for stands, s in zip(standing, signs, strict=True))
    start = _Search(
        at_rest, signs, Line(zero, zero, zero, zero), jnp.zeros_like(size, jnp.int32), size < -1.0
    )
    end = lax.while_loop(unsettled, pivot, jax.tree.map(jnp.asarray, start))
    return tuple(where(end.settled, s, NO_SENSE) for s in end.signs)
