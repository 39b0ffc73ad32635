"""Which of the contacts with dependent directions begin to slide: the law of all of them, in rows."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip._fastmath import where

from ._island import Island
from ._rows import NumberRow, any_of, each, first_greatest, row, through, with_place
from ._scalars import Mass, times, total
from ._together import Bounds, closed, onset, resting

MOST_PIVOTS = 128
SLACK = 1e-11  # of all forces: overloads below it are rounding
PATIENCE = 16  # pivots after which more is taken for rounding: ten times as much each time
NOT_BLOCKED = -2.0
NO_DROP = 1e-13  # part of the static friction that a law may lose by rounding as it begins to slide


def without_drop(static: Any, kinetic: Any) -> Any:
    """Whether a contact that gives way bears as much as it did at rest.

    A law need not say so to the last digit: `mu_k + (mu_s - mu_k)` is not `mu_s`.
    """
    return jnp.abs(static - kinetic) <= NO_DROP * jnp.abs(static)


class _Search(NamedTuple):
    states: NumberRow  # the face of the search: 0 at rest, else the sense
    given: NumberRow  # senses that the friction of contacts without speed belongs to
    acceleration: NumberRow
    pivots: Any
    settled: Any
    still: Any  # overloads below it are rounding [N]


def settled_together(
    island: Island,
    M: Mass,
    motion: Callable,
    force: NumberRow,
    static: Bounds,
    kinetic: Bounds,
    states: NumberRow,
    started: NumberRow,
    active: Any,
) -> tuple[NumberRow, Any]:
    """As `settled`, which says what is sought and how, of contacts whose surfaces have constant speeds.

    `motion`: `AbstractMechanism.motion_together`.
    """
    force, static, kinetic, states = lax.stop_gradient((force, static, kinetic, states))
    standing = each(lambda s, start: (s == 0.0) | start, states, started)
    low, kinetic_low = static.lower, kinetic.lower
    # At its limit without a drop of friction a contact begins with no acceleration, but it begins.
    behind = each(without_drop, static.high, kinetic.high)
    creeping = each(lambda start, same: start & same, started, behind)
    if static.low is not None or kinetic.low is not None:
        creeping = each(
            lambda start, s, behind, R, K: (
                start & (((s > 0.0) & without_drop(R, K)) | ((s <= 0.0) & behind))
            ),
            started, states, behind, low, kinetic_low,
        )  # fmt: skip
    levers = np.abs(island.directions).max(axis=0)
    felt = [times(m, 1.0 / (x * x)) for m, x in zip(_diagonal(M), levers.tolist(), strict=True) if x]
    inertia = total(map(lax.stop_gradient, felt))
    widths = each(lambda high, low: high - low, static.high, low)
    borne = through(np.ones((1, island.m)), widths)[0]
    loads = through(np.array([[1.0 / x if x else 0.0 for x in levers]]), each(jnp.abs, force))[0]
    size = borne + loads + 1e-300
    slopes = island.directions

    def pivot(now: _Search) -> _Search:
        slow = 0.1 * now.still / inertia  # slower than what an overload of this size brings about
        least = each(lambda given, R, K: where(given > 0.0, K, R), now.given, low, kinetic_low)
        most = each(lambda given, R, K: where(given < 0.0, K, R), now.given, static.high, kinetic.high)
        # The middle of the interval is a force, so that what is left to bear lies around 0.
        middle = each(lambda a, b: 0.5 * (a + b), least, most)
        half = each(lambda a, b: 0.5 * (b - a), least, most)
        friction = each(
            lambda stands, s, middle, half: where(stands, middle - s * half, 0.0),
            standing, now.states, middle, half,
        )  # fmt: skip
        rest = resting(now.states)
        load = each(lambda f, g: f + g, force, through(slopes.T, friction))
        acceleration, reaction = motion(island, M, load, rest)
        before, after = through(slopes, now.acceleration), through(slopes, acceleration)

        def path(s, v0, v1, stands, rests):
            v0, v1 = jnp.maximum(s * v0, 0.0), s * v1
            stops = stands & ~rests & (v1 < slow)
            return where(stops, -v0 / (v0 - v1 + 2.0 * slow), NOT_BLOCKED)

        # The part of the way to the first contact that stops.
        paths = each(path, now.states, before, after, standing, rest)
        share, first = first_greatest(paths, NOT_BLOCKED)
        blocked, part = share > NOT_BLOCKED, jnp.clip(-share, 0.0, 1.0)
        reached = each(
            lambda a, b: where(blocked, a + part * (b - a), b), now.acceleration, acceleration
        )
        # Those that have no speed and would have none by the others' rest.
        stopped = closed(island, with_place(rest, first), standing)
        giving_way = onset(island, Bounds(None, half), rest, reaction, slack=now.still)
        overloaded = ~blocked & (giving_way.share > 1.0)
        states_now = each(
            lambda r, way, s: where(blocked & r, 0.0, where(overloaded & (s == 0.0), way, s)),
            stopped, giving_way.ways, now.states,
        )  # fmt: skip
        minimum = ~blocked & ~overloaded
        ends = each(
            lambda creeps, old, s: where(creeps & (s == 0.0), old, s), creeping, states, now.states
        )
        changed = any_of(each(lambda s, given: s != given, ends, now.given))
        again, done = minimum & changed, minimum & ~changed
        # The next search begins at rest: started on the face found, all its speeds zero, it could
        # stop and release the same contacts for ever.
        states_now = each(
            lambda stands, end, s: where(again & stands, 0.0, where(done, end, s)),
            standing, ends, states_now,
        )  # fmt: skip
        # A tie within rounding of an ill-conditioned inertia may send a contact to and fro.
        tired = (now.pivots % PATIENCE) == PATIENCE - 1
        return _Search(
            states_now,
            each(lambda end, given: where(again, end, given), ends, now.given),
            each(lambda a: where(again, 0.0, a), reached),
            now.pivots + 1,
            done,
            where(tired, 10.0 * now.still, now.still),
        )

    face = each(lambda stands, s: where(stands, 0.0, s), standing, states)
    origin = row([jnp.zeros_like(size)] * island.n)
    start = _Search(face, states, origin, jnp.zeros_like(size, jnp.int32), ~active, SLACK * size)
    end = lax.while_loop(
        lambda now: ~now.settled & (now.pivots < MOST_PIVOTS), pivot, jax.tree.map(jnp.asarray, start)
    )
    return end.states, end.settled


def _diagonal(M: Mass) -> list[Any]:
    return list(M.diagonal or [line[i] for i, line in enumerate(M.full or [])])
