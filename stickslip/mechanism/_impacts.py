"""Impacts at rigid stops: Newton's law, the stops that are closed already, and what comes to rest."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from stickslip._fastmath import where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._group import AbstractContactGroup
from ._instant import Instant
from ._local import LocalInstant
from ._moment import Moment
from ._scalars import any_of, dot, is_zero, times, total


class Impact(NamedTuple):
    """State right after a guard of a stop, or the same as before if another one has fired.

    - `now`, `states`: the moment, and the states of contacts and stops; those without speed may rest.
    - `met`: for each stop whether it was open and has been met.
    - `jammed`: whether an impulse drives the mechanism into another stop.
    """

    now: Moment
    states: list[Any]
    met: list[Any]
    jammed: Any


def impact(now: Moment, states: Any, guard: Any) -> Impact:
    r"""State and speeds right after the stop with this guard has been met, if one has it.

    The impulses $\Lambda \ge 0$ of the stop $s$ that is met and of those closed already, $R$, obey

    $$M\,(v^+ - v^-) = \sum_{i \in R \cup s} n_i\Lambda_i, \qquad u_s^+ = -e\,u_s^-, \qquad
      0 \le u_r^+ \perp \Lambda_r \ge 0 \quad (r \in R)$$

    (Moreau's impact law: $u_r^- = 0$). An impact that would leave no more than the speed of rest leaves
    none if the mechanism is pressed on the stop after it: the law of all contacts decides.

    The state is placed on the stop: whatever the parameters, the gap has no derivative left there.
    """
    at, numbers = now.at, now.structure.guards
    q, v, v_rest = list(at.q), list(at.v), list(at.v)
    new, jammed = list(states), jnp.zeros((), bool)
    hit = [guard == numbers.stops.get(c, -1) for c in range(len(states))]
    met = [h & (s == 2.0) for h, s in zip(hit, states, strict=True)]
    bumps = [_Bump(group, now.of(group), hit, met, states)
             for group in now.structure.contact_groups if group.stops]  # fmt: skip
    for bump in bumps:
        bump.place(q)
        bump.hurry(v, bump.kept, bump.target)
        bump.hurry(v_rest, bump.held, [0.0 * x for x in bump.target])
        jammed = jammed | bump.jams(v_rest)
    still = now.moved_to(q, v_rest)
    for bump in bumps:
        group, here = bump.group, still.of(bump.group)
        begun = bump.states_after(here, states, bump.held)
        slow = bump.slow(v)
        never = tuple(s == 9.0 for s in begun)
        found, _ = group.states_after(here, states, begun, never, bump.met & slow)
        rests = slow & any_of(h & (x == 0.0) for h, x in zip(bump.here, found, strict=True))
        for i, c in enumerate(group.rows[group.contacts :], group.contacts):
            stays = (rests & bump.held[i] & (found[i] == 0.0)) | (
                ~rests & bump.kept[i] & bump.closed[i]
            )
            new[c] = where(bump.met, where(stays, 0.0, 2.0), states[c])
        for j in group.columns:
            v[j] = where(rests, v_rest[j], v[j])
    after = now.moved_to(q, v)
    for bump in bumps:
        on = [new[c] == 0.0 for c in bump.group.rows]
        found = bump.states_after(after.of(bump.group), new, on)
        new = bump.group.with_own(new, found)
    return Impact(after, new, met, jammed)


class _Bump:
    """A group with stops of which one may have been met.

    By row: which has been met, `here`; which are `closed` already; which take an impulse or stay on,
    `kept`; which would rest, `held`; and the speeds off the stops after the impact, `target`.
    """

    def __init__(
        self, group: AbstractContactGroup, local: LocalInstant, hit: list, met: list, states: Any
    ):
        rows, k = group.rows, group.contacts
        self.group, self.local = group, local
        self.hit, self.here = [hit[c] for c in rows], [met[c] for c in rows]
        self.closed = [(states[c] == 0.0) if i >= k else hit[c] & False for i, c in enumerate(rows)]
        self.met = any_of(self.here)
        self.kept = group.impulses(local, self.here, self.closed)
        self.held = group.with_closed(self.here, self.closed)
        self.speeds = [local.at.speeds[c] for c in rows]
        self.target = [jnp.zeros(())] * k + [
            # A body that is off already, by rounding, goes on as it does.
            where(h, where(u < 0.0, -stop.stop.restitution * u, u), 0.0)
            for h, u, stop in zip(self.here[k:], self.speeds[k:], local.stops, strict=True)
        ]

    def _changes(self, on: list, speeds: list) -> Any:
        """The least changes of velocities, by the inertia, that give the stops in `on` these speeds."""
        none = [jnp.zeros((), jnp.float64)] * self.group.n
        here = self.local
        return self.group.motion(here.mass, none, here.lines, tuple(on), speeds).acceleration

    def _alone(self, i: int) -> list[int]:
        """Rows that only velocity number `i` of the group enters: it has no rounding of a sum."""
        return [
            c for c, line in enumerate(self.local.lines)
            if not is_zero(line[i]) and all(is_zero(n) for k, n in enumerate(line) if k != i)
        ]  # fmt: skip

    def place(self, q: list) -> None:
        """Move the coordinates onto the stops that are hit or stay closed; into `q`."""
        gaps = [jnp.zeros(())] * self.group.contacts + self.group.gaps(self.local)
        on = self.group.with_closed(self.hit, self.closed)
        shift = list(self._changes(on, [times(-1.0, g) for g in gaps]))
        for i, j in enumerate(self.group.columns):
            for c in self._alone(i):
                shift[i] = where(on[c], times(-1.0 / self.local.lines[c][i], gaps[c]), shift[i])
            if q[j] is not None:
                q[j] = where(any_of(self.hit), q[j] + shift[i], q[j])

    def hurry(self, v: list, on: list, target: list) -> None:
        """Give the speeds `target` to the stops in `on`; into `v`."""
        here = self.local
        change = self._changes(on, [x - u for u, x in zip(self.speeds, target, strict=True)])
        for i, j in enumerate(self.group.columns):
            now = v[j] + change[i]
            for c in self._alone(i):
                speed = times(1.0 / here.lines[c][i], total((target[c], here.surfaces[c])))
                now = where(on[c], speed, now)
            v[j] = where(self.met, now, v[j])

    def jams(self, v_rest: list) -> Any:
        """Whether the impulse drives the mechanism into a closed stop that takes none."""
        found, v = self.met & False, [v_rest[j] for j in self.group.columns]
        for i in range(self.group.contacts, self.group.m):
            onward = dot(self.local.lines[i], v) - self.local.surfaces[i]
            found = found | (self.met & self.closed[i] & ~self.held[i] & (onward < 0.0))
        return found

    def slow(self, v: list) -> Any:
        """Whether nothing moves off stops that are met or held at more than their speeds of rest."""
        slow, own = self.met, [v[j] for j in self.group.columns]
        held = self.group.with_closed([h & False for h in self.here], self.closed)
        for i, stop in enumerate(self.local.stops, self.group.contacts):
            rest_speed = stop.stop.rest_speed
            off = dot(self.local.lines[i], own) - self.local.surfaces[i]
            leaves = (self.target[i] <= rest_speed) & (self.speeds[i] <= 0.0)
            slow = slow & (~self.here[i] | leaves) & (~held[i] | (off <= rest_speed))
        return slow

    def states_after(self, here: LocalInstant, states: Any, closes: list) -> tuple:
        """States after the impact: contacts by their speeds, stops that may close at rest."""
        found = []
        rows = zip(self.group.rows, here.slow(self.local), closes, strict=True)
        for i, (c, slow, on) in enumerate(rows):
            speed = where(slow, 0.0, jnp.sign(here.at.speeds[c]))
            moves = self.met & (states[c] != 2.0)
            found.append(
                where(moves, speed, states[c]) if i < self.group.contacts
                else where(self.met & on, 0.0, states[c])
            )  # fmt: skip
        return tuple(found)


def touches(at: Instant, k: int) -> tuple[Any, Any]:
    """Whether stop `k` is met at this instant to rounding, and whether the mechanism is beyond it."""
    stop = at.stops[k]
    gap = lax.stop_gradient(jnp.asarray(stop.stop.gap, jnp.float64))
    terms = [times(n, x) for n, x in zip(stop.row, at.q, strict=False) if x is not None]
    size = total(jnp.abs(jnp.asarray(x)) for x in terms if not is_zero(x))
    small = jax.tree.map(lax.stop_gradient, ENGINE.few_roundings * size)
    return jnp.abs(gap) <= small, gap < -small
