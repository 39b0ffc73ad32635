"""A group of contacts as declared, and at one instant: its own part of what there is."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from stickslip.hybrid.accuracy import ACCURACY as ENGINE

from ._instant import Instant
from ._laws import Bounds, Laws
from ._rows import NumberRow
from ._scalars import is_zero, times, total


class Part(NamedTuple):
    """Velocities that contacts, stops and inertia couple, as declared.

    - `columns`: numbers of the velocities; `rows`: numbers of the contacts and after them of the stops,
      as in an `Instant`; `stops`: how many of the rows are stops.
    - `directions` `[row, column]`, NaN where they vary; `inertia`: constant matrices that the mass
      matrix is a combination of, None where they are not known.
    - `opening`, `lifting`, `two_sided`: contacts that open, that do not but may lose their normal
      force, and that have a guard for each limit of their friction.
    - `rubbing`: contacts that rub on a stop, and the stop; `planar`: pairs of contacts that are one in
      a plane; `joined`: whether inertia couples; `names` of the rows.
    """

    columns: tuple[int, ...]
    rows: tuple[int, ...]
    directions: np.ndarray
    inertia: np.ndarray | None = None
    stops: int = 0
    opening: tuple[int, ...] = ()
    lifting: tuple[int, ...] = ()
    two_sided: tuple[int, ...] = ()
    rubbing: tuple[tuple[int, int], ...] = ()
    planar: tuple[tuple[int, int], ...] = ()
    joined: bool = False
    names: tuple[str, ...] = ()

    @property
    def contacts(self) -> int:
        """How many of the rows are contacts."""
        return len(self.rows) - self.stops

    @property
    def varies(self) -> bool:
        """Whether a direction depends on state, time or parameters."""
        return bool(np.isnan(self.directions).any())

    @property
    def rank(self) -> int:
        """That of the directions; one that varies is taken in general position."""
        generic = np.random.default_rng(0).normal(size=self.directions.shape)
        known = np.where(np.isnan(self.directions), generic, self.directions)
        return int(np.linalg.matrix_rank(known)) if self.rows else 0

    @property
    def dependent(self) -> bool:
        """Whether directions depend on each other."""
        return self.rank < len(self.rows)

    @property
    def in_general_position(self) -> bool:
        """Whether a direction varies, and is taken not to depend on the others."""
        return self.varies and not self.dependent

    @property
    def on_one_velocity(self) -> bool:
        """Whether several contacts and stops act on one velocity: what rests, holds it."""
        return len(self.columns) == 1 and len(self.rows) > 1


class LocalInstant:
    """The contacts, stops and velocities of one group at one instant.

    `gamma`: relative accelerations at which the contacts and stops of the mechanism rest;
    `motion_together`: that of the mechanism; `row`: makes a row of numbers, one a contact.
    """

    def __init__(self, part: Part, at: Instant, gamma: Any, motion_together: Callable, row: Callable):
        self.part, self.at, self.row = part, at, row
        self.motion_together = motion_together
        self.mass = at.mass.of(part.columns)
        self.lines = [[at.directions[c][j] for j in part.columns] for c in part.rows]
        self.gamma = [gamma[c] for c in part.rows]
        self.surfaces = [at.surfaces[c] for c in part.rows]
        self.stops = [at.stops[c - len(at.contacts)] for c in part.rows[part.contacts :]]
        self.contacts = [at.contacts[c] for c in part.rows[: part.contacts]]
        self.laws = Laws(self.contacts, row, part.stops)

    def of(self, part: Part, at: Instant) -> "LocalInstant":
        """A part of the group, at an instant that may have other normal forces."""
        gamma = dict(zip(self.part.rows, self.gamma, strict=True))
        return LocalInstant(part, at, gamma, self.motion_together, tuple)

    @property
    def drifts(self) -> bool:
        """Whether a surface or a direction varies, so that rest is held by accelerations."""
        return not all(map(is_zero, self.gamma))

    @property
    def velocities(self) -> list[Any]:
        """Those of the group."""
        return [jnp.asarray(self.at.v[j], jnp.float64) for j in self.part.columns]

    @functools.cached_property
    def speeds(self) -> NumberRow:
        """Sliding speeds, and of stops the rates of their gaps [m/s]."""
        return self.row([self.at.speeds[c] for c in self.part.rows])

    @functools.cached_property
    def static(self) -> Bounds:
        """Forces that the contacts and stops can bear at rest [N]."""
        return self.laws.bounds("static_coefficient")

    @functools.cached_property
    def kinetic(self) -> Bounds:
        """Forces that they bear as they begin to slide [N]."""
        return self.laws.bounds("kinetic_limit")

    def slow(
        self,
        before: "LocalInstant | None" = None,
        part: float = ENGINE.few_roundings,
        speeds: Any = None,
    ) -> list[Any]:
        """Whether a sliding speed is rounding of the terms that it is the sum of, or this `part` of it.

        `before`: an instant whose terms count too, of which these speeds are what an event has left.
        `speeds`: others in place of the sliding speeds.
        """
        largest: Any = 0.0
        for c in self.part.rows:
            for one in (self.at,) if before is None else (self.at, before.at):
                pairs = zip(one.directions[c], one.v, strict=True)
                terms = [times(n, x) for n, x in pairs if not is_zero(n)]
                size = total(jnp.abs(x) for x in (*terms, jnp.asarray(one.surfaces[c])))
                largest = jnp.maximum(largest, size)
        speeds = [self.at.speeds[c] for c in self.part.rows] if speeds is None else speeds
        return [jnp.abs(u) <= part * largest for u in speeds]
