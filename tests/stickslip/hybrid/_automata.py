"""Random hybrid automata, and their motion by matrix exponentials.

Three modes, each linear in place, speed, a lag and a harmonic load, so that between events the whole
state is `expm(A t) z`; five guards of all directions; transitions that throw, set back or clear a part
of the state and lead to any mode. Zeros are located by Brent's method on a grid of 0.01 s whose every
minimum is looked at.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

import stickslip as ss

GUARDS = ("first", "second", "third", "fourth", "fifth")
WORDS = ("falling", "falling", "rising", "both", "both")
SIDES = np.array([1.0, 1.0, -1.0, 0.0, 0.0])
STEP = 0.01
NEAR = 1e-9  # of a guard that has just fired


class State(NamedTuple):
    x: Any
    v: Any
    w: Any


class Automaton(ss.AbstractHybridSystem):
    """z = (x, v, w, cos, sin, 1): `rates[mode] @ z`, `levels[mode] @ z`, `resets[guard] @ z`."""

    rates: Any
    levels: Any
    resets: Any
    leads_to: Any
    frequency: Any

    mode_names: ClassVar = ("a", "b", "c")
    guard_names: ClassVar = GUARDS
    guard_directions: ClassVar = WORDS

    def _row(self, t, y):
        load = jnp.cos(self.frequency * t), jnp.sin(self.frequency * t), jnp.ones_like(y.x)
        return jnp.stack([y.x, y.v, y.w, *load])

    def vector_field(self, t, y, mode, args):
        slope = self.rates[mode] @ self._row(t, y)
        return State(slope[0], slope[1], slope[2])

    def guards(self, t, y, mode, args):
        return tuple(self.levels[mode] @ self._row(t, y))

    def transition(self, t, y, mode, guard, args):
        after = self.resets[guard] @ self._row(t, y)
        return State(after[0], after[1], after[2]), self.leads_to[mode, guard]

    def initial_mode(self, t, y, args):
        return 0


def drawn(rng: np.random.Generator) -> tuple[Automaton, np.ndarray]:
    """An automaton, and a start inside of its first mode."""
    frequency = rng.choice([0.7, 1.3, 2.1])
    rates, levels = np.zeros((3, 6, 6)), np.zeros((3, 5, 6))
    resets = np.zeros((5, 3, 6))
    rates[:, 0, 1], rates[:, 3, 4], rates[:, 4, 3] = 1.0, -frequency, frequency
    levels[:, :, 5] = np.where(SIDES < 0.0, -1.0, 1.0)
    for mode in range(3):
        rates[mode, 1] = (
            -rng.uniform(0.5, 6.0), -rng.uniform(0.0, 0.4), rng.uniform(-0.5, 0.5),
            rng.uniform(-1.0, 1.0), 0.0, rng.uniform(-1.0, 1.0),
        )  # fmt: skip
        rates[mode, 2, 0], rates[mode, 2, 2] = rng.uniform(-1.0, 1.0), -rng.uniform(0.1, 2.0)
        for guard, side in enumerate(SIDES):
            if rng.random() < 0.55:
                row = np.zeros(6)
                row[rng.integers(3)] = rng.choice([-1.0, 1.0])
                row[rng.integers(3)] += rng.choice([0.0, 0.0, rng.uniform(-1.0, 1.0)])
                row[3] = rng.choice([0.0, 0.0, rng.uniform(-0.5, 0.5)])
                row[5] = side * rng.uniform(0.1, 0.8) if side else rng.uniform(-0.4, 0.4)
                levels[mode, guard] = row
    for reset in resets:
        reset[:, :3] = np.eye(3)
        kind = rng.random()
        if kind < 0.4:
            reset[1, 1] = rng.choice([-0.8, 0.9, 1.1, -1.0, 0.5, 0.0])
        elif kind < 0.6:
            reset[0, 5] = rng.uniform(-0.3, 0.3)
        elif kind < 0.7:
            reset[2, 2] = 0.0
    leads_to = rng.integers(0, 3, (3, 5))
    # A border that keeps its mode is met again at once, most of the time for ever.
    leads_to = np.where(SIDES == 0.0, leads_to, (np.arange(3)[:, None] + 1 + leads_to // 2) % 3)
    leads_to = leads_to.astype(np.int32)
    while True:
        start = rng.uniform(-1.0, 1.0, 3)
        at_start = levels[0] @ [*start, 1.0, 0.0, 1.0]
        if np.all((SIDES * at_start)[SIDES != 0.0] > 0.01):
            break
        levels[0, SIDES != 0.0, 5] += 0.1 * SIDES[SIDES != 0.0]
    return Automaton(rates, levels, resets, leads_to, frequency), start


class Course(NamedTuple):
    """Events as pairs of time and guard, the end, and why it may be undecided (or None)."""

    events: list[tuple[float, int]]
    end: np.ndarray | None
    mode: int
    doubt: str | None


def by_exponentials(machine: Automaton, start: np.ndarray, t1: float, most: int = 40) -> Course:
    """The motion from time 0 to `t1`."""
    rates, levels = np.asarray(machine.rates), np.asarray(machine.levels)
    step = [expm(a * STEP) for a in rates]
    z, t, mode, events, fired = np.array([*start, 1.0, 0.0, 1.0]), 0.0, 0, [], set()
    doubts: list[str] = []
    while True:
        a, g = rates[mode], levels[mode]
        values, slopes = g @ z, g @ a @ z
        # One that fires both ways has its own sign, and once it has fired the sign that it goes to.
        side = np.where(SIDES == 0.0, np.sign(values), SIDES)
        for i in fired:
            goes = np.sign(slopes[i] or (g @ a @ a @ z)[i])
            side[i] = goes if abs(values[i]) < NEAR else side[i]
        moves = np.abs(g[:, :5]).sum(1) > 0.0
        if np.any(moves & (np.abs(values) < 1e-6) & (values != 0.0) & (np.abs(slopes) < 1e-4)):
            doubts.append("near and flat")
        low = side * values
        beyond = moves & (SIDES != 0.0)
        beyond &= (low < -NEAR) | ((np.abs(low) <= NEAR) & (side * slopes <= 0.0))
        if beyond.any():
            found = 0.0, int(np.flatnonzero(beyond)[0])
            if beyond.sum() > 1:
                doubts.append("two at once")
        else:
            found, t, z = _next(a, g, side, moves, z, t, t1, step[mode], doubts)
        if found is None:
            return Course(events, z[:3], mode, doubts[0] if doubts else None)
        after, i = found
        z, t = expm(a * after) @ z, t + after
        y = np.asarray(machine.resets)[i] @ z
        w = float(machine.frequency)
        z = np.array([*y, np.cos(w * t), np.sin(w * t), 1.0])
        mode = int(np.asarray(machine.leads_to)[mode, i])
        if not (events and events[-1][0] == t):
            fired = set()
        elif fired:
            doubts.append("both ways, and another in the same instant")
        fired |= {i} if SIDES[i] == 0.0 else set()
        events.append((t, i))
        if len(events) > most or (len(events) > 12 and events[-13][0] == t):
            return Course(events, None, mode, "many events")


def _next(a, g, side, moves, z, t, t1, whole, doubts):
    """Time from the last place of the grid to the next event and its guard, or None; that place."""
    first = True
    while t < t1:
        h = min(STEP, t1 - t)
        z1 = (whole if h == STEP else expm(a * h)) @ z
        begin, end = side * (g @ z), side * (g @ z1)
        falls, rises = side * (g @ a @ z), side * (g @ a @ z1)
        if first:
            begin[np.abs(begin) < NEAR] = 0.0
        found = []
        for i in np.flatnonzero(moves):

            def value(s, i=i, z=z):
                return side[i] * (g[i] @ expm(a * s) @ z)

            def slope(s, i=i, z=z):
                return side[i] * (g[i] @ a @ expm(a * s) @ z)

            left = 0.0
            if end[i] < 0.0:
                if begin[i] <= 0.0 and falls[i] > 0.0 > rises[i]:  # it leaves zero and comes back
                    left = brentq(slope, 0.0, h)
                if value(left) > 1e-13:
                    found.append((brentq(value, left, h, xtol=1e-16), i))
                else:
                    doubts.append("a hop")
            elif falls[i] < 0.0 < rises[i] and begin[i] > 0.0:
                bottom = brentq(slope, 0.0, h)
                if abs(value(bottom)) < 1e-5:
                    doubts.append("graze")
                if value(bottom) < 0.0:
                    found.append((brentq(value, 0.0, bottom, xtol=1e-16), i))
        first = False
        if found:
            after, i = min(found)
            if any(j != i and other - after < 1e-7 for other, j in found):
                doubts.append("two at once")
            if abs(g[i] @ a @ expm(a * after) @ z) < 1e-4:
                doubts.append("graze")
            return (after, i), t, z
        z, t = z1, t + h
    return None, t, z
