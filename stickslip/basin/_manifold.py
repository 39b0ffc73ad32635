"""The stable manifold of a saddle under a force: the border in a plane of starts, place by place."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicHermiteSpline

from .._jit_by_code import jit_by_code
from .._validation import refusal
from ..hybrid import SaveAt, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._lanes import Lanes, motion_of
from ._settle import Settle


class Saddle(NamedTuple):
    """An orbit with one growing deviation, at whole periods of the forcing.

    - `places`: states `[place, size]`. `across`: `[place, size]`, left eigenvectors of the growing
      multiplier: a small deviation `d` from a place grows unless `across @ d` is 0. `turn`: period of
      each number that is an angle, infinite for the others.
    """

    places: np.ndarray
    across: np.ndarray
    turn: np.ndarray


def saddle_of(
    lanes: Lanes, forcing: float, begin: float, period: float, y: np.ndarray, mode: int,
    turn: np.ndarray,
) -> Saddle | None:  # fmt: skip
    """The saddle at the orbit from a state; None with more than one growing deviation, or none.

    `begin`, `period` [s]: when the orbit is there, and when again, after periods of the `forcing`.
    """
    places, across = [], []
    for number in range(round(period / forcing)):
        t = begin + number * forcing
        if number:
            moved = lanes(t - forcing, t, y[None], np.array([mode]))
            y, mode = moved.y[0], int(moved.mode[0])
        given = lanes.system, lanes.args, lanes.integrator, lanes.unravel
        values, left = np.linalg.eig(np.asarray(_return(*given, t, t + period, y, mode)).T)
        grows = np.abs(values) > 1.0
        if np.sum(grows) != 1:
            return None
        places.append(y)
        across.append(np.real(left[:, int(np.argmax(grows))]))
    return Saddle(np.array(places), np.array(across), turn)


class Manifold:
    """Places of the plane of a box from which motions come to a saddle.

    After $k$ periods of the forcing a motion from $u$ is beside the manifold by
    $F_k(u) = l \\cdot (P^k(u) - x)$, but for the square of its distance $d$ from the saddle $x$, and
    growth has made that $|F_k'|$ times what it was. So $F_k = 0$ is the manifold to $d^2 / |F_k'|$: the
    more exactly the longer a motion takes. `states` are those of places, `[..., 2]` to `[..., size]`;
    `between` is the place of a border between two, or None.
    """

    def __init__(
        self,
        lanes: Lanes,
        settle: Settle,
        saddle: Saddle,
        states: Any,
        between: Any,
        limits: np.ndarray,
    ):
        self.lanes, self.saddle, self.limits = lanes, saddle, limits
        self.states, self.between = states, between
        self.size = np.ptp(limits, axis=1)
        forcing = settle.forcing_period
        assert forcing is not None
        self.ts = forcing * np.arange(1 + round(settle.times[-1] / forcing))
        self.plane = states(np.diag(self.size)) - states(np.zeros((2, 2)))

    def step_to(
        self, place: np.ndarray, least: int
    ) -> tuple[np.ndarray, np.ndarray, float, int] | None:
        """Newton's step to the manifold, its normal, and how well it is known, in parts of the box.

        By where the motion is nearest to the saddle, after a number of periods that is returned, too,
        and that is at least some.
        """
        lanes, start = self.lanes, self.states(place)
        angle = np.isfinite(self.saddle.turn)
        turn = self.saddle.turn[angle]
        given = lanes.system, lanes.args, lanes.integrator, lanes.unravel
        slope, y = (np.asarray(a) for a in _on_the_way(*given, self.ts, start, self.plane))
        apart = y[:, None] - self.saddle.places
        apart[..., angle] -= turn * np.round(apart[..., angle] / turn)
        away = np.linalg.norm(apart / self.states(self.size), axis=2)
        away = np.where(np.isfinite(away), away, np.inf)
        k = min(max(int(np.argmin(np.min(away, axis=1))), least), len(away) - 1)
        at = int(np.argmin(away[k]))
        across = self.saddle.across[at]
        across = across / np.linalg.norm(across * self.states(self.size))
        gradient = across @ slope[k]
        steep = float(np.linalg.norm(gradient))
        if not (np.isfinite(steep) and steep > 0.0):
            return None
        error = float(away[k, at]) ** 2 / steep
        return -float(across @ apart[k, at]) * gradient / steep**2, gradient / steep, error, k

    def nearest_place(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """The place on the manifold nearest to one beside it, and the tangent there."""
        least, narrow = 0, ENGINE.same * ACCURACY.near**2
        for _ in range(ACCURACY.levels):
            found = self.step_to(place, least)
            if found is None:
                return None
            step, normal, error, k = found
            place = place + step * self.size
            length = float(np.linalg.norm(step))
            if max(length, error) <= narrow:
                return place, np.array([-normal[1], normal[0]])
            # It is known no better by this period; by the next one, deviations have grown once more.
            least = k + 1 if length <= error else least
        return None

    def tangent_at(self, place: np.ndarray) -> np.ndarray | None:
        """The tangent at a place of a border; None if the border is another one than this."""
        found = self.nearest_place(place)
        if found is None or np.max(np.abs(found[0] - place) / self.size) > ENGINE.same:
            return None
        return found[1]

    def follow(self, place: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Places from one on the edge, along its tangent, to the first outside of the box."""
        places, tangents = [place], [along]
        step, least = ACCURACY.near**2, ENGINE.same
        while len(places) == 1 or self._inside(places[-1]):
            if len(places) > ACCURACY.places:
                allowed = f"one whose border is shorter than {len(places)} places: it may be fractal"
                raise refusal("found.box", self.limits.tolist(), allowed)
            last, along = places[-1], tangents[-1]
            found = self.nearest_place(last + step * along * self.size)
            if found is not None:
                way = (found[0] - last) / self.size
                tangent = found[1] * np.sign(found[1] @ along)
                bend = np.arccos(min(float(tangent @ along), 1.0))
                fits = _goes_on(way, along, tangent) and np.linalg.norm(way) < 2.0 * step
                # A corner, as friction makes them, bends however short the step is.
                if fits and (bend <= ACCURACY.near or step == least):
                    places.append(found[0])
                    tangents.append(tangent)
                    longer = 2.0 if bend < 0.25 * ACCURACY.near else 1.0
                    step = min(longer * step, ACCURACY.near)
                    continue
            if step == least:
                raise self._no_border_at(last)
            step = max(0.5 * step, least)
        return self._curve_through(*self._fine(places, tangents))

    def _no_border_at(self, place: np.ndarray) -> Exception:
        allowed = f"one in which no border ends as it does near {np.round(place, 6).tolist()}"
        return refusal("found.box", self.limits.tolist(), allowed)

    def _inside(self, place: np.ndarray) -> bool:
        return bool(np.all((place >= self.limits[:, 0]) & (place <= self.limits[:, 1])))

    def _place_between(
        self, place: np.ndarray, along: np.ndarray, length: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same near a corner, where Newton's method may not come to it."""
        beside = 0.5 * length * np.array([-along[1], along[0]]) * self.size
        found = self.between(place - beside, place + beside)
        new = None if found is None else self.nearest_place(found)
        if new is None:
            raise self._no_border_at(place)
        return new

    def _fine(self, places: list, tangents: list) -> tuple[np.ndarray, np.ndarray]:
        """Places so close that the cubics between them are on the manifold."""
        found = [(places[0], tangents[0])]
        todo = list(zip(places, tangents, strict=True))[:0:-1]
        while todo:
            (one, leaving), (other, arriving) = found[-1], todo[-1]
            way = (other - one) / self.size
            length = float(np.linalg.norm(way))
            if not _goes_on(way, leaving, arriving):
                raise self._no_border_at(one)
            middle = 0.5 * (one + other) + 0.125 * length * (leaving - arriving) * self.size
            if length <= ENGINE.same:
                found.append(todo.pop())
                continue
            new = self.nearest_place(middle) or self._place_between(middle, leaving, length)
            todo.append((new[0], new[1] * np.sign(new[1] @ leaving)))
            # Of two halves it is a sixteenth each.
            off = float(np.linalg.norm((new[0] - middle) / self.size))
            if off <= 16.0 * ENGINE.same * ACCURACY.near:
                found += [todo.pop(), todo.pop()]
        return np.array([place for place, _ in found]), np.array([tangent for _, tangent in found])

    def _curve_through(self, places: np.ndarray, tangents: np.ndarray) -> np.ndarray:
        """Many places on the cubics through some with their tangents."""
        scaled = places / self.size
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(scaled, axis=0), axis=1))])
        curve = CubicHermiteSpline(way, scaled, tangents)
        return curve(np.linspace(0.0, way[-1], ACCURACY.corners)) * self.size


def _goes_on(way: np.ndarray, leaving: np.ndarray, arriving: np.ndarray) -> bool:
    """Whether a way is along the tangents at its ends, and not across to the next fold of the curve."""
    middle = leaving + arriving
    return float(way @ middle) > 0.5 * float(np.linalg.norm(way) * np.linalg.norm(middle))


@jit_by_code
def _return(system, args, integrator, unravel, t0, t1, y, mode):
    return jax.jacfwd(
        lambda y: motion_of(system, args, integrator, unravel, t0, t1, y, jnp.asarray(mode)).y
    )(y)


@jit_by_code
def _on_the_way(system, args, integrator, unravel, ts, y, plane):
    """Slopes of the states at times along two changes, `[time, size, 2]`, and the states."""

    def states(part):
        run = simulate(
            system, ts[0], ts[-1], unravel(y + part @ plane), None, args, integrator=integrator,
            saveat=SaveAt(ts=ts, max_events=None), throw=False,
        )  # fmt: skip
        assert run.outputs is not None
        leaves = jax.tree.leaves(run.outputs.y)
        rows = jnp.concatenate([leaf.reshape(len(ts), -1) for leaf in leaves], axis=1)
        return rows, rows

    return jax.jacfwd(states, has_aux=True)(jnp.zeros(2))
