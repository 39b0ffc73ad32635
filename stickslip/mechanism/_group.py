"""Groups of contacts that may change each other's accelerations: what every kind of them answers."""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from stickslip._fastmath import where

from ._laws import NO_LIMIT, Bounds
from ._local import LocalInstant, Part
from ._motion import Motion
from ._rows import NumberRow, any_of, each, first_greatest
from ._scalars import Mass, dot, is_zero, minus, over, times
from ._scalars import any_of as any_of_all
from ._search import AbstractSearched, Problem, relative, resting, states_by_search


class Guards(NamedTuple):
    """Guards of a group: `own` of each contact and stop; `ahead`, for contacts with a guard for each
    limit of their friction, what is left to them in the sense of the direction; `joint`, of all
    together."""

    own: NumberRow
    ahead: dict[int, Any]
    joint: tuple[Any, ...] = ()


class Fired(NamedTuple):
    """Which guard has fired, and what it means for a group.

    - `guard`: its number; `numbers`: of each contact those of its own guards; `joint`: those of the
      group; all as constants.
    - `left`, `met`: for each contact and stop whether it is a stop that is left, or has been met.
    - `toggled`: by contact that may open whether it opens or closes.
    - `asked`: whether the law of all contacts is asked again whatever has fired; None for never.
    - `rested`: for each contact and stop whether it was at rest before all that.
    """

    guard: Any
    numbers: dict[int, tuple[int, ...]]
    joint: dict[int, int]
    left: list[Any]
    met: list[Any]
    toggled: dict[int, Any]
    asked: Any
    rested: list[Any]


class Release(NamedTuple):
    """Contacts that a guard lets go: the sense of each contact that gives way (0 of others); whether
    some give way, whether some stop, and whether a contact has lost its normal force."""

    ways: NumberRow
    gives_way: Any
    stops: Any
    failed: Any = False


class Landing(NamedTuple):
    """Contacts at `rest` before an event, `hit` by it, and `passing` their zero; whether the group is
    `touched` at all, and `lands`: what rests is made to rest to the last digit."""

    rest: NumberRow
    hit: NumberRow
    touched: Any
    lands: Any
    passing: Any


class Change(NamedTuple):
    """A group right after an event: velocities, states, coordinates, and whether no law holds."""

    velocities: NumberRow
    states: NumberRow
    places: dict[int, Any]
    failed: Any


class AbstractContactGroup(AbstractSearched, abc.ABC):
    r"""Velocities, contacts and stops of a mechanism that may change each other's accelerations.

    With the inertia $M$, the directions $J$ and the forces $F$ (friction of the sliding contacts among
    them) the contacts $H$ that rest bear $\lambda_H$:

    $$M a = F + J_H^T\lambda_H, \qquad J_H a = \gamma_H
      \quad\Rightarrow\quad (J_H M^{-1} J_H^T)\,\lambda_H = \gamma_H - J_H M^{-1} F$$

    A stop is a contact like the others, with the gradient of its gap as direction, that can bear any
    force off it and none towards it. A kind of group is a final class: it says how its contacts move,
    when they give way, and which of them then slide. `_kinds` chooses one for each group, once.
    """

    # Whether what one contact bears changes the acceleration along no other.
    separate: bool = False

    def __init__(self, part: Part):
        self.part = part
        self.columns, self.rows, self.directions = part.columns, part.rows, part.directions
        self.m, self.n = part.directions.shape
        self.stops, self.contacts = part.stops, part.contacts
        self.opens = bool(part.opening)

    @classmethod
    @abc.abstractmethod
    def takes(cls, part: Part) -> bool:
        """Whether this kind is that of a group declared so."""

    # -- motion

    @abc.abstractmethod
    def motion(self, M: Mass, F: Any, J: list[list], rest: NumberRow, gamma: list) -> Motion:
        """Motion while the contacts in `rest` have the relative acceleration `gamma`."""

    def mover(self, here: LocalInstant) -> Callable[..., Motion]:
        """`motion`, or what the mechanism has in place of it."""
        return self.motion

    def row(self, values: Any) -> NumberRow:
        """One number a contact, side by side."""
        return tuple(values)

    def own_states(self, states: Any) -> NumberRow:
        """States of the contacts and stops of this group."""
        return self.row([states[c] for c in self.rows])

    def with_own(self, states: Any, own: NumberRow) -> Any:
        """`states` of all contacts, with those of this group as `own`."""
        new = list(states)
        for c, x in zip(self.rows, own, strict=True):
            new[c] = x
        return new

    def friction(self, here: LocalInstant, own: NumberRow) -> NumberRow:
        """Friction of the contacts that slide [N]; 0 of those at rest or open."""
        k = self.contacts
        s = own[:k] if self.stops else own
        slips = here.laws.friction(lambda: here.speeds[:k] if self.stops else here.speeds, s)
        if self.part.opening:
            slips = each(lambda s, f: where(s == 2.0, 0.0, f), s, slips)
        return (*slips, *(0.0,) * self.stops) if self.stops else slips

    def slip_forces(self, here: LocalInstant, states: Any) -> NumberRow:
        """Friction of the contacts that slide [N], and 0 for each stop."""
        return self.friction(here, self.own_states(states))

    def load(self, here: LocalInstant, states: Any, needed: bool = False) -> NumberRow:
        """Forces on the velocities: friction of contacts that change the acceleration along no other
        only if `needed`, since what they would bear at rest does not depend on it."""
        everything = here.at.forces_in(states)
        force = self.row([everything[j] for j in self.columns])
        if self.separate and not needed:
            return force
        return self.with_friction(here.lines, force, self.friction(here, self.own_states(states)))

    def motion_in(self, here: LocalInstant, states: Any, needed: bool = False) -> Motion:
        """Motion in the mode of these states."""
        load, rest = self.load(here, states, needed), resting(self.own_states(states))
        return self.mover(here)(here.mass, load, here.lines, rest, here.gamma)

    def not_followed(
        self, moving: list[int], still: list[int], straight: Callable[[], bool]
    ) -> list[int]:
        """Contacts and stops `moving`, whose surfaces move or turn, that a body which rests on another
        cannot follow. `still`: stops of no speed; `straight`: whether no direction varies."""
        return []

    # -- guards

    @property
    def joint_guards(self) -> int:
        """How many guards the contacts have together."""
        return 0

    @abc.abstractmethod
    def guards(self, here: LocalInstant, states: Any) -> Guards:
        """Values of the guards in the mode of these states."""

    def gaps(self, here: LocalInstant) -> list[Any]:
        """Gaps of the stops [m]."""
        return [jnp.asarray(stop.stop.gap, jnp.float64) for stop in here.stops]

    def normal_forces(self, here: LocalInstant, states: Any) -> dict[int, Any]:
        """Normal forces [N] that follow from the motion, by contact: those of no `Contact`."""
        return {}

    # -- what happens at an event

    @abc.abstractmethod
    def release(self, here: LocalInstant, states: Any, hit: NumberRow, fired: Fired) -> Release:
        """Contacts that give way, and those that stop."""

    def hit(self, fired: Fired) -> NumberRow:
        """Contacts and stops whose own guard has fired."""
        found = [any_of_all(fired.guard == k for k in fired.numbers[c])
                 for c in self.rows[: self.contacts]]  # fmt: skip
        return self.row([*found, *(fired.left[c] for c in self.rows[self.contacts :])])

    def slow(self, here: LocalInstant, own: NumberRow, on: NumberRow) -> NumberRow:
        """Contacts without speed while those in `on` rest; of the stops only those that are closed."""
        if not self.stops:
            return self.row(here.slow())
        v = self.at_rest(here, on)
        found = here.slow(speeds=relative(here.lines, v, here.surfaces))
        k = self.contacts
        return (*found[:k], *(x & (s == 0.0) for x, s in zip(found[k:], own[k:], strict=True)))

    def slow_then(self, here: LocalInstant, own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow:
        """Contacts without speed as those that were `hit` stop."""
        return self.slow(here, own, each(lambda s, h: (s == 0.0) | h, own, hit))

    def still(self, here: LocalInstant, own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow:
        """Contacts that rest as those that were `hit` stop, with all that has no speed then."""
        return each(lambda s, h: (s == 0.0) | h, own, hit)

    def transition(self, here: LocalInstant, states: Any, fired: Fired) -> Change:
        """The group right after a guard has fired."""
        own, hit = self.own_states(states), self.hit(fired)
        rest = resting(own)
        release = self.release(here, states, hit, fired)
        gives_way, stops = release.gives_way, release.stops
        started = each(lambda r, way: gives_way & r & (way != 0.0), rest, release.ways)
        after = each(lambda start, way, s: where(start, way, s), started, release.ways, own)
        # Contacts that reach zero speed rest first; the friction law decides which slide again.
        still = self.still(here, own, hit, stops)
        after = each(lambda r, s: where(stops & r, 0.0, s), still, after)
        touched = stops | gives_way
        if here.drifts:
            # Rest on a direction or surface that varies is held by accelerations: what their steps err
            # by is a speed, and one against the sense in which it gives way would stop it at once.
            still = each(lambda r, x: (gives_way & r) | (~gives_way & x), rest, still)
        if self.stops:
            touched = touched | any_of_all(fired.met[c] for c in self.rows)
        if fired.asked is not None:
            touched = touched | fired.asked
        lands = touched if self.stops or here.drifts else stops
        if self.part.opening:
            after, toggles = self._after_toggles(here, own, hit, stops, after, fired)
            touched = touched | toggles
        passing = self.passing(own, hit, stops)
        found, ended = self.states_after(here, states, after, started, touched, passing)
        landing = Landing(rest, hit, touched, lands, passing)
        still, lands, places = self.landing(here, still, found, landing, fired)
        # Others that are made to rest beside a contact that passes might send it back.
        kept = None if passing is None else past_zero(passing, found)
        landed = self.at_rest(here, still, kept)
        velocities = each(lambda x, v: where(lands, x, v), landed, self.row(here.velocities))
        found = each(lambda x, s: where(touched, x, s), found, own)
        return Change(velocities, found, places, release.failed | (touched & ~ended))

    def _after_toggles(
        self, here: LocalInstant, own: NumberRow, hit: NumberRow, stops: Any, after: NumberRow,
        fired: Fired,
    ) -> tuple[NumberRow, Any]:  # fmt: skip
        """States after contacts have opened or closed, and whether one does."""
        slow = self.slow_then(here, own, hit, stops)
        found, some = list(after), jnp.zeros((), bool)
        for i, c in enumerate(self.rows[: self.contacts]):
            if c in self.part.opening:
                toggle = fired.toggled[c]
                closes = where(slow[i], 0.0, jnp.sign(here.at.speeds[c]))
                found[i] = where(toggle, where(own[i] == 2.0, closes, 2.0), found[i])
                some = some | toggle
        return self.row(found), some

    def passing(self, own: NumberRow, hit: NumberRow, stops: Any) -> NumberRow | None:
        """The sense beyond its zero of a contact whose speed has just passed through it, else 0; None
        where none can pass."""
        return None

    def landing(
        self, here: LocalInstant, still: NumberRow, found: NumberRow, landing: Landing, fired: Fired
    ) -> tuple[NumberRow, Any, dict[int, Any]]:
        """Contacts in `still` that are made to rest, whether they are, and coordinates that are moved.

        `found`: the states by the law of all contacts."""
        return still, landing.lands, {}

    def at_rest(self, here: LocalInstant, still: NumberRow, kept: NumberRow | None = None) -> NumberRow:
        """Velocities with the contacts in `still` at rest, to the last digit.

        Contacts in `kept` keep their speed."""
        v = self.nearest_velocities(here, still, kept)
        for i, (line, w, rests) in enumerate(zip(here.lines, here.surfaces, still, strict=True)):
            entries = [j for j, n in enumerate(line) if not is_zero(n)]
            if len(entries) == 1:
                (j,) = entries
                v[j] = where(self.decides(rests, line[j]), times(over(line[j]), w), v[j])
            elif i >= self.contacts:
                # A gap that rounding still closes as it opens would look as if it were touched. By the
                # velocity that decides most: an entry may be 0 without being known to be.
                leads, now = jnp.argmax(jnp.abs(jnp.stack([line[j] + 0.0 for j in entries]))), list(v)
                for place, j in enumerate(entries):
                    others = dot(
                        [line[k] for k in entries if k != j], [now[k] for k in entries if k != j]
                    )
                    alone = times(over(line[j]), minus(w, others))
                    v[j] = where(rests & (leads == place), alone, now[j])
        return tuple(v)

    def nearest_velocities(
        self, here: LocalInstant, still: NumberRow, kept: NumberRow | None = None
    ) -> list[Any]:
        """The velocities nearest by the inertia at which the contacts in `still` do not slide."""
        v, held = here.velocities, still
        none = [jnp.zeros_like(x) for x in v]
        back = [times(-1.0, here.at.speeds[c]) for c in self.rows]
        if kept is not None:
            back = [where(rests, x, 0.0) for rests, x in zip(still, back, strict=True)]
            held = each(lambda rests, keeps: rests | keeps, still, kept)
        change = self.motion(here.mass, none, here.lines, held, back).acceleration
        some = any_of(still)
        return [where(some, x + d, x) for x, d in zip(v, change, strict=True)]

    def to_closed(self, here: LocalInstant, still: NumberRow) -> list[Any]:
        """The least change of the coordinates by the inertia that makes the gaps of closed stops 0."""
        k = self.contacts
        closed = self.row([x & (i >= k) for i, x in enumerate(still)])
        gaps = [0.0] * k + [times(-1.0, stop.stop.gap) for stop in here.stops]
        gaps = [where(x, g, 0.0) for x, g in zip(closed, gaps, strict=True)]
        none = [jnp.zeros(()) for _ in self.columns]
        change = self.motion(here.mass, none, here.lines, closed, gaps).acceleration
        return [where(any_of(closed), x, 0.0) for x in change]

    def still_in(self, own: NumberRow) -> NumberRow:
        """Which contacts and stops are at rest in these states."""
        return each(lambda s: s == 0.0, own)

    def decides(self, rests: Any, n: Any) -> Any:
        """Whether a resting contact decides the velocity that its direction has the entry `n` for."""
        return rests

    # -- the law of all contacts

    def at_start(self, here: LocalInstant, states: Any) -> NumberRow:
        """States at the start: what has no speed rests until the law of all contacts is asked."""
        k = self.contacts
        kept = [states[c] if i < k else 2.0 for i, c in enumerate(self.rows)]
        return self.row([
            where(x & (states[c] != 2.0), 0.0, s)
            for x, c, s in zip(here.slow(), self.rows, kept, strict=True)
        ])  # fmt: skip

    def states_after(
        self, here: LocalInstant, states: Any, own: NumberRow, started: NumberRow, active: Any,
        passing: NumberRow | None = None,
    ) -> tuple[NumberRow, Any]:  # fmt: skip
        """States by the law of all contacts, of which this group's are `own`, and whether it holds."""
        everything = here.at.forces_in(self.with_own(states, own))
        force = self.row([everything[j] for j in self.columns])
        if not self.separate:
            slides = each(
                lambda s, start, f: 0.0 if is_zero(f) else where((s == 0.0) | start, 0.0, f),
                own, started, self.friction(here, own),
            )  # fmt: skip
            force = self.with_friction(here.lines, force, slides)
        return self.law(Problem(
            here.mass, force, here.lines, here.gamma, here.static, here.kinetic, self.mover(here),
            own, started, active, passing,
        ))  # fmt: skip

    def law(self, problem: Problem) -> tuple[NumberRow, Any]:
        """As `states_by_search`."""
        return states_by_search(self, problem)

    # -- at an impact

    def with_closed(self, hit: list, closed: list) -> list:
        """Stops that stay on as those in `hit` are met: the closed ones too."""
        return [a | b for a, b in zip(hit, closed, strict=True)]

    def impulses(self, here: LocalInstant, met: list, closed: list) -> list[Any]:
        """Which stops, of the one that is met and those that are closed, take an impulse or stay on."""
        if self.stops == 1:
            return self.with_closed(met, closed)
        none = self.row([jnp.zeros((), jnp.float64)] * self.n)
        limits = Bounds((0.0,) * self.m, (0.0,) * self.contacts + (NO_LIMIT,) * self.stops)
        # As accelerations under no force: what is met has to leave, what is closed must not close in.
        speeds = [here.at.speeds[c] for c in self.rows]
        gamma = [where(h, -u, 0.0) for h, u in zip(met, speeds, strict=True)]
        states = tuple(where(h | r, 0.0, 2.0) for h, r in zip(met, closed, strict=True))
        never = tuple(h & False for h in met)
        found, _ = self.law(Problem(
            here.mass, none, here.lines, gamma, limits, limits, self.motion,
            states, never, any_of_all(met),
        ))  # fmt: skip
        return [x == 0.0 for x in found]


def past_zero(passing: NumberRow, found: NumberRow) -> NumberRow:
    """Contacts that pass through rest and slide on."""
    return each(lambda p, f: (p != 0.0) & (f != 0.0), passing, found)


# -- how contacts give way one by one


def reserves(bounds: Bounds, force: NumberRow) -> list[tuple[Any, Any]]:
    """Friction that is left to each contact, upwards and downwards [N]; a stop has no upper limit."""
    return [
        (high if high is NO_LIMIT else high - borne, minus(borne, low))
        for low, high, borne in zip(bounds.lower, bounds.high, force, strict=True)
    ]


def least_first(values: list, ways: list, floor: float = -jnp.inf) -> tuple[Any, NumberRow]:
    """The greatest of `values`, and of the senses `ways` that of the first contact which has it."""
    most, place = first_greatest(tuple(values), floor)
    return most, tuple(where((place == c) & (most > floor), way, 0.0) for c, way in enumerate(ways))


def lower_of(more: Any, less: Any) -> tuple[Any, Any]:
    """The lower of what is left upwards and downwards, and the sense of giving way there."""
    if more is NO_LIMIT:
        return less, 1.0
    # The reaction pushes back: they give way against it.
    return jnp.minimum(more, less), where(more < less, -1.0, 1.0)
