"""One velocity between stops and contacts: what rests, holds it, and each surface moves on its own."""

from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from stickslip._fastmath import where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._group import AbstractContactGroup, Fired, Guards, Release, past_zero
from ._laws import NO_LIMIT, Bounds
from ._local import LocalInstant, Part
from ._motion import Motion
from ._reserve import least_reserve
from ._rows import NumberRow, any_of, each
from ._scalars import Mass, choose, is_zero, minus, over, times, total, without_slope
from ._search import Overload, Problem, resting, senses_of, states_by_search
from ._varying import contacts_at_rest, ends_at_rest, passing_through, with_loose


class _AbstractOneVelocity(AbstractContactGroup):
    """All that velocities with several stops, or stops and contacts, have in common."""

    @property
    def leading(self) -> list[int]:
        """Rows in the order in which they lead: the first that rests bears all; stops come first."""
        return [*range(self.contacts, self.m), *range(self.contacts)]

    def motion(self, M: Mass, F: Any, J: list[list], rest: NumberRow, gamma: list) -> Motion:
        (m,), order = M.diagonal or (M.full or [[None]])[0], self.leading
        held: Any = 0.0
        for c in reversed(order):
            held = choose(rest[c], times(1.0 / J[c][0], gamma[c]), held)
        some = any_of(tuple(rest))
        a = where(some, held, F[0] / m)
        needed = where(some, minus(times(m, held), F[0]), 0.0)
        force: list[Any] = [None] * self.m
        leads = led = rest[order[0]]
        for c, following in zip(order, [*order[1:], order[0]], strict=True):
            force[c] = where(leads, times(1.0 / J[c][0], needed), 0.0)
            leads, led = rest[following] & ~led, led | rest[following]
        return Motion((a,), (needed,), tuple(force))

    def closure(self, rest: NumberRow, slow: NumberRow) -> NumberRow:
        some = any_of(rest)
        return tuple(r | (some & s) for r, s in zip(rest, slow, strict=True))

    def slow_then(self, here: LocalInstant, own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow:
        rest = resting(own)
        if here.drifts:
            # A contact that has just lost its speed says which others have lost theirs.
            return self.slow(here, own, tuple(h | (r & ~stops) for h, r in zip(hit, rest, strict=True)))
        return super().slow_then(here, own, hit, stops)

    def still(self, here: LocalInstant, own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow:
        slow = self.slow_then(here, own, hit, stops)
        slow = tuple(x & (s != 2.0) for x, s in zip(slow, own, strict=True))
        return self.closure(super().still(here, own, hit, stops), slow)

    def landing(self, here, still, found, landing, fired):
        if not here.drifts and self.part.varies:
            still = contacts_at_rest(self.rows, still, found, fired.rested)
            # The velocity of all is that of the contact that passes.
            return still, landing.lands & ~any_of(past_zero(landing.passing, found)), {}
        if not here.drifts:
            return super().landing(here, still, found, landing, fired)
        # A contact that a stop carries off keeps its velocity: that of a stop which has hardly begun to
        # move is rounding, and might be against the sense in which the others are left.
        rest = landing.rest
        left_behind = any_of(tuple(h & r for h, r in zip(landing.hit, rest, strict=True)))
        keeps = [left_behind & (i >= self.contacts) for i in range(self.m)]
        still = tuple(x & (f == 0.0) & ~k for x, f, k in zip(still, found, keeps, strict=True))
        (j,) = self.columns
        place = here.at.q[j]
        # The coordinate on the stop that has carried it: its steps err.
        for stop, line, r in zip(
            here.stops, here.lines[self.contacts :], rest[self.contacts :], strict=True
        ):
            there = here.at.q[j] - times(over(line[0]), stop.stop.gap)
            place = where(r & landing.touched, there, place)
        return still, landing.lands, {j: place}

    def decides(self, rests: Any, n: Any) -> Any:
        return rests & (n != 0.0) if self.part.varies else rests

    def reserve(
        self, lines: list, bounds: Bounds, rest: NumberRow, motion: Motion
    ) -> tuple[Any, NumberRow]:
        """Force that is left until the contacts in `rest` give way [N], and how they would."""
        return least_reserve(bounds, rest, [[line[0] for line in lines]], [motion.reaction[0]])

    def overload(
        self, lines: list, bounds: Bounds, rest: NumberRow, motion: Motion, still: Any
    ) -> Overload:
        left, ways = self.reserve(lines, bounds, rest, motion)
        return Overload(left < -still, ways)

    def with_closed(self, hit: list, closed: list) -> list:
        return hit

    def impulses(self, here: LocalInstant, met: list, closed: list) -> list[Any]:
        return met


class StopsOnOneVelocity(_AbstractOneVelocity):
    """Several stops, which bear the load one at a time."""

    @classmethod
    def takes(cls, part: Part) -> bool:
        return part.on_one_velocity and part.contacts == 0

    def off(self, lines: list, motion: Motion, c: int) -> Any:
        """Force of stop `c` on the mechanism, along its gradient, if it bears all that rests [N]."""
        return times(1.0 / lines[c][0], motion.reaction[0])

    def guards(self, here: LocalInstant, states: Any) -> Guards:
        own, motion = self.own_states(states), self.motion_in(here, states)
        return Guards(tuple(
            where(s == 0.0, self.off(here.lines, motion, c), gap)
            for c, (s, gap) in enumerate(zip(own, self.gaps(here), strict=True))
        ), {})  # fmt: skip

    def release(self, here: LocalInstant, states: Any, hit: NumberRow, fired: Fired) -> Release:
        lets_go = tuple(h & (s == 0.0) for h, s in zip(hit, self.own_states(states), strict=True))
        gives_way = any_of(lets_go)
        return Release(
            tuple(where(go, 1.0, 0.0) for go in lets_go), gives_way, any_of(hit) & ~gives_way
        )

    def law(self, problem):
        problem = problem.without_slopes()
        motion = problem.moves(problem.force, problem.standing)
        after = (
            where((s == 0.0) & (self.off(problem.lines, motion, c) < 0.0), 1.0, s)
            for c, s in enumerate(problem.states)
        )
        return tuple(after), jnp.ones_like(problem.standing[0])


class ContactsOnOneVelocity(_AbstractOneVelocity):
    """Stops and contacts, which give way together."""

    @classmethod
    def takes(cls, part: Part) -> bool:
        return part.on_one_velocity and part.contacts > 0

    @property
    def joint_guards(self) -> int:
        return 1

    def not_followed(self, moving, still, straight):
        # A stop without a speed of its own holds everything that is at rest.
        moving = [c for c in moving if c not in still]
        return moving if moving and not straight() else []

    def guards(self, here: LocalInstant, states: Any) -> Guards:
        own, motion, k = self.own_states(states), self.motion_in(here, states), self.contacts
        rest = resting(own)
        found = [where(r, 1.0, s * u) for r, s, u in zip(rest[:k], own, here.speeds, strict=False)]
        found += [where(r, 1.0, gap) for r, gap in zip(rest[k:], self.gaps(here), strict=True)]
        if here.drifts:
            some = any_of(rest)
            for i, (s, beside) in enumerate(zip(own, self._beside(here, states, motion), strict=True)):
                slides = some & (s != 2.0) if i < k else rest[i]
                found[i] = where(slides, beside, found[i])
        slides = each(lambda s: (s != 0.0) & (s != 2.0), own)
        for c in range(k):
            # Of several that stop as one the first says so.
            found[c] = where(self._goes_as_one_of(here, c, slides, c), 1.0, found[c])
        left, _ = self.reserve(here.lines, here.static, rest, motion)
        return Guards(tuple(found), {}, (where(left < jnp.inf, left, 1.0),))

    def _goes_as_one_of(self, here: LocalInstant, c: int, others: NumberRow, end: int) -> Any:
        """Whether the sliding speed of contact `c` is a multiple of one of `others` before `end`.

        False while surfaces or directions vary: speeds that are alike now may part.
        """
        n, w = [line[0] for line in here.lines], here.surfaces
        found: Any = others[c] & ~others[c]
        if here.drifts or self.part.varies:
            return found
        for d in (d for d in range(end) if d != c):
            one, other = (jnp.asarray(times(n[a], w[b])) for a, b in ((d, c), (c, d)))
            apart = jnp.abs(one - other) > ENGINE.zero * (jnp.abs(one) + jnp.abs(other))
            found = found | (others[d] & ~apart)
        return found

    def still(self, here: LocalInstant, own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow:
        found, k = super().still(here, own, hit, stops), self.contacts
        # A contact that goes as one that rests, rests with it, whatever rounding left of its speed.
        with_one = [self._goes_as_one_of(here, c, found, k) & (own[c] != 2.0) for c in range(k)]
        return (*(f | x for f, x in zip(found, with_one, strict=False)), *found[k:])

    def _beside(self, here: LocalInstant, states: Any, motion: Motion) -> list[Any]:
        """Guards where something rests beside surfaces that move.

        Contacts slide as the surface of what rests has it, and may do so with a speed of exactly 0
        from some time on, as on a cam that comes to a stand: it rests then. Near such a time the
        integrated speed errs by the steps, and that of the surface by rounding as it begins to move:
        only what both say has passed through rest. Contacts that rest together do so until the surfaces
        part, as where a cam begins to move that carries what rests on the ground too."""
        (a,), own = motion.acceleration, self.own_states(states)
        n = [line[0] for line in here.lines]
        (m,) = here.mass.times([1.0])
        spans = zip(n, here.static.lower, here.static.high, strict=True)
        borne = (jnp.abs(x) * (high - low) for x, low, high in spans if high is not NO_LIMIT)
        (force,) = self.load(here, states)
        most = ENGINE.zero * total((jnp.abs(jnp.asarray(force)), jnp.abs(m * a), *borne))
        speed: Any = here.at.v[self.columns[0]]
        for i in reversed(self.leading):
            speed = where(own[i] == 0.0, times(over(n[i]), here.surfaces[i]), speed)
        found = []
        for x, s, w, u, g in zip(n, own, here.surfaces, here.speeds, here.gamma, strict=True):
            apart = m * jnp.abs(a - times(over(x), g))
            slip = times(x, speed) - w
            slides = jnp.maximum(s * slip, s * u)
            slides = where((slip == 0.0) & (apart == 0.0), -1.0, slides)
            share = jnp.minimum(apart / (most + ENGINE.tiny), ENGINE.most)
            found.append(where(s == 0.0, 1.0 - share, slides))
        return found

    def release(self, here: LocalInstant, states: Any, hit: NumberRow, fired: Fired) -> Release:
        motion = jax.tree.map(lax.stop_gradient, self.motion_in(here, states))
        rest, static = resting(self.own_states(states)), without_slope(here.static)
        _, ways = self.reserve(here.lines, static, rest, motion)
        return Release(ways, fired.guard == fired.joint[self.rows[0]], any_of(hit))

    def passing(self, own, hit, stops):
        return passing_through(own, hit, stops) if self.part.varies else None

    def law(self, problem):
        return states_by_search(self, with_loose(self.part, problem) if self.part.varies else problem)

    @property
    def least_acceleration(self) -> float:
        return -1.0 if self.part.varies else 1.0

    def ending(self, problem, states, acceleration, slow):
        return ends_at_rest(problem, states, acceleration, slow) if self.part.varies else states

    # Contacts without speed may be parted at once: on each surface the one velocity changes
    # differently.

    def begins(self, problem: Problem, standing: NumberRow, slow: Any) -> tuple[NumberRow, NumberRow]:
        origin, face = super().begins(problem, standing, slow)
        if all(map(is_zero, problem.gamma)):
            return origin, face
        (a,) = origin
        for c in range(self.contacts, self.m):
            # Nothing goes through a stop: of several the one that is ahead decides.
            line, g = problem.lines[c][0], problem.gamma[c]
            behind = standing[c] & (minus(times(line, origin[0]), g) < 0.0)
            a = where(behind, times(over(line), g), a)
            origin = (a,)
        return origin, senses_of(problem, origin, slow)

    def without_speed(
        self, problem: Problem, acceleration: NumberRow, standing: NumberRow, slow: Any
    ) -> NumberRow:
        if all(map(is_zero, problem.gamma)):
            return standing
        senses = senses_of(problem, acceleration, slow)
        return tuple(stands & (s == 0.0) for stands, s in zip(standing, senses, strict=True))
