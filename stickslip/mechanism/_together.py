"""Contacts with directions that depend on each other, side by side: friction, and how they give way."""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._fastmath import where
from stickslip.friction import Coulomb

from ._island import NOTHING, UNRESISTED, Island
from ._modes import sense_of
from ._rows import NumberRow, any_through, each, first_greatest, row, through
from ._scalars import Mass

if TYPE_CHECKING:
    from ._instant import Instant


class Bounds(NamedTuple):
    """Friction that each contact can bear [N], from `low` to `high`; `low` is None for `-high`."""

    low: NumberRow | None
    high: NumberRow

    @property
    def lower(self) -> NumberRow:
        """The lower bounds."""
        return each(lambda high: -high, self.high) if self.low is None else self.low


class Laws:
    """The laws of the contacts of an island: as one law of rows if they are of one kind."""

    def __init__(self, island: Island, at: "Instant"):
        self.contacts = [at.contacts[c] for c in island.rows]
        self.odd = all(contact.law.is_odd for contact in self.contacts)
        # Their kinetic friction is the same at all speeds.
        self._coulomb = all(type(contact.law) is Coulomb for contact in self.contacts)

    @functools.cached_property
    def loads(self) -> NumberRow:
        """Normal forces [N]."""
        return row([contact.normal_force for contact in self.contacts])

    @functools.cached_property
    def one(self) -> Any:
        """A law whose parameters are rows; None where the laws are not alike, or stay apart."""
        laws = [contact.law for contact in self.contacts]
        leaves = [jax.tree.leaves(law) for law in laws]
        form = jax.tree.structure(laws[0])
        if isinstance(self.loads, tuple) or any(jnp.ndim(x) for those in leaves for x in those):
            return None
        if any(jax.tree.structure(law) != form for law in laws):
            return None
        return jax.tree.unflatten(form, [row(list(x)) for x in zip(*leaves, strict=True)])

    def each(self, of: Any, *rows: NumberRow) -> NumberRow:
        """`of(law, normal_force, ...)` of every contact."""
        if self.one is not None:
            return of(self.one, self.loads, *rows)
        laws = tuple(contact.law for contact in self.contacts)
        if isinstance(self.loads, tuple):
            return each(of, laws, self.loads, *rows)
        return row([of(law, self.loads[c], *(r[c] for r in rows)) for c, law in enumerate(laws)])

    def bounds(self, which: str) -> Bounds:
        """By the coefficient of the laws named `which`."""
        if which == "kinetic_limit" and self._coulomb:
            laws: list[Any] = [contact.law for contact in self.contacts]
            pairs = zip(laws, self.contacts, strict=True)
            return Bounds(None, row([law.mu_k * contact.normal_force for law, contact in pairs]))

        def ahead(law, load):
            return getattr(law, which)(1) * load

        if self.odd:
            return Bounds(None, self.each(ahead))
        behind = self.each(lambda law, load: getattr(law, which)(-1) * load)
        return Bounds(each(lambda x: -x, self.each(ahead)), behind)

    def friction(self, speeds: Callable[[], NumberRow], states: NumberRow) -> NumberRow:
        """Friction of each contact that slides in the sense of its state [N]; 0 of those at rest."""
        if self._coulomb:
            return each(lambda s, limit: -s * limit, states, self.bounds("kinetic_limit").high)
        slips = self.each(
            lambda law, load, u, s: law.slip_force(u, load, sense_of(s)), speeds(), states
        )
        return each(lambda s, force: where(s == 0.0, 0.0, force), states, slips)


def resting(states: NumberRow) -> NumberRow:
    """Which of the contacts with these states rest."""
    return each(lambda s: s == 0.0, states)


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


def closed(island: Island, rest: NumberRow, slow: NumberRow) -> NumberRow:
    """As `Island.closed`."""
    return each(lambda r, w, s: r | (w & s), rest, looked_up(island.closure, rest), slow)


def motion_in_rows(
    island: Island, mass: Mass, force: NumberRow, rest: NumberRow
) -> tuple[NumberRow, NumberRow]:
    """`Island.motion` in rows: acceleration of each velocity, and force of all that rests."""
    still = [0.0] * island.m
    found = island.motion(mass, list(force), island.directions.tolist(), list(rest), still)
    return row(found.acceleration), row(found.reaction)


class Onset(NamedTuple):
    """Share of their friction that the contacts use, and how they would give way: `Island.onset`."""

    share: Any
    ways: NumberRow


def onset(
    island: Island, bounds: Bounds, rest: NumberRow, reaction: NumberRow, slack: Any = NOTHING
) -> Onset:
    """As `Island.onset`, in rows."""
    along = island.along
    loads = through(island.lines, reaction)
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
