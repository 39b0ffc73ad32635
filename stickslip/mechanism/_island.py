"""Velocities that contacts and inertia couple, and their motion while some of the contacts rest.

Contacts of different islands cannot change each other's accelerations, so each island is treated alone:
the cost of a mechanism grows with the sizes of its islands and not with the number of its modes.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import SMOOTH, where

from ._directions import SMALL, completed_inverse, lines_of, null_space
from ._scalars import Factors, Mass, any_of, chosen, dot, is_zero, minus, over, times, total

MOST_DEPENDENT = 12  # contacts of an island with dependent directions: tables over all sets of them
NOTHING = 1e-150  # its square is a number too, which derivatives divide by
UNRESISTED = -1.0  # share of a line that no resting contact resists


class Motion(NamedTuple):
    """Motion while each contact rests or slides in a known sense.

    - `acceleration` of each velocity;
    - `reaction`: generalised force of all resting contacts together, unique even where theirs are not;
    - `force` of each resting contact, 0 where it slides. Of contacts with dependent directions, those
      that lead bear all of it.
    """

    acceleration: list[Any]
    reaction: list[Any]
    force: list[Any]


class Island:
    r"""Some velocities and contacts of a mechanism, with all that is known of them while tracing.

    With the inertia $M$, the directions $J$ and the forces $F$ (friction of the sliding contacts among
    them) the contacts $H$ that rest bear $\lambda_H$:

    $$M a = F + J_H^T\lambda_H, \qquad J_H a = \gamma_H
      \quad\Rightarrow\quad (J_H M^{-1} J_H^T)\,\lambda_H = \gamma_H - J_H M^{-1} F$$

    Where directions depend on each other, a largest independent part of $H$ leads and bears all.
    Constant directions that do not are taken as coordinates: a contact that rests is then an equation
    that is left out, and its speed is held to the last digit.

    A stop is a contact like the others, with the gradient of its gap as direction, that can bear any
    force off it and none towards it. The last `stops` of the rows are stops.
    """

    def __init__(
        self,
        columns: tuple[int, ...],
        rows: tuple[int, ...],
        directions: np.ndarray,
        inertia: np.ndarray | None = None,
        stops: int = 0,
    ):
        self.columns, self.rows, self.directions = columns, rows, directions
        self.m, self.n = directions.shape
        self.stops, self.contacts = stops, self.m - stops
        self.varies = bool(np.isnan(directions).any())
        # A direction that varies is taken to be in general position.
        generic = np.random.default_rng(0).normal(size=directions.shape)
        known = np.where(np.isnan(directions), generic, directions)
        self.rank = int(np.linalg.matrix_rank(known)) if self.m else 0
        self.dependent = self.rank < self.m
        self.alone = (self.m, self.n) == (1, 1)
        # One velocity and a stop: what rests, holds it.
        self.shut = self.n == 1 and self.m > 1 and stops > 0
        if self.shut:
            self.dependent = self.contacts > 0  # stops alone bear the load one at a time
        elif self.dependent and not self.varies and self.m <= MOST_DEPENDENT:
            self._tabulate()
        if self.rank == self.m and not self.varies:
            self.inverse = T = completed_inverse(directions)
            # Inertia between speeds along contacts that vanishes whatever the parameters are.
            self.parted = np.zeros((self.n, self.n), bool)
            if inertia is not None:
                parts = inertia.reshape(-1, self.n, self.n)
                sizes = np.abs(T.T) @ np.abs(parts) @ np.abs(T)
                self.parted[:] = (np.abs(T.T @ parts @ T) <= 1e-12 * sizes).all(axis=0)

    @property
    def separate(self) -> bool:
        """Whether what one contact or stop bears changes the acceleration along no other."""
        if self.m == 1:
            return True
        return (
            not self.dependent
            and not self.shut
            and not self.varies
            and bool((self.parted | np.eye(self.n, dtype=bool)).all())
        )

    def _tabulate(self) -> None:
        J, m = self.directions, self.m
        self.leaders = np.zeros(2**m, np.int32)  # an independent part of each set, as bits
        self.closure = np.zeros(2**m, np.int32)  # contacts that rest wherever the set does
        self.covered = np.zeros(2**m, np.int32)  # contacts whose speed is proportional to another's
        for bits in range(2**m):
            rest = [c for c in range(m) if bits >> c & 1]
            leaders: list[int] = []
            for c in rest:
                if np.linalg.matrix_rank(J[[*leaders, c]]) > len(leaders):
                    leaders.append(c)
            self.leaders[bits] = sum(1 << c for c in leaders)
            speeds = J @ null_space(J[leaders], self.n)
            still = [c for c in range(m) if np.abs(speeds[c]).max(initial=0.0) < SMALL]
            self.closure[bits] = sum(1 << c for c in still)
            seen: list[np.ndarray] = []
            for c in range(m):
                if c in still:
                    continue
                unit = speeds[c] / np.linalg.norm(speeds[c])
                if any(abs(abs(unit @ other) - 1.0) < SMALL for other in seen):
                    self.covered[bits] |= 1 << c
                else:
                    seen.append(unit)
        # Combinations of the sliding speeds that no velocity changes.
        self.fixed = null_space(J.T, m)
        self.lines = lines_of(J)
        self.along = np.where(np.abs(self.lines @ J.T) < SMALL, 0.0, self.lines @ J.T)

    def _looked_up(self, table: np.ndarray, rest: list[Any]) -> list[Any]:
        parts = (where(r, jnp.int32(1 << c), jnp.int32(0)) for c, r in enumerate(rest))
        bits = jnp.asarray(table)[functools.reduce(lambda a, b: a + b, parts)]
        return [((bits >> jnp.int32(c)) & jnp.int32(1)) == 1 for c in range(self.m)]

    def closed(self, rest: list[Any], slow: list[Any]) -> list[Any]:
        """`rest`, and the contacts that rest wherever these do: those of them without speed, `slow`."""
        if self.shut:
            some = any_of(rest)
            return [r | (some & s) for r, s in zip(rest, slow, strict=True)]
        if not self.dependent:
            return rest
        with_them = self._looked_up(self.closure, rest)
        return [r | (w & s) for r, w, s in zip(rest, with_them, slow, strict=True)]

    def tied(self, rest: list[Any], surface: list[Any]) -> list[Any]:
        """Contacts whose sliding speed is proportional to that of an earlier one while `rest` rest.

        None unless the speeds of the surfaces `agree`: two belts of different speeds under one body
        stop sliding at different times.
        """
        if self.shut:
            return [rest[0] & False] * self.m
        agree = self.agree(surface)
        return [t & agree for t in self._looked_up(self.covered, rest)]

    def agree(self, surface: list[Any]) -> Any:
        """Whether the speeds of the surfaces are those of one rigid motion of them all.

        What the resting contacts hold then has no speed at all, whatever rounding left of it.
        """
        every: Any = True
        for column in self.fixed.T.tolist():
            terms = [times(x, w) for x, w in zip(column, surface, strict=True) if x]
            if not all(map(is_zero, terms)):
                size = total(abs(term) for term in terms)
                every = every & (jnp.abs(jnp.asarray(total(terms))) <= SMALL * size)
        return every

    def motion(self, M: Mass, F: list, J: list[list], rest: list, gamma: list) -> Motion:
        """Motion while the contacts in `rest` have the relative acceleration `gamma`."""
        if self.alone:
            return self._of_one(M, F, J, rest, gamma)
        if self.shut:
            return self._of_one_velocity(M, F, J, rest, gamma)
        if not self.m:
            return Motion(M.solve(F), [], [])
        if not self.dependent and not self.varies:
            return self._along_contacts(M, F, rest, gamma)
        free = M.solve(F)
        mobility = [M.solve(row) for row in J]
        gram = [[dot(p, row) for row in J] for p in mobility]
        held = self._looked_up(self.leaders, rest) if self.dependent else rest
        # Stops bear before friction does, where directions that vary turn out to depend on each other.
        order = [*range(self.contacts, self.m), *range(self.contacts)]
        A = [
            [
                where(held[c], self._resisting(gram[c][c]), 1.0)
                if c == d
                else 0.0
                if is_zero(gram[c][d])
                else where(held[c] & held[d], gram[c][d], 0.0)
                for d in order
            ]
            for c in order
        ]
        sought = [minus(g, dot(row, free)) for g, row in zip(gamma, J, strict=True)]
        factors = Factors(A, semidefinite=self.varies)
        solved = factors.solve([where(held[c], sought[c], 0.0) for c in order])
        force = [solved[order.index(c)] for c in range(self.m)]
        a = [
            total((x, *(times(mobility[c][j], force[c]) for c in range(self.m))))
            for j, x in enumerate(free)
        ]
        for c in range(self.m):
            # A velocity that a resting contact alone decides has no rounding of a sum.
            own = [j for j in range(self.n) if not is_zero(J[c][j])]
            if len(own) == 1:
                (j,) = own
                a[j] = where(self.decides(rest[c], J[c][j]), times(over(J[c][j]), gamma[c]), a[j])
            elif np.isnan(self.directions[c]).any():
                a = self._decided(a, J[c], own, rest[c], gamma[c])
        reaction = [total(times(J[c][j], force[c]) for c in range(self.m)) for j in range(self.n)]
        if self.rank == self.n and all(map(is_zero, gamma)):
            leads = [held[c] & ~d for c, d in zip(order, factors.depends, strict=False)]
            every = total(where(h, 1, 0) for h in leads or held) == self.n
            a = [where(every, 0.0, x) for x in a]
            reaction = [where(every, times(-1.0, f), x) for f, x in zip(F, reaction, strict=True)]
        return Motion(a, reaction, force)

    def _resisting(self, share: Any) -> Any:
        """What a force of 1 N in a contact changes of its own acceleration [1/kg].

        Where its direction vanishes it changes nothing: to rest would take a force without bound.
        """
        with jax.named_scope(SMOOTH):
            return jnp.maximum(share, NOTHING) if self.varies else share

    def decides(self, rests: Any, n: Any) -> Any:
        """Whether a resting contact decides the velocity that its direction has the entry `n` for."""
        return rests & (n != 0.0) if self.varies else rests

    def _decided(self, a: list, n: list, own: list[int], rests: Any, gamma: Any) -> list[Any]:
        """`a`, of which a contact that rests decides the velocity along its largest entry.

        What it holds alone as its other entries vanish then has no acceleration at all, where rounding
        of the forces that cancel would be the whole motion.
        """
        found, sizes = list(a), [jnp.abs(jnp.asarray(n[j])) for j in own]
        for place, j in enumerate(own):
            others = [i for i in own if i != j]
            leads = rests & (sizes[place] > 0.0)
            for other, size in enumerate(sizes):
                if other != place:
                    leads &= sizes[place] > size if other < place else sizes[place] >= size
            rate = minus(gamma, dot([n[i] for i in others], [a[i] for i in others]))
            found[j] = where(leads, times(over(n[j]), rate), a[j])
        return found

    def _along_contacts(self, M: Mass, F: list, rest: list, gamma: list) -> Motion:
        """The same with the speeds along the contacts, and some others, as velocities."""
        T = self.inverse
        columns = [[float(x) for x in T[:, i]] for i in range(self.n)]
        momenta = [M.times(column) for column in columns]
        inertia = [
            [0.0 if self.parted[i, j] else dot(column, p) for j, p in enumerate(momenta)]
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
        surface = [chosen(r, g, 0.0) for r, g in zip(rest, gamma, strict=True)]
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
        return Motion([dot([float(x) for x in row], along) for row in T], [], borne)

    def _of_one(self, M: Mass, F: list, J: list[list], rest: list, gamma: list) -> Motion:
        (m,), n = M.diagonal or (M.full or [[None]])[0], J[0][0]
        held = times(over(n), gamma[0])
        if self.varies:
            free = F[0] / m
            needed = minus(gamma[0], times(n, free)) / self._resisting(times(n, n) / m)
            needed = where(rest[0], needed, 0.0)
            return Motion([where(self.decides(rest[0], n), held, free)], [times(n, needed)], [needed])
        a = where(rest[0], held, F[0] / m)
        needed = where(rest[0], minus(times(m, held), F[0]), 0.0)
        return Motion([a], [needed], [times(1.0 / n, needed)])

    def _of_one_velocity(self, M: Mass, F: list, J: list[list], rest: list, gamma: list) -> Motion:
        (m,) = M.diagonal or (M.full or [[None]])[0]
        # The first that rests leads; stops come before friction.
        order = [*range(self.contacts, self.m), *range(self.contacts)]
        held: Any = 0.0
        for c in reversed(order):
            held = chosen(rest[c], times(1.0 / J[c][0], gamma[c]), held)
        some = any_of(rest)
        a = where(some, held, F[0] / m)
        needed = where(some, minus(times(m, held), F[0]), 0.0)
        force: list[Any] = [None] * self.m
        leads = rest[order[0]]
        led = leads
        for c in order:
            force[c] = where(leads, times(1.0 / J[c][0], needed), 0.0)
            if c != order[-1]:
                following = rest[order[order.index(c) + 1]]
                leads, led = following & ~led, led | following
        return Motion([a], [needed], force)

    def project(self, M: Mass, v: list, J: list[list], rest: list, speeds: list) -> list:
        """The velocities nearest to `v`, by the inertia, at which those in `rest` do not slide."""
        none = [jnp.zeros_like(x) for x in v]
        change = self.motion(M, none, J, rest, [times(-1.0, u) for u in speeds]).acceleration
        some = any_of(rest)
        return [where(some, x + d, x) for x, d in zip(v, change, strict=True)]

    def onset(
        self, low: list, high: list, rest: list, motion: Motion, slack: Any = NOTHING
    ) -> tuple[Any, list[Any]]:
        r"""How much of the friction the contacts in `rest` use, and the way in which they give way.

        Each contact bears $\lambda_c$ between `low` and `high`, an interval around 0. Returns the share
        of what can be borne, beyond 1 where the contacts give way, `UNRESISTED` where none rests; and
        the sense of each as they do so, 0 for those that stay. `slack` [N] more can be borne.

        Of dependent contacts the forces are not unique. The reaction $f$ can be borne if
        $f\cdot d \le \sum_H \max_\lambda(\lambda_c\,n_c\cdot d)$ along both senses of every line $d$
        on which all but one degree of freedom is held: they are the normals of the facets of the
        zonotope that the contacts span.
        """
        like = jnp.zeros_like(low[0])
        used, sense, number = like + UNRESISTED, like, jnp.zeros_like(like, jnp.int32)
        if not self.dependent:
            for c, r in enumerate(rest):
                borne = motion.force[c]
                share = where(borne > 0.0, borne / (high[c] + slack), borne / (low[c] - slack))
                more = r & (share > used)
                used = where(more, share, used)
                sense = where(more, where(borne > 0.0, -1.0, 1.0), sense)
                number = where(more, jnp.int32(c), number)
            return used, [where(r & (number == c), sense, 0.0) for c, r in enumerate(rest)]
        low = [where(r, x, 0.0) for r, x in zip(rest, low, strict=True)]
        high = [where(r, x, 0.0) for r, x in zip(rest, high, strict=True)]
        for i, (line, along) in enumerate(zip(self.lines.tolist(), self.along.tolist(), strict=True)):
            on = [c for c in range(self.m) if along[c]]
            load = dot(line, motion.reaction)
            most = total(times(along[c], high[c] if along[c] > 0 else low[c]) for c in on)
            least = total(times(along[c], low[c] if along[c] > 0 else high[c]) for c in on)
            share = where(load > 0.0, load / (most + slack), load / (least - slack))
            more = any_of(rest[c] for c in on) & (share > used)
            used = where(more, share, used)
            # The reaction pushes back: they give way against it.
            sense = where(more, where(load > 0.0, -1.0, 1.0), sense)
            number = where(more, jnp.int32(i), number)
        ways = jnp.asarray(np.sign(self.along))[number]
        return used, [where(r, sense * ways[c], 0.0) for c, r in enumerate(rest)]


@functools.lru_cache(maxsize=256)
def islands_of(
    directions: bytes,
    shape: tuple[int, int],
    coupled: bytes,
    inertia: bytes = b"",
    stops: int = 0,
) -> tuple[Island, ...]:
    """The islands of contacts with these directions [contact, velocity] and coupled velocities.

    `inertia`: constant matrices that the mass matrix is a combination of, if they are known. The last
    `stops` rows are stops. All arrays as bytes, so that a mechanism is analysed once.
    """
    J = np.frombuffer(directions).reshape(shape)
    n = shape[1]
    M = np.frombuffer(inertia).reshape(-1, n, n) if inertia else None
    joined = np.frombuffer(coupled, bool).reshape(n, n).copy()
    for row in J:
        touched = np.isnan(row) | (row != 0)
        joined |= np.outer(touched, touched)
    label = list(range(n))
    for _ in range(n):
        for i, j in zip(*np.nonzero(joined), strict=True):
            label[i] = label[j] = min(label[i], label[j])
    found = []
    for one in sorted(set(label)):
        columns = tuple(j for j in range(n) if label[j] == one)
        part = J[:, columns]
        rows = tuple(c for c in range(len(J)) if (np.isnan(part[c]) | (part[c] != 0)).any())
        own = sum(c >= len(J) - stops for c in rows)
        block = None if M is None else M[:, columns][:, :, columns]
        found.append(Island(columns, rows, part[list(rows)], block, own))
    return tuple(found)
