"""Contacts of independent constant directions: each by itself, or coupled by inertia."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip._fastmath import where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._directions import completed_inverse
from ._group import (
    AbstractContactGroup,
    Fired,
    Guards,
    Release,
    least_first,
    lower_of,
    reserves,
)
from ._laws import NO_LIMIT, Bounds
from ._local import LocalInstant, Part
from ._motion import Motion
from ._rows import NumberRow
from ._scalars import Factors, Mass, any_of, choose, dot, is_zero, minus, over, times, total
from ._search import UNRESISTED, Overload, Problem, resting


class FreeVelocities(AbstractContactGroup):
    """Velocities that no contact and no stop touches."""

    @classmethod
    def takes(cls, part: Part) -> bool:
        return not part.rows

    def motion(self, M, F, J, rest, gamma):
        return Motion(tuple(M.solve(F)), (), ())

    def guards(self, here, states):
        return Guards((), {})

    def release(self, here, states, hit, fired):
        return Release((), jnp.zeros((), bool), jnp.zeros((), bool))


class AbstractIndependentContacts(AbstractContactGroup):
    """Contacts of which each gives way by itself, as what it bears reaches its limit."""

    def guards(self, here: LocalInstant, states: Any) -> Guards:
        own, motion = self.own_states(states), self.motion_in(here, states)
        rest, found, ahead = resting(own), [], {}
        limits = zip(here.static.lower, here.static.high, motion.force, strict=True)
        for c, r, s, (low, high, borne) in zip(self.rows, rest, own, limits, strict=True):
            if high is NO_LIMIT:
                gap = jnp.asarray(here.stops[len(found) - self.contacts].stop.gap, jnp.float64)
                found.append(where(r, borne, gap))
                continue
            left = jnp.minimum(high - borne, borne - low)
            if c in self.part.two_sided:
                left, ahead[c] = high - borne, where(r, borne - low, 1.0)
            elif here.contacts[len(found)].law.is_odd:
                left = high - jnp.abs(borne)
            found.append(where(r, left, s * here.at.speeds[c]))
        return Guards(tuple(found), ahead)

    def release(self, here: LocalInstant, states: Any, hit: NumberRow, fired: Fired) -> Release:
        rest = resting(self.own_states(states))
        force = jax.tree.map(lax.stop_gradient, self.motion_in(here, states)).force
        lets_go = [h & r for h, r in zip(hit, rest, strict=True)]
        failed: Any = False
        ways = []
        limits = zip(here.static.lower, here.static.high, strict=True)
        for c, go, borne, (low, high) in zip(self.rows, lets_go, force, limits, strict=True):
            sense: Any = 1.0  # a stop moves off
            bears = borne != 0.0
            if high is not NO_LIMIT:
                # The contact slides against the force that it carried, be that one of 0.
                contact = here.contacts[len(ways)]
                odd = contact.law.is_odd
                sense = where(borne > 0.0 if odd else high - borne < borne - low, -1.0, 1.0)
                bears = bears if odd else bears | (contact.normal_force > 0.0)
            ways.append(where(go, sense, 0.0))
            if c in self.part.lifting:
                # A contact that bears nothing gives way only where nothing presses it on any more.
                failed = failed | (go & ~bears)
        gives_way = any_of(lets_go)
        return Release(tuple(ways), gives_way, any_of(hit) & ~gives_way, failed)

    def overload(
        self, lines: list, bounds: Bounds, rest: NumberRow, motion: Motion, still: Any
    ) -> Overload:
        if self.stops:
            # The share of what can be borne has no meaning: of a stop it is 0 or infinite.
            left = [lower_of(*pair) for pair in reserves(bounds, motion.force)]
            values = [where(r, -x, -jnp.inf) for r, (x, _) in zip(rest, left, strict=True)]
            most, ways = least_first(values, [way for _, way in left])
            return Overload(most > still, ways)
        shares, senses = [], []
        for r, low, high, borne in zip(rest, bounds.lower, bounds.high, motion.force, strict=True):
            share = where(borne > 0.0, borne / (high + still), borne / (low - still))
            shares.append(where(r, share, UNRESISTED))
            senses.append(where(borne > 0.0, -1.0, 1.0))
        most, ways = least_first(shares, senses, UNRESISTED)
        return Overload(most > 1.0, ways)


class _AbstractFixedDirections(AbstractIndependentContacts):
    """Independent constant directions are taken as coordinates.

    A contact that rests is then an equation that is left out, and its speed is held to the last digit.
    """

    def __init__(self, part: Part):
        super().__init__(part)
        self.inverse = completed_inverse(part.directions)
        self.decoupled = decoupled_inertia(part, self.inverse)

    def motion(self, M: Mass, F: Any, J: list[list], rest: NumberRow, gamma: list) -> Motion:
        if self.m == self.n == 1:
            return _motion_of_one(M, F, J[0][0], rest[0], gamma[0])
        T = self.inverse
        columns = [[float(x) for x in T[:, i]] for i in range(self.n)]
        momenta = [M.times(column) for column in columns]
        inertia = [
            [0.0 if self.decoupled[i, j] else dot(column, p) for j, p in enumerate(momenta)]
            for i, column in enumerate(columns)
        ]
        force = [dot(column, F) for column in columns]
        everything = range(self.n)
        held = [rest[i] if i < self.m else None for i in everything]

        def kept(i: int, j: int) -> Any:
            if is_zero(inertia[i][j]):
                return 0.0
            those = [h for h in (held[i], held[j]) if h is not None]
            if not those:
                return inertia[i][j]
            return where(any_of(those), 1.0 if i == j else 0.0, inertia[i][j])

        A = [[kept(i, j) for j in everything] for i in everything]
        surface = [choose(r, g, 0.0) for r, g in zip(rest, gamma, strict=True)]
        b = [
            minus(f, total(times(inertia[i][j], surface[j]) for j in range(self.m)))
            for i, f in enumerate(force)
        ]
        b = [
            x if h is None else where(h, gamma[i], x)
            for i, (h, x) in enumerate(zip(held, b, strict=True))
        ]
        along = Factors(A).solve(b)
        borne = [where(rest[i], minus(dot(inertia[i], along), force[i]), 0.0) for i in range(self.m)]
        return Motion(tuple(dot([float(x) for x in row], along) for row in T), (), tuple(borne))

    def nearest_velocities(self, here, still, kept=None):
        # One velocity that its contact decides needs no projection.
        return (
            here.velocities if self.m == self.n == 1 else super().nearest_velocities(here, still, kept)
        )


class SeparateContacts(_AbstractFixedDirections):
    """Contacts and stops that change no other's acceleration: the law of each decides."""

    separate = True

    @classmethod
    def takes(cls, part: Part) -> bool:
        if part.varies or part.dependent:
            return False
        apart = decoupled_inertia(part, completed_inverse(part.directions)) | np.eye(
            len(part.columns), dtype=bool
        )
        return len(part.rows) == 1 or bool(apart.all())

    def law(self, problem):
        return states_one_by_one(problem)


class CoupledContacts(_AbstractFixedDirections):
    """Contacts and stops of independent constant directions that inertia couples."""

    @classmethod
    def takes(cls, part: Part) -> bool:
        return not (part.varies or part.dependent)


def states_one_by_one(problem: Problem) -> tuple[NumberRow, Any]:
    """The law of contacts that do not feel each other: what each would bear at rest decides."""
    problem = problem.without_slopes()
    every = tuple(jnp.ones_like(s, bool) for s in problem.states)
    limits = zip(problem.static.lower, problem.static.high, strict=True)
    forces, after = problem.moves(problem.force, every).force, []
    for s, borne, (low, high) in zip(problem.states, forces, limits, strict=True):
        leaves = where(borne < low, 1.0, 0.0)
        if high is not NO_LIMIT:
            leaves = where(borne > high, -1.0, leaves)
        after.append(where(s == 0.0, leaves, s))
    return tuple(after), every[0]


def decoupled_inertia(part: Part, inverse: np.ndarray) -> np.ndarray:
    """Inertia between speeds along contacts that vanishes whatever the parameters are."""
    n = len(part.columns)
    if part.inertia is None:
        return np.zeros((n, n), bool)
    inertia = part.inertia.reshape(-1, n, n)
    sizes = np.abs(inverse.T) @ np.abs(inertia) @ np.abs(inverse)
    return np.all(np.abs(inverse.T @ inertia @ inverse) <= ENGINE.slack * sizes, axis=0)


def _motion_of_one(M: Mass, F: Any, n: Any, rests: Any, gamma: Any) -> Motion:
    (m,) = M.diagonal or (M.full or [[None]])[0]
    held = times(over(n), gamma)
    needed = where(rests, minus(times(m, held), F[0]), 0.0)
    return Motion((where(rests, held, F[0] / m),), (needed,), (times(1.0 / n, needed),))
