"""Impacts at rigid stops: Newton's law, the stops that are closed already, and what comes to rest."""

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from stickslip._fastmath import where

from ._instant import Instant, instant_of, rows_of, slow_contacts
from ._island import Island
from ._reserve import NO_LIMIT
from ._scalars import any_of, dot, is_zero, times, total
from ._settle import Limits, settled

if TYPE_CHECKING:
    from ._mechanism import AbstractMechanism

ROUNDING = 8 * 2.3e-16  # of the terms of a gap


class Struck(NamedTuple):
    """What is known right after a guard of a stop, or the same as before if another one has fired.

    - `at`, `states`: the instant, and the states of contacts and stops; those without speed may rest.
    - `met`: for each stop whether it was open and has been met.
    - `jammed`: whether an impulse drives the mechanism into another stop.
    """

    at: Instant
    states: list[Any]
    met: list[Any]
    jammed: Any


def struck(
    machine: "AbstractMechanism",
    t: Any,
    at: Instant,
    states: list,
    number: Any,
    args: Any,
    law: Any,
) -> Struck:
    r"""State and speeds right after stop `number` has been met, if it is one.

    The impulses $\Lambda \ge 0$ of the stop $s$ that is met and of those closed already, $R$, obey

    $$M\,(v^+ - v^-) = \sum_{i \in R \cup s} n_i\Lambda_i, \qquad u_s^+ = -e\,u_s^-, \qquad
      0 \le u_r^+ \perp \Lambda_r \ge 0 \quad (r \in R)$$

    (Moreau's impact law: $u_r^- = 0$). An impact that would leave no more than the speed of rest leaves
    none if the mechanism is pressed on the stop after it: `law(at, island, states)` decides, which
    returns the states of the contacts of an island.

    The state is placed on the stop: whatever the parameters, the gap has no derivative left there.
    """
    first = len(at.contacts)
    q, v, v_rest = list(at.q), list(at.v), list(at.v)
    hit = [jnp.zeros((), bool)] * first + [number == k for k in range(len(at.stops))]
    met = [h & (s == 2.0) for h, s in zip(hit, states, strict=True)]
    new, jammed = list(states), jnp.zeros((), bool)
    bumps: list[_Bump] = []
    for island in machine.islands:
        if not island.stops:
            continue
        M, J = at.mass.of(island.columns), rows_of(island, at)
        own, here = [hit[c] for c in island.rows], [met[c] for c in island.rows]
        closed = [hit[c] & False if c < first else states[c] == 0.0 for c in island.rows]
        bump = any_of(here)
        _place(island, at, M, J, q, own if island.shut else _either(own, closed), any_of(own))
        kept = _impulses(island, at, M, J, here, closed)
        target = _rebounds(island, at, here)
        _hurry(island, at, M, J, v, kept, target, bump)
        slow = _slow(island, at, J, v, here, closed, target)
        held = kept if island.shut else _either(here, closed)
        _hurry(island, at, M, J, v_rest, held, [0.0 * x for x in target], bump)
        for i, c in enumerate(island.rows[island.contacts :], island.contacts):
            if island.shut:
                onward = times(J[i][0], v_rest[island.columns[0]]) - at.surfaces[c]
                jammed = jammed | (bump & closed[i] & (onward < 0.0))
        bumps.append(_Bump(island, bump, here, closed, kept, held, slow))
    places, speeds = type(at.q), type(at.v)
    still = instant_of(machine, t, places(*q), speeds(*v_rest), args)
    for island, bump, here, closed, kept, held, slow in bumps:
        given = _begun(island, still, at, states, bump, held)
        found = law(still, island, given, bump & slow)
        rests = slow & any_of(h & (x == 0.0) for h, x in zip(here, found, strict=True))
        for i, c in enumerate(island.rows[island.contacts :], island.contacts):
            stays = (rests & held[i] & (found[i] == 0.0)) | (~rests & kept[i] & closed[i])
            new[c] = where(bump, where(stays, 0.0, 2.0), states[c])
        for j in island.columns:
            v[j] = where(rests, v_rest[j], v[j])
    after = instant_of(machine, t, places(*q), speeds(*v), args)
    for island, bump, *_ in bumps:
        on = [new[c] == 0.0 for c in island.rows]
        for c, s in zip(island.rows, _begun(island, after, at, new, bump, on), strict=True):
            new[c] = s
    return Struck(after, new, met, jammed)


class _Bump(NamedTuple):
    """An island, whether one of its stops has been met, and by row: which, which are closed already,
    which take an impulse or stay on, which would rest; and whether the impact leaves little enough."""

    island: Island
    bump: Any
    here: list[Any]
    closed: list[Any]
    kept: list[Any]
    held: list[Any]
    slow: Any


def _slow(island: Island, at: Instant, J: list, v: list, here: list, closed: list, target: list) -> Any:
    """Whether nothing moves off the stops that are met or closed at more than their speeds of rest."""
    slow = any_of(here)
    for i, c in enumerate(island.rows[island.contacts :], island.contacts):
        rest_speed = at.stops[c - len(at.contacts)].stop.rest_speed
        off = dot(J[i], [v[j] for j in island.columns]) - at.surfaces[c]
        slow = slow & (~here[i] | ((target[i] <= rest_speed) & (at.speeds[c] <= 0.0)))
        if not island.shut:
            slow = slow & (~closed[i] | (off <= rest_speed))
    return slow


def _either(some: list, others: list) -> list:
    return [a | b for a, b in zip(some, others, strict=True)]


def _begun(
    island: Island, at: Instant, before: Instant, states: list, bump: Any, closes: list
) -> list[Any]:
    """States of an island after an impact: contacts by their speeds, stops that may close at rest."""
    found = []
    slows = slow_contacts(at, island, before)
    for c, slow, on in zip(island.rows, slows, closes, strict=True):
        if c < len(at.contacts):
            speed = where(slow, 0.0, jnp.sign(at.speeds[c]))
            found.append(where(bump & (states[c] != 2.0), speed, states[c]))
        else:
            found.append(where(bump & on, 0.0, states[c]))
    return found


def _place(island: Island, at: Instant, M: Any, J: list, q: list, on: list, some: Any) -> None:
    """Move the coordinates onto the stops in `on`; into `q`."""
    gaps = [_gap(at, c) for c in island.rows]
    none = [jnp.zeros((), jnp.float64)] * island.n
    shift = island.motion(M, none, J, on, [times(-1.0, g) for g in gaps]).acceleration
    for i, j in enumerate(island.columns):
        # A coordinate that a stop alone decides has no rounding of a sum.
        for row, gap, is_on in zip(J, gaps, on, strict=True):
            if not is_zero(row[i]) and all(is_zero(x) for k, x in enumerate(row) if k != i):
                shift[i] = where(is_on, times(-1.0 / row[i], gap), shift[i])
        if q[j] is not None:
            q[j] = where(some, q[j] + shift[i], q[j])


def _gap(at: Instant, c: int) -> Any:
    k = c - len(at.contacts)
    return jnp.asarray(at.stops[k].stop.gap, jnp.float64) if k >= 0 else jnp.zeros(())


def _rebounds(island: Island, at: Instant, here: list) -> list[Any]:
    """Speed off each stop after the impact; 0 for stops that are closed."""
    found = []
    for c, h in zip(island.rows, here, strict=True):
        k, u = c - len(at.contacts), at.speeds[c]
        e = at.stops[k].stop.restitution if k >= 0 else 0.0
        # What is off already, by rounding, goes on as it does.
        found.append(where(h, where(u < 0.0, -e * u, u), 0.0))
    return found


def _impulses(island: Island, at: Instant, M: Any, J: list, here: list, closed: list) -> list[Any]:
    """Which stops, of the one that is met and those that are closed, take an impulse or stay on."""
    if island.stops == 1 or island.shut:
        bump = any_of(here)
        return [h | (r & ~bump) if island.shut else h | r for h, r in zip(here, closed, strict=True)]
    none = [jnp.zeros((), jnp.float64)] * island.n
    zero = [0.0] * island.contacts
    limits = Limits([0.0] * island.m, zero + [NO_LIMIT] * island.stops)
    speeds = [at.speeds[c] for c in island.rows]
    # As accelerations under no force: what is met has to leave, what is closed must not come closer.
    gamma = [where(h, -u, 0.0) for h, u in zip(here, speeds, strict=True)]
    states = [where(h | r, 0.0, 2.0) for h, r in zip(here, closed, strict=True)]
    never = [h & False for h in here]
    found, _ = settled(island, M, none, J, gamma, limits, limits, states, never, any_of(here))
    return [x == 0.0 for x in found]


def _hurry(
    island: Island, at: Instant, M: Any, J: list, v: list, kept: list, target: list, bump: Any
) -> None:
    """Give the speeds `target` to the stops in `kept`; into `v`."""
    none = [jnp.zeros((), jnp.float64)] * island.n
    gamma = [x - at.speeds[c] for c, x in zip(island.rows, target, strict=True)]
    change = island.motion(M, none, J, kept, gamma).acceleration
    for i, j in enumerate(island.columns):
        now = v[j] + change[i]
        for c, row, x, on in zip(island.rows, J, target, kept, strict=True):
            if not is_zero(row[i]) and all(is_zero(n) for k, n in enumerate(row) if k != i):
                now = where(on, times(1.0 / row[i], total((x, at.surfaces[c]))), now)
        v[j] = where(bump, now, v[j])


def touches(at: Instant, k: int) -> tuple[Any, Any]:
    """Whether stop `k` is met at this instant to rounding, and whether the mechanism is beyond it."""
    stop = at.stops[k]
    gap = lax.stop_gradient(jnp.asarray(stop.stop.gap, jnp.float64))
    terms = [times(n, x) for n, x in zip(stop.row, at.q, strict=False) if x is not None]
    size = total(jnp.abs(jnp.asarray(x)) for x in terms if not is_zero(x))
    small = jax.tree.map(lax.stop_gradient, ROUNDING * size)
    return jnp.abs(gap) <= small, gap < -small
