"""The friction laws of a group of contacts side by side: what each can bear, and how each slides."""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from stickslip._fastmath import where
from stickslip.friction import Coulomb

from ._contact import Contact
from ._modes import sense_of
from ._rows import NumberRow, each

NO_LIMIT = math.inf  # what a stop can bear, a constant that the program knows

# The numbers of `resisting`, for messages.
RESISTING = (
    "static coefficient forward", "static coefficient backward",
    "kinetic coefficient forward from rest", "kinetic coefficient backward from rest",
    "kinetic coefficient at the speed of the start",
)  # fmt: skip


def resisting(contact: Contact, speed: Any) -> list[Any]:
    """Coefficients of a loaded contact at rest and at a speed, that of the opposite sense positive.

    Kinetic ones of a law that does not claim to be dissipative are 0, since it may drive.
    """
    law = contact.law
    found = [law.static_coefficient(1), law.static_coefficient(-1)]
    if not law.is_dissipative:
        return [*found, 0.0, 0.0, 0.0]
    moving = where(contact.normal_force > 0.0, jnp.sign(speed) * law.coefficient(speed), 0.0)
    return [*found, law.kinetic_limit(1), law.kinetic_limit(-1), moving]


def drives(contacts: Sequence[Contact], speeds: Sequence[Any]) -> Any:
    """Whether friction of a contact drives at its speed, or would from rest, in place of resisting."""
    pairs = zip(contacts, speeds, strict=False)
    found = [x < 0.0 for contact, speed in pairs for x in resisting(contact, speed)]
    return functools.reduce(jnp.logical_or, found, jnp.zeros((), bool))


class Bounds(NamedTuple):
    """Force that each contact can bear [N], from `low` <= 0 to `high` >= 0; `low` is None for `-high`.

    A stop bears any force off it, from 0 to the constant `NO_LIMIT`.
    """

    low: NumberRow | None
    high: NumberRow

    @property
    def lower(self) -> NumberRow:
        """The lower bounds."""
        if self.low is not None:
            return self.low
        return each(lambda high: 0.0 if high is NO_LIMIT else -high, self.high)


class Laws:
    """The laws of the contacts and stops of a group: as one law of rows if they are of one kind."""

    def __init__(self, contacts: Sequence[Contact], row: Callable = tuple, stops: int = 0):
        self.contacts, self._row, self.stops = contacts, row, stops
        self.odd = all(contact.law.is_odd for contact in contacts)
        # Their kinetic friction is the same at all speeds.
        self._coulomb = all(type(contact.law) is Coulomb for contact in contacts)

    @functools.cached_property
    def loads(self) -> NumberRow:
        """Normal forces [N]."""
        return self._row([contact.normal_force for contact in self.contacts])

    @functools.cached_property
    def _one(self) -> Any:
        """A law whose parameters are rows; None where the laws are not alike, or stay apart."""
        laws = [contact.law for contact in self.contacts]
        leaves = [jax.tree.leaves(law) for law in laws]
        if isinstance(self.loads, tuple) or any(jnp.ndim(x) for those in leaves for x in those):
            return None
        form = jax.tree.structure(laws[0])
        if any(jax.tree.structure(law) != form for law in laws):
            return None
        return jax.tree.unflatten(form, [self._row(list(x)) for x in zip(*leaves, strict=True)])

    def _each(self, of: Any, *rows: NumberRow) -> NumberRow:
        """`of(law, normal_force, ...)` of every contact."""
        if self._one is not None:
            return of(self._one, self.loads, *rows)
        laws = tuple(contact.law for contact in self.contacts)
        if isinstance(self.loads, tuple):
            return each(of, laws, self.loads, *rows)
        return self._row([of(law, self.loads[c], *(r[c] for r in rows)) for c, law in enumerate(laws)])

    def bounds(self, which: str) -> Bounds:
        """By the coefficient of the laws named `which`, and what stops can bear."""
        found = self._of_contacts(which)
        if not self.stops:
            return found
        none, any_force = (0.0,) * self.stops, (NO_LIMIT,) * self.stops
        return Bounds((*found.lower, *none), (*found.high, *any_force))

    def _of_contacts(self, which: str) -> Bounds:
        if which == "kinetic_limit" and self._coulomb:
            laws: list[Any] = [contact.law for contact in self.contacts]
            pairs = zip(laws, self.contacts, strict=True)
            return Bounds(None, self._row([law.mu_k * contact.normal_force for law, contact in pairs]))

        def ahead(law, load):
            return getattr(law, which)(1) * load

        if self.odd:
            return Bounds(None, self._each(ahead))
        behind = self._each(lambda law, load: getattr(law, which)(-1) * load)
        return Bounds(each(lambda x: -x, self._each(ahead)), behind)

    def friction(self, speeds: Callable[[], NumberRow], states: NumberRow) -> NumberRow:
        """Friction of each contact that slides in the sense of its state [N]; 0 of those at rest."""
        if self._coulomb:
            return each(lambda s, limit: -s * limit, states, self._of_contacts("kinetic_limit").high)
        slips = self._each(
            lambda law, load, u, s: law.slip_force(u, load, sense_of(s)), speeds(), states
        )
        return each(lambda s, force: where(s == 0.0, 0.0, force), states, slips)
