"""The contacts of one island with dependent directions in a mode: all of them at once, in rows."""

import functools
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from stickslip._fastmath import where

from ._instant import Instant, landed, slow_contacts
from ._island import Island
from ._rows import NumberRow, any_of, each, row, through
from ._scalars import is_zero
from ._settle_together import settled_together
from ._together import Bounds, Laws, Onset, looked_up, onset, resting

if TYPE_CHECKING:
    from ._mechanism import AbstractMechanism

MOST_SHARE = 1e6  # a share of friction beyond it says no more


class IslandRows:
    """An island of `machine` at one instant, whose contacts have the given states.

    One number a contact, in a `NumberRow`: a program of a few vectors is shorter than one of all
    contacts and pairs of them, written out, and compiles as much faster.

    `force`: all forces but the friction of these contacts, of all coordinates.
    """

    def __init__(
        self, machine: "AbstractMechanism", island: Island, at: Instant, states: Any, force: list
    ):
        self.machine, self.island, self.at = machine, island, at
        if isinstance(states, tuple | list) or island.rows != tuple(range(len(states))):
            states = row([states[c] for c in island.rows])
        self.states: NumberRow = states
        self.force = row([force[j] for j in island.columns])
        self.mass = at.mass.of(island.columns)
        self.laws = Laws(island, at)

    @functools.cached_property
    def speeds(self) -> NumberRow:
        """Sliding speeds [m/s]."""
        return row([self.at.speeds[c] for c in self.island.rows])

    def moved(self, force: NumberRow, rest: NumberRow) -> tuple[NumberRow, NumberRow]:
        """Acceleration, and force of all contacts in `rest`, under `force`."""
        return self.machine.motion_together(self.island, self.mass, force, rest)

    @functools.cached_property
    def _friction(self) -> NumberRow:
        return self.laws.friction(lambda: self.speeds, self.states)

    @functools.cached_property
    def _static(self) -> Bounds:
        return self.laws.bounds("static_coefficient")

    def _loaded(self, friction: NumberRow) -> NumberRow:
        return each(lambda f, g: f + g, self.force, through(self.island.directions.T, friction))

    def motion(self) -> tuple[NumberRow, NumberRow]:
        """Acceleration, and force of all resting contacts together."""
        return self.moved(self._loaded(self._friction), resting(self.states))

    def guards(self) -> tuple[NumberRow, Any]:
        """The guard of each contact, and the one of all that rest: the share that is left."""
        rest, at = resting(self.states), self.at
        # One of those that always slide together is enough; two would count as coincident.
        agree = self.island.agree([at.surfaces[c] for c in self.island.rows])
        own = each(
            lambda r, tied, s, u: where(r | (tied & agree), 1.0, s * u),
            rest, looked_up(self.island.covered, rest), self.states, self.speeds,
        )  # fmt: skip
        return own, 1.0 - jnp.minimum(self._onset(self.motion()[1]).share, MOST_SHARE)

    def _onset(self, reaction: NumberRow) -> Onset:
        return onset(self.island, self._static, resting(self.states), reaction)

    def changed(self, guard: Any, gives_way: Any, asked: Any) -> tuple[NumberRow, NumberRow, Any]:
        """Velocities and states after contact number `guard` has stopped, or those at rest gave way.

        And whether the law of all contacts has an answer. It is asked again too where `asked`.
        """
        rest = resting(self.states)
        ways = self._onset(jax.lax.stop_gradient(self.motion()[1])).ways
        rows = self.island.rows
        if isinstance(rest, tuple):
            hit: NumberRow = tuple(guard == c for c in rows)
        else:
            hit = jnp.asarray(rows, jnp.int32) == guard
        stops = any_of(hit)
        started = each(lambda r, way: gives_way & r & (way != 0.0), rest, ways)
        now = each(lambda start, way, s: where(start, way, s), started, ways, self.states)
        on = each(lambda r, h: r | h, rest, hit)
        still = self._closed(on)
        now = each(lambda r, s: where(stops & r, 0.0, s), still, now)
        velocities = self._landed(still, stops)
        touched = stops | gives_way
        touched = touched if asked is None else touched | asked
        found, ended = self.settled(now, started, touched)
        found = each(lambda x, s: where(touched, x, s), found, self.states)
        return velocities, found, ~touched | ended

    def begun(self, slow: NumberRow) -> tuple[NumberRow, Any]:
        """States of the contacts, of which those in `slow` have no speed, at the start."""
        states = each(lambda x, s: where(x, 0.0, s), slow, self.states)
        none = each(jnp.zeros_like, slow)
        return self.settled(states, none, jnp.ones((), bool))

    def settled(self, states: NumberRow, started: NumberRow, active: Any) -> tuple[NumberRow, Any]:
        """States by the law of all contacts, and whether it has an answer."""
        standing = each(lambda s, start: (s == 0.0) | start, states, started)
        force = self._loaded(each(lambda i, f: where(i, 0.0, f), standing, self._friction))
        return settled_together(
            self.island, self.mass, self.machine.motion_together, force,
            self._static, self.laws.bounds("kinetic_limit"), states, started, active,
        )  # fmt: skip

    def _closed(self, rest: NumberRow) -> NumberRow:
        """Contacts in `rest`, and those that rest wherever these do."""
        agree = self.island.agree([self.at.surfaces[c] for c in self.island.rows])
        held = looked_up(self.island.closure, rest)
        if agree is True:
            return each(lambda r, h: r | h, rest, held)
        slow = row(slow_contacts(self.at, self.island))
        return each(lambda r, h, s: r | (h & (s | agree)), rest, held, slow)

    def _landed(self, still: NumberRow, stops: Any) -> NumberRow:
        island, at = self.island, self.at
        v = row([jnp.asarray(at.v[j], jnp.float64) for j in island.columns])
        if all(is_zero(at.surfaces[c]) for c in island.rows):
            momenta = row(self.mass.times([at.v[j] for j in island.columns]))
            on = self.moved(momenta, still)[0]
        else:
            on = row(landed(island, at, list(still)))
        return each(lambda x, v: where(stops, x, v), on, v)


def with_rows(island: Island, states: Any, found: NumberRow) -> Any:
    """`states` of all contacts, with those of the island as `found`."""
    if island.rows == tuple(range(len(states))):
        return found
    new = list(states)
    for c, x in zip(island.rows, found, strict=True):
        new[c] = x
    return new
