"""All sliders of a system at one instant: forces, rates, guards, and what follows an event."""

import copy
import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._jenkins import Along, Jenkins


def elongations(elements: tuple[Jenkins, ...], q: Any) -> Any:
    """Elongation of each element [m]."""
    directions = [element.direction for element in elements]
    if not isinstance(q, tuple) and all(isinstance(d, Along) and d.names is None for d in directions):
        return jnp.stack([d.row for d in directions]) @ q
    found = [jnp.asarray(direction(q), jnp.float64) for direction in directions]
    return jnp.stack([jnp.reshape(e, ()) for e in found])


def terms_of(elements: tuple[Jenkins, ...], q: Any) -> Any:
    """Size of the terms that make each elongation [m], of which its rounding is a part."""
    size = jax.tree.map(jnp.abs, q)
    found = []
    for element in elements:
        direction = element.direction
        if isinstance(direction, Along):
            found.append(Along(jnp.abs(direction.row), direction.names)(size))
        else:
            found.append(abs(jax.jvp(direction, (q,), (size,))[1]))
    return jax.lax.stop_gradient(jnp.stack([jnp.reshape(x, ()) for x in found]))


class Push(eqx.Module):
    """The generalised force of all elements, as a function of time and place."""

    elements: tuple[Jenkins, ...]
    z: Any
    k: Any

    def __call__(self, t: Any, q: Any, v: Any, args: Any) -> Any:
        places = moving(q, v)
        e, pull = jax.vjp(lambda places: elongations(self.elements, with_places(q, places)), places)
        (found,) = pull(-Sliders(self.elements, t, q, e, self.z, self.k, args).forces())
        return found


def moving(q: Any, v: Any) -> Any:
    """Coordinates without the states of first order behind them, in the form of `v`."""
    return type(v)(*q[: len(v)]) if isinstance(q, tuple) else q


def with_places(q: Any, places: Any) -> Any:
    """Coordinates and states of first order."""
    return type(q)(*places, *q[len(places) :]) if isinstance(q, tuple) else places


class Rates(NamedTuple):
    """Speeds `v` [m/s] and accelerations `a` [m/s^2] of the elongations, rates of `limit` [m/s]."""

    v: Any
    limit: Any
    a: Any = None


class Sliders:
    """Sliders at elongations `e`, in positions `z`, of which in each element `|k|` slip.

    `k` of an element has the sign of the slip; it is $n + 1$ where the element is open. Rows of
    sliders are one after the other, in each the weakest first: since they keep the order of their
    limits, those that slip are always the first ones.
    """

    def __init__(
        self, elements: tuple[Jenkins, ...], t: Any, q: Any, e: Any, z: Any, k: Any, args: Any
    ):
        counts = [element.count for element in elements]
        self.sizes, self.count = counts, np.array(counts, float)
        self.e, self.z, self.k = e, z, k
        self.varies = np.array([element.varies for element in elements])
        self.elements, self.q = elements, q
        self.of = np.repeat(np.arange(len(counts)), counts)
        self.rank = np.concatenate([np.arange(n, dtype=float) for n in counts])
        self.first = np.cumsum([0, *counts[:-1]])
        self.stiffness = jnp.concatenate([jnp.ravel(element.stiffness) for element in elements])
        self.bound = jnp.concatenate([element.bounds(t, q, args) for element in elements])
        self.limit = self.bound / self.stiffness

    def spread(self, of_elements: Any) -> Any:
        """A number of each element, for each of its sliders."""
        return of_elements if len(self.of) == len(self.count) else of_elements[self.of]

    def sums(self, of_sliders: Any) -> Any:
        """The sum over the sliders of each element."""
        if len(self.of) == len(self.count):
            return of_sliders
        ends = zip(self.first, self.sizes, strict=True)
        return jnp.stack([jnp.sum(of_sliders[a : a + n]) for a, n in ends])

    @property
    def open(self) -> Any:
        """Which elements are open."""
        return self.k > self.count

    @property
    def sense(self) -> Any:
        """Sign of the slip of each element; 0 where all its sliders stick, or where it is open."""
        return jnp.where(self.open, 0.0, jnp.sign(self.k))

    def slips(self) -> Any:
        """Which sliders slip."""
        return (self.rank < self.spread(jnp.abs(self.k))) & ~self.spread(self.open)

    def springs(self) -> Any:
        """Force of the spring of each slider [N]."""
        slips, sense = self.slips(), self.spread(self.sense)
        held = self.stiffness * (self.spread(self.e) - self.z)
        found = jnp.where(slips, sense * self.bound, held)
        return jnp.where(self.spread(self.open), 0.0, found) if self.varies.any() else found

    def forces(self) -> Any:
        """Force of each element [N]."""
        return self.sums(self.springs())

    def slider_rates(self, rates: Rates) -> Any:
        """Speed of each slider [m/s]."""
        moved = self.spread(rates.v - jnp.where(self.open, 0.0, self.sense * rates.limit))
        return jnp.where(self.slips() | self.spread(self.open), moved, 0.0)

    def guards(self, rates: Rates) -> tuple:
        """Guards of all elements, in the order of `guard_names`."""
        d, stretch = self.limit[self.first], self.e - self.z[self.first]
        # One product: both limits are far apart, and it is a polynomial where the motion is one.
        grip = (d - stretch) * (d + stretch)
        # In parts of a constant limit: before anything moves a small number is taken for rounding.
        grip = grip / jnp.where(~self.varies & (d > 0.0), d * d, 1.0)
        # It begins at zero without a slope where an element has turned: not at a rounding beside that,
        # nor with the speed that rounding has left, which is stopped within a rounding of the way.
        rounding = ENGINE.few_roundings * self.terms[self.first]
        near = jnp.abs(d - jnp.abs(stretch)) <= rounding
        left = jnp.sign(stretch) * rates.v - rates.limit
        turned = near & (jnp.square(left) <= rounding * jnp.abs(rates.a))
        grip = jnp.where(turned, 0.0, grip - jax.lax.stop_gradient(jnp.where(near, grip, 0.0)))
        turn = self.sense * rates.v - rates.limit
        both, turn = jnp.where(self.k == 0.0, grip, turn), jnp.where(self.k == 0.0, 1.0, turn)
        if self.varies.any():
            both, bound = jnp.where(self.open, 1.0, both), self.bound[self.first]
            lifts = jnp.where(self.open, -bound, bound)
        found: list[Any] = []
        for j, n in enumerate(self.sizes):
            found += (
                [both[j]] if n == 1 else [jnp.where(self.k[j] == 0.0, both[j], self._room(j)), turn[j]]
            )
            found += [lifts[j]] if self.varies[j] else []
        return tuple(found)

    def _room(self, j: int) -> Any:
        """How far the elongation of an element is from where the next slider slips [m]."""
        row = slice(self.first[j], self.first[j] + self.sizes[j])
        # By a sum, because the slope of an index is one that no fused loop takes.
        next_one = np.arange(self.sizes[j], dtype=float) == jnp.abs(self.k[j])
        room = jnp.sum(jnp.where(next_one, self.limit[row] + self.sense[j] * self.z[row], 0.0))
        return jnp.where(next_one.any(), room - self.sense[j] * self.e[j], 1.0)

    # -- what follows an event

    def at_limit(self, sense: Any) -> Any:
        """How many sliders of each element are at their limit in this sense, times the sense."""
        return sense * self._leading(self._reaches(sense))

    def _reaches(self, sense: Any) -> Any:
        stretch = self.spread(self.e) - self.z
        return self.spread(sense) * stretch >= self.limit - ENGINE.edge * self.terms

    @functools.cached_property
    def terms(self) -> Any:
        """Size of what makes the stretch of each spring [m]."""
        return self.spread(terms_of(self.elements, self.q)) + jnp.abs(self.z) + jnp.abs(self.limit)

    def _leading(self, which: Any) -> Any:
        """How many sliders of each element, from the first on without a gap, are such."""
        if len(self.of) == len(self.count):
            return which.astype(jnp.float64)
        ends = zip(self.first, self.sizes, strict=True)
        rows = [jnp.cumprod(which[a : a + n].astype(jnp.float64)) for a, n in ends]
        return jnp.stack([jnp.sum(row) for row in rows])

    def admissible(self) -> Any:
        """Whether no spring is beyond its limit, and those of an element are in their order."""
        stretch, terms = self.spread(self.e) - self.z, self.terms
        inside = jnp.abs(stretch) <= self.limit + ENGINE.edge * terms
        good = jnp.all(inside | self.spread(self.gone))
        if len(self.of) == len(self.count):
            return good
        slack = ENGINE.edge * (terms[1:] + terms[:-1])
        ordered = jnp.abs(jnp.diff(self.z)) <= jnp.diff(self.limit) + slack
        return good & jnp.all(ordered | (np.diff(self.of) > 0))

    @property
    def gone(self) -> Any:
        """Which elements are open by their bound."""
        return self.varies & (self.bound[self.first] <= 0.0)

    def states(self, rates: Rates) -> Any:
        """State of each element by the numbers: what is at its limit and moves on slips."""
        pulls = jnp.sign(self.e - self.z[self.first])  # of an element with one slider
        sense = jnp.where(rates.v == 0.0, jnp.sign(rates.a), jnp.sign(rates.v))
        sense = jnp.where(self.varies & (pulls != 0.0), pulls, sense)
        goes = sense * rates.v - rates.limit
        goes = (goes > 0.0) | ((goes == 0.0) & (sense * rates.a > 0.0))
        # Without a bound nothing sticks.
        goes = goes | (~self.varies & (self.limit[self.first] == 0.0))
        found = jnp.where(goes, self.at_limit(jnp.where(sense == 0.0, 1.0, sense)), 0.0)
        closed = self.bound[self.first] > 0.0
        closed = closed | ((self.bound[self.first] == 0.0) & (rates.limit > 0.0))
        return jnp.where(self.varies & ~closed, self.count + 1.0, found)

    def at_their_limits(self, k: Any) -> Any:
        """Positions with all that slip, or did so until now, at their limits; followers at 0 force."""
        after = copy.copy(self)
        after.k = k
        e, z = self.spread(self.e), self.z
        for one in (self, after):
            z = jnp.where(one.slips(), e - self.spread(one.sense) * self.limit, z)
        return jnp.where(self.spread(self.open | after.open), e, z)

    def within_limits(self) -> Any:
        """Positions to which sliders are dragged at once, where a bound has jumped."""
        e, d = self.spread(self.e), jnp.maximum(self.limit, 0.0)
        return jnp.clip(self.z, e - d, e + d)

    def after_guard(self, number: Any, rates: Rates) -> Any:
        """States of the elements after the guard of this number, counted from the first of these."""
        single = self.count == 1
        guards = 2 - single.astype(np.int32) + self.varies
        begin = (np.cumsum(guards) - guards).astype(np.int32)
        number = jnp.asarray(number, jnp.int32)
        first = number == begin
        grips = first & ((self.k == 0.0) | ~single)
        turns = jnp.where(single, first & (self.k != 0.0), number == begin + 1)
        toggles = self.varies & (number == begin + guards.astype(np.int32) - 1)
        pulled = jnp.where(self.k == 0.0, jnp.sign(self.e - self.z[self.first]), self.sense)
        pulled = jnp.where(pulled == 0.0, 1.0, pulled)
        # Others that are at their limits too slip with the one that does.
        least = jnp.minimum(jnp.abs(self.k) + 1.0, self.count)
        more = pulled * jnp.maximum(jnp.abs(self.at_limit(pulled)), least)
        back = jnp.where(self.varies, 0.0, self.at_limit(-self.sense))
        closed = jnp.where(jnp.abs(rates.v) > rates.limit, jnp.sign(rates.v), 0.0)
        toggled = jnp.where(self.open, closed, self.count + 1.0)
        found = jnp.where(grips, more, jnp.where(turns, back, self.k))
        return jnp.where(toggles, toggled, found)

    def after_jump(self, rates: Rates) -> Any:
        """States after speeds have jumped: a slider that would go back sticks."""
        goes = self.sense * rates.v - rates.limit >= 0.0
        keeps = self.open | ((self.k != 0.0) & goes)
        return jnp.where(keeps, self.k, self.states(rates))


def guard_names(names: tuple[str, ...], elements: tuple[Jenkins, ...]) -> tuple[str, ...]:
    """One guard of a slider alone; of several when the next one slips, and when they turn; one more
    of an element that may open."""
    found = []
    for name, element in zip(names, elements, strict=True):
        if element.count == 1:
            found.append(f"{name} slips or turns")
        else:
            found += [f"{name}: one more slips", f"{name} turns"]
        found += [f"{name} opens or closes"] if element.varies else []
    return tuple(found)
