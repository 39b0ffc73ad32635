"""Contacts with constant directions that depend on each other: they give way together."""

import abc
import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip._fastmath import where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._accuracy import ACCURACY
from ._directions import lines_of, null_space
from ._group import AbstractContactGroup, Fired, Guards, Release
from ._laws import Bounds
from ._local import LocalInstant, Part
from ._motion import Motion, motion_by_forces
from ._reserve import least_reserve
from ._rows import NumberRow, any_of, any_through, constants, each, first_greatest, row, through
from ._scalars import Mass, is_zero, times, total, without_slope
from ._search import UNRESISTED, Overload, Problem, resting


class Tables(NamedTuple):
    """All that constant directions say of all sets of contacts, each set a number of bits.

    - `leaders`: an independent part of each set; `closure`: contacts that rest wherever it does;
      `covered`: contacts whose speed is then proportional to that of another.
    - `fixed`: combinations of the sliding speeds that no velocity changes.
    - `lines` on which all but one degree of freedom is held, and `along`, the directions on them.
    """

    leaders: np.ndarray
    closure: np.ndarray
    covered: np.ndarray
    fixed: np.ndarray
    lines: np.ndarray
    along: np.ndarray


@functools.lru_cache(maxsize=256)
def tables_of(directions: bytes, m: int) -> Tables:
    """Of directions `[contact, velocity]`, as bytes so that they are analysed once."""
    J = np.frombuffer(directions).reshape(m, -1)
    n, small = J.shape[1], ENGINE.zero
    leading, closure, covered = (np.zeros(2**m, np.int32) for _ in range(3))
    for bits in range(2**m):
        leaders: list[int] = []
        for c in (c for c in range(m) if bits >> c & 1):
            if np.linalg.matrix_rank(J[[*leaders, c]]) > len(leaders):
                leaders.append(c)
        leading[bits] = sum(1 << c for c in leaders)
        speeds = J @ null_space(J[leaders], n)
        still = [c for c in range(m) if np.abs(speeds[c]).max(initial=0.0) < small]
        closure[bits] = sum(1 << c for c in still)
        seen: list[np.ndarray] = []
        for c in (c for c in range(m) if c not in still):
            unit = speeds[c] / np.linalg.norm(speeds[c])
            if any(abs(abs(unit @ other) - 1.0) < small for other in seen):
                covered[bits] |= 1 << c
            else:
                seen.append(unit)
    lines = lines_of(J)
    along = np.where(np.abs(lines @ J.T) < small, 0.0, lines @ J.T)
    return Tables(leading, closure, covered, null_space(J.T, m), lines, along)


class _AbstractDependentContacts(AbstractContactGroup):
    """Load that dependent contacts share: a largest independent part of those that rest leads and bears
    all.

    All that give way have one guard together.
    """

    def __init__(self, part: Part):
        super().__init__(part)
        self.tables = tables_of(np.ascontiguousarray(part.directions).tobytes(), self.m)

    @property
    def joint_guards(self) -> int:
        return 1

    def not_followed(self, moving, still, straight):
        return moving

    def motion(self, M: Mass, F: Any, J: list[list], rest: NumberRow, gamma: list) -> Motion:
        rest = tuple(rest)
        held = looked_up(self.tables.leaders, rest)
        return motion_by_forces(self.part, M, tuple(F), J, rest, held, gamma)

    def closure(self, rest: NumberRow, slow: NumberRow) -> NumberRow:
        held = looked_up(self.tables.closure, rest)
        return each(lambda r, w, s: r | (w & s), rest, held, slow)

    def agree(self, surfaces: list[Any]) -> Any:
        """Whether the speeds of the surfaces are those of one rigid motion of them all.

        A velocity that the resting contacts hold has no speed at all, whatever rounding left of it.
        """
        every: Any = True
        for column in self.tables.fixed.T.tolist():
            terms = [times(x, w) for x, w in zip(column, surfaces, strict=True) if x]
            if not all(map(is_zero, terms)):
                size = total(abs(term) for term in terms)
                every = every & (jnp.abs(jnp.asarray(total(terms))) <= ENGINE.zero * size)
        return every

    def tied_contacts(self, here: LocalInstant, own: NumberRow) -> NumberRow:
        """Contacts whose sliding speed is proportional to that of an earlier one while others rest.

        None unless the speeds of the surfaces `agree`: two belts of different speeds under one body
        stop sliding at different times. And none while one is open, which looks after no other.
        """
        agree = self.agree(here.surfaces)
        opens = [own[i] == 2.0 for i, c in enumerate(self.rows) if c in self.part.opening]
        if opens:
            agree = agree & ~any_of(tuple(opens))
        covered = looked_up(self.tables.covered, resting(own))
        return covered if agree is True else each(lambda t: t & agree, covered)

    @abc.abstractmethod
    def carries(self, here: LocalInstant) -> Any:
        """Whether what the resting contacts hold rests with them, slow or not, as `agree` says."""

    def still(self, here: LocalInstant, own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow:
        on, carries = super().still(here, own, hit, stops), self.carries(here)
        held = looked_up(self.tables.closure, on)
        if carries is not True:
            slow = self.slow_then(here, own, hit, stops)
            held = each(lambda h, x: h & (x | carries), held, slow)
        if self.part.opening:
            held = each(lambda h, s: h & (s != 2.0), held, own)
        return each(lambda r, h: r | h, on, held)


class DependentContacts(_AbstractDependentContacts):
    """Dependent contacts side by side, in rows.

    A program of a few vectors is shorter than one of all contacts and pairs of them, written out, and
    compiles as much faster.
    """

    @classmethod
    def takes(cls, part: Part) -> bool:
        return part.dependent and not part.varies and not part.stops and _few(part)

    def row(self, values: Any) -> NumberRow:
        return row(values)

    def own_states(self, states: Any) -> NumberRow:
        if isinstance(states, tuple | list) or self.rows != tuple(range(len(states))):
            return super().own_states(states)
        return states

    def with_own(self, states: Any, own: NumberRow) -> Any:
        return own if self.rows == tuple(range(len(states))) else super().with_own(states, own)

    def with_friction(self, lines: list, force: NumberRow, friction: NumberRow) -> NumberRow:
        return each(lambda f, g: f + g, force, through(self.directions.T, friction))

    def slips(self, problem: Problem, acceleration: NumberRow) -> NumberRow:
        return through(self.directions, acceleration)

    def mover(self, here):
        def motion(M, F, J, rest, gamma):
            acceleration, reaction = here.motion_together(self, M, F, rest)
            return Motion(acceleration, reaction, None)

        return motion

    def guards(self, here: LocalInstant, states: Any) -> Guards:
        own = self.own_states(states)
        # One of those that always slide together is enough; two would count as coincident.
        found = each(
            lambda s, tied, u: where((s == 0.0) | tied, 1.0, s * u),
            own, self.tied_contacts(here, own), here.speeds,
        )  # fmt: skip
        reaction = self.motion_in(here, states).reaction
        share = self.onset(here.static, resting(own), reaction).share
        return Guards(found, {}, (1.0 - jnp.minimum(share, ENGINE.most),))

    def hit(self, fired: Fired) -> NumberRow:
        numbers = constants([fired.numbers[c][0] for c in self.rows], np.int32)
        return each(lambda number: number == fired.guard, numbers)

    def release(self, here: LocalInstant, states: Any, hit: NumberRow, fired: Fired) -> Release:
        reaction = lax.stop_gradient(self.motion_in(here, states).reaction)
        ways = self.onset(here.static, resting(self.own_states(states)), reaction).ways
        return Release(ways, fired.guard == fired.joint[self.rows[0]], any_of(hit))

    def carries(self, here: LocalInstant) -> Any:
        # Beside speeds that are all rounding none of them is small.
        return self.agree(here.surfaces)

    def at_rest(self, here: LocalInstant, still: NumberRow, kept: NumberRow | None = None) -> NumberRow:
        if not all(map(is_zero, here.surfaces)):
            return self.row(super().at_rest(here, tuple(still)))
        momenta = self.row(here.mass.times([here.at.v[j] for j in self.columns]))
        return self.mover(here)(here.mass, momenta, here.lines, still, here.gamma).acceleration

    def overload(
        self, lines: list, bounds: Bounds, rest: NumberRow, motion: Motion, still: Any
    ) -> Overload:
        onset = self.onset(bounds, rest, motion.reaction, still)
        return Overload(onset.share > 1.0, onset.ways)

    def onset(
        self, bounds: Bounds, rest: NumberRow, reaction: NumberRow, slack: Any = ENGINE.tiny
    ) -> "Onset":
        r"""How much of the friction the contacts in `rest` use, and the way in which they give way.

        Each contact bears $\lambda_c$ between `bounds` around 0. Beyond a share of 1 they give
        way, each in the sense `ways`, 0 for those that stay. `slack` [N] more can be borne.

        The forces of dependent contacts are not unique. Their reaction $f$ can be borne if
        $f\cdot d \le \sum_H \max_\lambda(\lambda_c\,n_c\cdot d)$ along both senses of every line $d$
        on which all but one degree of freedom is held: they are the normals of the facets of the
        zonotope that the contacts span.
        """
        along = self.tables.along
        loads = through(self.tables.lines, reaction)
        high = each(lambda r, x: where(r, x, 0.0), rest, bounds.high)
        if bounds.low is None:
            most = through(np.abs(along), high)
        else:
            low = each(lambda r, x: where(r, x, 0.0), rest, bounds.low)
            up, down = np.maximum(along, 0.0), np.minimum(along, 0.0)
            upwards = each(lambda a, b: a + b, through(up, high), through(down, low))
            downwards = each(lambda a, b: -(a + b), through(up, low), through(down, high))
            most = each(lambda load, a, b: where(load > 0.0, a, b), loads, upwards, downwards)
        shares = each(
            lambda on, load, most: where(on, jnp.abs(load) / (most + slack), UNRESISTED),
            any_through(along, rest), loads, most,
        )  # fmt: skip
        share, number, load = first_greatest(shares, UNRESISTED, loads)
        # The reaction pushes back: they give way against it.
        sense = where(load > 0.0, -1.0, 1.0)
        ways: Any = jnp.asarray(np.sign(along))[number]
        if isinstance(rest, tuple):
            ways = tuple(ways[c] for c in range(len(rest)))
        return Onset(share, each(lambda r, way: where(r, sense * way, 0.0), rest, ways))


class Onset(NamedTuple):
    """Share of their friction that contacts use, -1 where none rests, and how they would give way."""

    share: Any
    ways: NumberRow


class DependentWithStops(_AbstractDependentContacts):
    """Contacts and stops of several velocities whose directions depend on each other."""

    @classmethod
    def takes(cls, part: Part) -> bool:
        return part.dependent and not part.varies and part.stops > 0 and _few(part)

    def carries(self, here: LocalInstant) -> Any:
        return False

    def reserve(self, bounds: Bounds, rest: NumberRow, motion: Motion) -> tuple[Any, NumberRow]:
        """Force that is left until the contacts in `rest` give way [N], and how they would."""
        lines, along = self.tables.lines.tolist(), self.tables.along.tolist()
        loads = [total(map(times, line, motion.reaction)) for line in lines]
        return least_reserve(bounds, rest, along, loads)

    def guards(self, here: LocalInstant, states: Any) -> Guards:
        own, tied = self.own_states(states), self.tied_contacts(here, self.own_states(states))
        found = [
            where((s == 0.0) | t, 1.0, s * u) for s, t, u in zip(own, tied, here.speeds, strict=True)
        ]
        gaps = [
            where(s == 0.0, 1.0, g) for s, g in zip(own[self.contacts :], self.gaps(here), strict=True)
        ]
        left, _ = self.reserve(here.static, resting(own), self.motion_in(here, states))
        return Guards((*found[: self.contacts], *gaps), {}, (where(left < jnp.inf, left, 1.0),))

    def release(self, here: LocalInstant, states: Any, hit: NumberRow, fired: Fired) -> Release:
        motion = jax.tree.map(lax.stop_gradient, self.motion_in(here, states))
        _, ways = self.reserve(without_slope(here.static), resting(self.own_states(states)), motion)
        return Release(ways, fired.guard == fired.joint[self.rows[0]], any_of(hit))

    def overload(
        self, lines: list, bounds: Bounds, rest: NumberRow, motion: Motion, still: Any
    ) -> Overload:
        left, ways = self.reserve(bounds, rest, motion)
        return Overload(left < -still, ways)


def _few(part: Part) -> bool:
    return len(part.rows) <= ACCURACY.most_dependent


def number_of(rest: NumberRow) -> Any:
    """The set of contacts `rest` as bits."""
    if isinstance(rest, tuple):
        return sum(where(r, jnp.int32(1 << c), jnp.int32(0)) for c, r in enumerate(rest))
    return jnp.sum(rest.astype(jnp.int32) * 2 ** np.arange(len(rest), dtype=np.int32), dtype=jnp.int32)


def looked_up(table: np.ndarray, rest: NumberRow) -> NumberRow:
    """The contacts that a table of sets holds for the set `rest`."""
    m, number = len(rest), number_of(rest)
    if isinstance(rest, tuple):
        bits = jnp.asarray(table)[number]
        return tuple((bits & jnp.int32(1 << c)) != 0 for c in range(m))
    return jnp.asarray((table[:, None] >> np.arange(m)) % 2 == 1)[number]


def motion_in_rows(
    group: AbstractContactGroup, mass: Mass, force: NumberRow, rest: NumberRow
) -> tuple[NumberRow, NumberRow]:
    """Motion in rows: acceleration of each velocity, and force of all that rests."""
    still = [0.0] * group.m
    found = group.motion(mass, tuple(force), group.directions.tolist(), tuple(rest), still)
    return row(found.acceleration), row(found.reaction)
