"""Which contacts of a group begin to slide, and in which sense: their law at one instant."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from stickslip._fastmath import where
from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._accuracy import ACCURACY
from ._laws import NO_LIMIT, Bounds
from ._motion import Motion
from ._rows import NumberRow, any_of, each, first_greatest, through, with_place
from ._scalars import Mass, dot, is_zero, minus, over, times, total, without_slope

# Less than the share of its friction that any contact uses, and than a part of a way taken negative.
UNRESISTED = -2.0


class Problem(NamedTuple):
    r"""The law of all contacts of a group at one instant.

    $$a = \arg\min \tfrac12 a^T M a - a^T F
      + \sum_{c\ \text{without speed}} \phi_c(n_c\cdot a - \gamma_c)$$

    For a contact at rest $\phi_c$ is its static friction times the relative acceleration.

    - `mass` $M$; `force` $F$, a row, without the friction of contacts that have no speed;
    - `lines`: the directions $n_c$; `gamma`: accelerations of their surfaces;
    - `static`, `kinetic`: the limits of friction [N];
    - `motion`: the `Motion`, of mass, forces, directions, of what rests and with which acceleration;
    - `states`: 0 for every contact at rest; `started`: contacts with a sense that have no speed yet;
      `active`: whether the answer is wanted;
    - `passing`: the sense beyond its zero of a contact whose speed has just passed through it, else 0;
      None where none can.
    """

    mass: Mass
    force: NumberRow
    lines: list[list[Any]]
    gamma: list[Any]
    static: Bounds
    kinetic: Bounds
    motion: Callable[..., Motion]
    states: NumberRow
    started: NumberRow
    active: Any
    passing: NumberRow | None = None

    @property
    def standing(self) -> NumberRow:
        """Contacts without speed."""
        return each(lambda s, start: (s == 0.0) | start, self.states, self.started)

    def moves(self, force: NumberRow, rest: NumberRow) -> Motion:
        """Motion under `force` while the contacts in `rest` rest."""
        return self.motion(self.mass, force, self.lines, rest, self.gamma)

    def without_slopes(self) -> "Problem":
        """The same without derivatives: senses have none."""
        parts = self.force, self.lines, self.gamma, self.static, self.kinetic, self.states
        force, lines, gamma, static, kinetic, states = without_slope(parts)
        return self._replace(
            mass=Mass(without_slope(self.mass.diagonal), without_slope(self.mass.full)),
            force=force, lines=lines, gamma=gamma, static=static, kinetic=kinetic, states=states,
        )  # fmt: skip


class Overload(NamedTuple):
    """Whether contacts at rest bear more than they can, and the senses in which they give way."""

    beyond: Any
    ways: NumberRow


class AbstractSearched:
    """All that the search asks of a group of contacts; rows are tuples unless a kind says otherwise."""

    opens: bool = False  # whether some contact can open

    def slips(self, problem: Problem, acceleration: NumberRow) -> NumberRow:
        """Relative accelerations along the contacts."""
        return relative(problem.lines, acceleration, problem.gamma)

    def with_friction(self, lines: list, force: NumberRow, friction: NumberRow) -> NumberRow:
        """`force` and the friction of all contacts."""
        for n, f in zip(lines, friction, strict=True):
            force = tuple(total((g, times(x, f))) for g, x in zip(force, n, strict=True))
        return force

    def closure(self, rest: NumberRow, slow: NumberRow) -> NumberRow:
        """`rest`, and the contacts that rest wherever these do: those of them without speed, `slow`."""
        return rest

    def overload(
        self, lines: list, bounds: Bounds, rest: NumberRow, motion: Motion, still: Any
    ) -> Overload:
        """How the contacts in `rest` give way if they bear more than `bounds`, by more than `still`."""
        raise NotImplementedError(f"{type(self).__name__} has a law without a search")

    def begins(self, problem: Problem, standing: NumberRow, slow: Any) -> tuple[NumberRow, NumberRow]:
        """Acceleration and senses of the contacts in `standing` that the search begins with."""
        origin = each(lambda f: jnp.zeros_like(jnp.asarray(f, jnp.float64)), problem.force)
        if not all(map(is_zero, problem.gamma)):
            origin = problem.moves(origin, standing).acceleration
        return origin, each(lambda stands: jnp.zeros_like(stands, jnp.float64), standing)

    # Acceleration, in parts of the least that counts, below which a contact stops that had begun to
    # slide.
    least_acceleration: float = 1.0

    def ending(
        self, problem: Problem, states: NumberRow, acceleration: NumberRow, slow: Any
    ) -> NumberRow:
        """States at the end of a search: the face, less what has no acceleration on it."""
        return states

    def without_speed(
        self, problem: Problem, acceleration: NumberRow, standing: NumberRow, slow: Any
    ) -> NumberRow:
        """Contacts in `standing` that this acceleration leaves without speed."""
        return standing


class _Search(NamedTuple):
    states: NumberRow  # the face of the search: 0 at rest, else the sense
    given: NumberRow  # senses that the friction of contacts without speed belongs to
    acceleration: NumberRow
    pivots: Any
    ended: Any
    still: Any  # overloads below it are rounding [N]


def relative(lines: list[list], v: Any, surfaces: list) -> tuple:
    """Speeds that directions make of velocities, or of accelerations, less those of the surfaces."""
    pairs = zip(lines, surfaces, strict=True)
    return tuple(jnp.asarray(minus(dot(n, v), w), jnp.float64) for n, w in pairs)


def senses_of(problem: Problem, acceleration: NumberRow, slow: Any) -> NumberRow:
    """Senses in which contacts and stops begin to move at this acceleration; 0 of slower ones."""
    slips = relative(problem.lines, acceleration, problem.gamma)
    found = (where(jnp.abs(x) <= slow, 0.0, jnp.sign(x)) for x in slips)
    bounds = zip(found, problem.static.high, strict=True)
    return tuple(jnp.maximum(x, 0.0) if high is NO_LIMIT else x for x, high in bounds)


def resting(states: NumberRow) -> NumberRow:
    """Which of the contacts with these states rest."""
    return each(lambda s: s == 0.0, states)


def without_drop(static: Any, kinetic: Any) -> Any:
    """Whether a contact that gives way bears as much as it did at rest.

    A law need not say so to the last digit: `mu_k + (mu_s - mu_k)` is not `mu_s`.
    """
    if static is NO_LIMIT:
        return jnp.ones((), bool)
    return jnp.abs(static - kinetic) <= ENGINE.slack * jnp.abs(static)


def states_by_search(group: AbstractSearched, problem: Problem) -> tuple[NumberRow, Any]:
    r"""States of all contacts an instant later: those without speed by the law of all contacts.

    A contact that begins to slide is under kinetic friction from then on: kinetic ahead, static behind.
    That may make others slide, or send one back that had only just begun. So the law is asked again, as
    time stepping with steps of no length would, until the senses stay.

    The minimum is found by the primal active-set method on the faces of the arrangement of the planes
    $n_c\cdot a = \gamma_c$: go to the minimum of the face, or to the first contact that stops on the
    way and rest it; at the minimum release what is overloaded most. The function falls from face to
    face, so none returns.

    Numbers side by side are vectors or tuples (`_rows`), whichever the group makes.

    A stop is a contact that begins to move off with the sense 1, and bears nothing then.

    **Returns** the states and whether the search ended.
    """
    problem = problem.without_slopes()
    static, kinetic, states, standing = (
        problem.static, problem.kinetic, problem.states, problem.standing
    )  # fmt: skip
    low, kinetic_low = static.lower, kinetic.lower
    creeping = _creeping(problem)
    inertia, size = _scales(problem, standing, group.opens)

    def pivot(now: _Search) -> _Search:
        slow = ACCURACY.slow * now.still / inertia
        # A contact that has begun to slide bears kinetic friction ahead; a stop bears any force or
        # none.
        least = each(lambda given, R, K: where(given > 0.0, K, R), now.given, low, kinetic_low)
        most = each(
            lambda given, R, K: NO_LIMIT if R is NO_LIMIT else where(given < 0.0, K, R),
            now.given, static.high, kinetic.high,
        )  # fmt: skip
        # The middle of the interval is a force, so that what is left to bear lies around 0.
        middle = each(lambda a, b: 0.0 if b is NO_LIMIT else 0.5 * (a + b), least, most)
        half = each(lambda a, b: NO_LIMIT if b is NO_LIMIT else 0.5 * (b - a), least, most)
        friction = each(
            lambda stands, s, middle, half: (
                0.0 if half is NO_LIMIT else where(stands, middle - s * half, 0.0)
            ),
            standing, now.states, middle, half,
        )  # fmt: skip
        rest = resting(now.states)
        found = problem.moves(group.with_friction(problem.lines, problem.force, friction), rest)
        before, after = group.slips(problem, now.acceleration), group.slips(problem, found.acceleration)

        def path(s, v0, v1, stands, rests):
            v0, v1 = jnp.maximum(s * v0, 0.0), s * v1
            stops = stands & ~rests & (v1 < group.least_acceleration * slow)
            return where(stops, -v0 / (v0 - v1 + 2.0 * slow), UNRESISTED)

        # The part of the way to the first contact that stops.
        paths = each(path, now.states, before, after, standing, rest)
        share, first = first_greatest(paths, UNRESISTED)
        blocked, part = share > UNRESISTED, jnp.clip(-share, 0.0, 1.0)
        reached = each(
            lambda a, b: where(blocked, a + part * (b - a), b), now.acceleration, found.acceleration
        )
        # Dependent contacts that have no speed are at rest where the others hold them. `first` is 0 if
        # none stops, which is read only where one does.
        without_speed = group.without_speed(problem, reached, standing, slow)
        stopped = group.closure(with_place(rest, first), without_speed)
        over_limit = group.overload(problem.lines, Bounds(None, half), rest, found, now.still)
        overloaded = ~blocked & over_limit.beyond
        face = each(
            lambda r, way, s: where(blocked & r, 0.0, where(overloaded & (s == 0.0), way, s)),
            stopped, over_limit.ways, now.states,
        )  # fmt: skip
        minimum = ~blocked & ~overloaded
        ends = each(
            lambda creeps, old, s: where(creeps & (s == 0.0), old, s),
            creeping, states, group.ending(problem, now.states, reached, slow),
        )  # fmt: skip
        changed = any_of(each(lambda s, given: s != given, ends, now.given))
        again, done = minimum & changed, minimum & ~changed
        # The next search begins at rest: started on the face found, all its speeds zero, it could
        # stop and release the same contacts for ever.
        face = each(
            lambda stands, begin, end, s: where(again & stands, begin, where(done, end, s)),
            standing, first_face, ends, face,
        )  # fmt: skip
        # A tie within rounding of an ill-conditioned inertia may send a contact to and fro.
        tired = (now.pivots % ACCURACY.patience) == ACCURACY.patience - 1
        return _Search(
            face,
            each(lambda end, given: where(again, end, given), ends, now.given),
            each(lambda start, a: where(again, start, a), origin, reached),
            now.pivots + 1,
            done,
            where(tired, 10.0 * now.still, now.still),
        )

    origin, begun = group.begins(problem, standing, ACCURACY.slow * ENGINE.solved * size / inertia)
    first_face = each(lambda stands, x, s: where(stands, x, s), standing, begun, states)
    given = each(jnp.asarray, states)
    none = jnp.zeros_like(size, jnp.int32)
    start = _Search(first_face, given, origin, none, ~problem.active, ENGINE.solved * size)
    end = lax.while_loop(
        lambda now: ~now.ended & (now.pivots < ACCURACY.most_pivots),
        pivot,
        jax.tree.map(jnp.asarray, start),
    )
    return end.states, end.ended


def _creeping(problem: Problem) -> NumberRow:
    """Contacts at their limit without a drop of friction: they begin without acceleration."""
    static, kinetic, started = problem.static, problem.kinetic, problem.started
    behind = each(without_drop, static.high, kinetic.high)
    if static.low is None and kinetic.low is None:
        return each(lambda start, same: start & same, started, behind)
    return each(
        lambda start, s, same, R, K: start & (((s > 0.0) & without_drop(R, K)) | ((s <= 0.0) & same)),
        started, problem.states, behind, static.lower, kinetic.lower,
    )  # fmt: skip


def _scales(problem: Problem, standing: NumberRow, opens: bool) -> tuple[Any, Any]:
    """Inertia that contacts feel [kg], and the size of all forces at them together [N]."""
    levers = _levers(problem.lines, standing)
    M = problem.mass
    diagonal = M.diagonal or [line[i] for i, line in enumerate(M.full or [])]
    felt = [times(m, times(over(x), over(x))) for m, x in zip(diagonal, levers, strict=True)
            if not is_zero(x)]  # fmt: skip
    # A stop can bear without limit; what friction can bear is a scale. That of a contact that is open
    # has the sign of its normal force.
    widths = each(
        lambda high, low: 0.0 if high is NO_LIMIT else high - low,
        problem.static.high, problem.static.lower,
    )  # fmt: skip
    if opens:
        widths = each(jnp.abs, widths)
    borne = total(widths) if isinstance(widths, tuple) else jnp.sum(widths)
    if isinstance(problem.force, tuple):
        loads = total(
            jnp.abs(f) * over(x) for f, x in zip(problem.force, levers, strict=True) if not is_zero(x)
        )
    else:
        weights = [[over(x) if x else 0.0 for x in levers]]
        loads = through(np.array(weights), jnp.abs(problem.force))[0]
    # Of what accelerated surfaces carry only the lightest counts: a heavy part has no say over it.
    least = functools.reduce(jnp.minimum, map(jnp.asarray, felt))
    carried = total(jnp.abs(times(least, g)) for g in problem.gamma if not is_zero(g))
    return total(felt), total((borne, loads, carried)) + 1e-300


def _levers(lines: list[list], standing: NumberRow) -> list[Any]:
    """Contact speed per unit of each velocity: coordinates may have different units."""
    levers: list[Any] = []
    for column in zip(*lines, strict=True):
        if all(isinstance(n, float) for n in column):
            levers.append(max(map(abs, column)))
            continue
        sizes = (where(stands, jnp.abs(jnp.asarray(n)), 0.0)
                 for n, stands in zip(column, standing, strict=True) if not is_zero(n))  # fmt: skip
        levers.append(functools.reduce(jnp.maximum, sizes))
    return levers
