"""Shares of a rectangle without sampling: the borders of basins in a plane, arc by arc."""

from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import PyTree

from .._types import Given
from .._validation import check_type, refusal
from ..continuation import PeriodicOrbit
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.components import numbers_of
from ._accuracy import ACCURACY
from ._basins import Basins, check_start, turns
from ._border import border_between, border_motion, is_narrow, on_border
from ._codes import FAILED, LEFT, NOT_SETTLED, OTHERS
from ._judged import Judged, codes_from
from ._lanes import Lanes, rows_of
from ._manifold import Manifold, saddle_of
from ._settle import Settle


class _Arc(NamedTuple):
    """Places on a border from the edge on, `[place, 2]`; codes to the left and to the right of it;
    whether it ends at the edge."""

    places: np.ndarray
    left: int
    right: int
    through: bool


def border_shares(
    system: Given[AbstractHybridSystem],
    found: Given[Basins],
    settle: Given[Settle],
    *,
    integrator: Given[Integrator | None] = None,
    args: PyTree = None,
) -> dict[str, float]:
    r"""Shares of the box of a map by its borders, of a system with two numbers in its state.

    The edge of the box is searched for places where the attractor changes, and each is enclosed as
    narrowly as numbers allow. The motion from there is the border: it goes through the box, or to a
    saddle, whose stable manifold it is. Under a force of the time the border is the stable manifold of
    a saddle of the map of a period, which is followed from place to place by Newton's method. By
    Green's theorem the area of a basin is

    $$A = \tfrac12 \oint x\,dy - y\,dx$$

    along its parts of the edge and its borders. A basin that does not reach the edge lies inside of an
    unstable orbit, which is solved (`border_motion`).

    **Arguments** `system`, `args`, `integrator`, `settle`: those of the map `found`. Motions beside a
    border are followed for up to eight times the duration, until it is enclosed.

    **Returns** the share of each attractor of the map by name, to some 1e-7, and of "left the limits"
    where motions from the edge do. A part of a basin that is narrower at the edge than a 256th of a
    side may be missed.

    **Errors** `ValueError`/`TypeError` naming the argument; `ValueError` for other than two numbers,
    where a part of the edge is not settled, where a border begins inside of the box, is too long to be
    followed, as a fractal one, or is that of what only the limits say, and where the map itself says
    otherwise.
    """
    check_type("found", found, Basins, "a Basins")
    check_type("settle", settle, Settle, "a Settle(duration)")
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator or None")
    axes = found.code.ndim
    first = jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[axes:])[0], found.starts)
    y0, box = check_start(system, first, found.box, settle, args)
    names = numbers_of(y0)
    if len(names) != 2 or len(box) != 2:
        raise refusal("found", found, "of a box of both numbers of a state")
    places = [names.index(name) for name in box]
    lanes = Lanes(system, args, integrator, y0)
    start = rows_of(found.starts, found.code.size)[:1]
    turn = turns(system, y0)
    attractors = Judged(lanes, settle, start, turn, found.attractors).attractors
    if [a.name for a in attractors] != [a.name for a in found.attractors]:
        raise refusal("found", found, "of the same system")
    limits = np.array(list(box.values()))
    kind = _Plane if settle.forcing_period is None else _Section
    plane = kind(lanes, settle, attractors, limits, places, turn)
    areas, arcs = plane.edge()
    for arc in arcs:
        areas[arc.left] += _swept(arc.places)
        areas[arc.right] -= _swept(arc.places)
    _close(areas, arcs, limits)
    rows, code = rows_of(found.starts, found.code.size), np.ravel(found.code)
    known = ~_is_open(code)
    if np.any(code == LEFT) and not areas[LEFT]:
        raise refusal("found.box", box, f"one whose edge all basins reach, also {OTHERS[LEFT]!r}")
    for k in np.flatnonzero((areas == 0.0) & np.isin(np.arange(len(areas)), code)):
        # Inside of an orbit, about which there is the basin that is nearest.
        away = np.linalg.norm(rows[known] - rows[code == k][0], axis=1)
        around = next(j for j in code[known][np.argsort(away)] if j != k)
        if around == LEFT or settle.forcing_period is not None:
            raise refusal("found.box", box, "one whose edge all basins reach")
        between = attractors[k].name, attractors[around].name
        orbit = border_motion(system, found, between, settle, integrator=integrator, args=args)
        if not isinstance(orbit, PeriodicOrbit):
            raise refusal("found.box", box, "one whose edge all basins reach, or that an orbit borders")
        start = rows_of(orbit.y0, 1)[0, places]
        inside = abs(_swept(plane.motion(start, float(orbit.period) / int(orbit.repeats))))
        areas[k], areas[around] = areas[k] + inside, areas[around] - inside
    shares = areas / np.prod(np.ptp(limits, axis=1))
    names_of = dict(enumerate(attractor.name for attractor in attractors))
    if areas[LEFT]:
        names_of[LEFT] = OTHERS[LEFT]
    for k, name in names_of.items():
        share, seen = shares[k], float(np.mean(code == k))
        # Two standard errors of a half, of points that are spread more evenly than random ones.
        if abs(seen - share) > code.size**-0.5 + np.mean(~known):
            raise refusal(f"found.shares[{name!r}]", seen, f"near {share:.4g}, as the edge says")
    return {name: float(shares[k]) for k, name in names_of.items()}


class _Plane:
    """The box and the motions in it."""

    def __init__(
        self, lanes: Lanes, settle: Settle, attractors: list, limits: Any, places: list[int],
        turn: np.ndarray,
    ):  # fmt: skip
        self.lanes, self.settle, self.attractors = lanes, settle, attractors
        self.limits, self.places, self.turn = limits, places, turn

    def states(self, places: np.ndarray) -> np.ndarray:
        """States at places of the box."""
        rows = np.empty_like(places)
        rows[..., self.places] = places
        return rows

    def edge(self) -> tuple[np.ndarray, list[_Arc]]:
        """Parts that basins have of the integral along the edge, and the borders that begin there."""
        (a, b), (c, d) = self.limits
        corners = np.array([[a, c], [b, c], [b, d], [a, d], [a, c]])
        part = np.linspace(0.0, 4.0, ACCURACY.block, endpoint=False)
        side = part.astype(int)
        ring = corners[side] + (part - side)[:, None] * (corners[side + 1] - corners[side])
        code = codes_from(self.lanes, self.settle, self.attractors, self.states(ring))
        open_ = _is_open(code)
        if np.any(open_ & (np.roll(open_, 1) | np.roll(open_, -1))):
            word = OTHERS[int(np.min(code[open_]))]
            raise refusal("settle", self.settle, "one with which the edge of the box settles", but=word)
        ring, code = ring[~open_], code[~open_]
        # There may be more attractors on the way: states at rest to which nothing in the map came.
        # That of "left the limits" is the second from the end, by its number.
        areas, arcs, outs = np.zeros(ACCURACY.block), [], 0
        for i in range(len(ring)):
            here, after, own = ring[i], ring[(i + 1) % len(ring)], int(code[i])
            while own != code[(i + 1) % len(ring)]:
                low, high, beyond = self.change_between(here, after, own)
                inner, outer = here + low * (after - here), here + high * (after - here)
                middle = 0.5 * (inner + outer)
                areas[own] += _swept(np.stack([here, middle]))
                arc = self.border(middle, (after - here) / np.linalg.norm(after - here), own, beyond)
                if arc is None:
                    outs += 1
                else:
                    arcs.append(arc)
                here, own = outer, beyond
            areas[own] += _swept(np.stack([here, after]))
        if outs != sum(arc.through for arc in arcs):
            allowed = f"one whose edge borders leave as often as they come there, not {outs} times"
            raise refusal("found.box", self.limits.tolist(), allowed)
        return areas, arcs

    def change_between(self, one: np.ndarray, other: np.ndarray, own: int) -> tuple[float, float, int]:
        """`border_between` two places, the first with the code `own`."""
        ends = self.states(one), self.states(other)
        given = self.lanes, self.settle, self.attractors, ends, own
        low, high, beyond = border_between(*given, lambda now: ~_is_open(now) & (now != own))
        if not is_narrow(low, high):
            allowed = "long enough for motions beside the borders to settle"
            raise refusal("settle.duration", self.settle.duration, allowed)
        return low, high, beyond

    def border(self, place: np.ndarray, along: np.ndarray, left: int, right: int) -> _Arc | None:
        """The border from a place of the edge on, or None where it comes out of the box there."""
        end, size = self.settle.duration, np.ptp(self.limits, axis=1)
        own = self.motion(place, end)
        first = self.first_out(own)
        while 0 < first < ACCURACY.many:
            # Out at once, or after a corner of the box.
            end *= 4.0 * first / len(own)
            if end < ENGINE.same**2 * self.settle.duration:
                return None
            own = self.motion(place, end)
            first = self.first_out(own)
        # Motions from both sides of it, further than the tolerance of the steps has moved it.
        beside = ENGINE.same * ACCURACY.near**2 * size * along
        one, other = (self.motion(place + side * beside, end) for side in (-1.0, 1.0))
        apart = int(np.argmax(np.max(np.abs(one - other) / size, axis=1) > ACCURACY.near**2))
        through = first > 0 and not 0 < apart < first
        last = first
        if not through:
            if not apart:
                allowed = "long enough for motions beside a border to part"
                raise refusal("settle.duration", self.settle.duration, allowed)
            # Nearest to the saddle, or at rest, where it is slowest.
            last = 1 + int(np.argmin(np.linalg.norm(np.diff(own[:apart] / size, axis=0), axis=1)))
        found = self.motion(place, end * last / (len(own) - 1))
        return _Arc(self.to_edge(found) if through else found, left, right, through)

    def to_edge(self, places: np.ndarray) -> np.ndarray:
        """Places as far as the edge of the box."""
        last = self.first_out(places) or len(places) - 1
        before, after = places[last - 1], places[last]
        over = np.clip(after, *self.limits.T) - after
        away = np.where(over != 0.0, before - after, 1.0)
        return np.concatenate([places[:last], [after + np.max(over / away) * (before - after)]])

    def first_out(self, places: np.ndarray) -> int:
        """Number of the first place out of the box after the one on its edge, or 0."""
        out = np.any((places < self.limits[:, 0]) | (places > self.limits[:, 1]), axis=1)
        return int(np.argmax(out[1:])) + 1 if np.any(out[1:]) else 0

    def motion(self, place: np.ndarray, t1: float) -> np.ndarray:
        """Places of the motion from one, at even times."""
        lanes = self.lanes
        ts = np.linspace(0.0, t1, ACCURACY.corners)
        run = simulate(
            lanes.system, 0.0, t1, lanes.unravel(self.states(place)), None, lanes.args,
            integrator=lanes.integrator, saveat=SaveAt(ts=ts, max_events=None), throw=False,
        )  # fmt: skip
        assert run.outputs is not None
        rows = rows_of(run.outputs.y, ACCURACY.corners)[:, self.places]
        last = rows_of(run.y1, 1)[0, self.places]
        if not bool(run.successful) and np.all(
            (last >= self.limits[:, 0]) & (last <= self.limits[:, 1])
        ):
            allowed = "one in which motions along a border do not fail"
            raise refusal("found.box", self.limits.tolist(), allowed, but=str(run.result))
        return np.where(np.isfinite(rows), rows, last)  # it has gone on to infinity, out of the box


class _Section(_Plane):
    """The same at whole periods of a force: borders are stable manifolds of saddles."""

    def __init__(self, *given: Any):
        super().__init__(*given)
        assert self.settle.forcing_period is not None
        self.forcing = float(self.settle.forcing_period)
        self.manifolds: list[Manifold] = []
        self.ends: list[np.ndarray] = []

    def border(self, place: np.ndarray, along: np.ndarray, left: int, right: int) -> _Arc | None:
        """The border from a place of the edge on, or None where one that is known ends there."""
        size = np.ptp(self.limits, axis=1)
        if any(np.max(np.abs(place - end) / size) < ENGINE.same for end in self.ends):
            return None
        tangents = ((m, m.tangent_at(place)) for m in self.manifolds)
        known = next((pair for pair in tangents if pair[1] is not None), None)
        if known is None:
            manifold = self.manifold_at(place)
            known = manifold, manifold.tangent_at(place)
        manifold, tangent = known
        if tangent is None:
            raise refusal("settle", self.settle, "long enough for motions beside a border to part")
        tangent = tangent * np.sign(tangent @ np.array([-along[1], along[0]]))
        found = self.to_edge(manifold.follow(place, tangent))
        self.ends.append(found[-1])
        return _Arc(found, left, right, True)

    def manifold_at(self, place: np.ndarray) -> Manifold:
        """The stable manifold on which a place is."""
        lanes, settle, saddle = self.lanes, self.settle, None
        orbit = on_border(lanes, settle, self.states(place), self.turn)
        if isinstance(orbit, PeriodicOrbit):
            period = float(orbit.period) / int(orbit.repeats)
            given = float(orbit.t0), period, rows_of(orbit.y0, 1)[0], int(orbit.mode0)
            saddle = saddle_of(lanes, self.forcing, *given, self.turn)
        if saddle is None:
            allowed = "long enough to come to one saddle on the border"
            raise refusal("settle.duration", settle.duration, allowed)
        given = lanes, settle, saddle, self.states, self.between, self.limits
        self.manifolds.append(Manifold(*given))
        return self.manifolds[-1]

    def between(self, one: np.ndarray, other: np.ndarray) -> np.ndarray | None:
        """Where the attractor changes between two places, if it does."""
        lanes, ends = self.lanes.few, self.states(np.stack([one, other]))
        codes = codes_from(lanes, self.settle, self.attractors, ends)
        if np.any(_is_open(codes)) or codes[0] == codes[1]:
            return None
        low, high, _ = self.change_between(one, other, int(codes[0]))
        return one + 0.5 * (low + high) * (other - one)


def _is_open(code: np.ndarray) -> np.ndarray:
    return (code == NOT_SETTLED) | (code == FAILED)


def _swept(places: np.ndarray) -> float:
    """Integral of (x dy - y dx) / 2 along a curve by places on it."""
    x, y = places.T
    dx, dy = np.diff(x), np.diff(y)
    # Along chords, and by how far the curve is beside them, which is what it turns by.
    beside = np.sum(dx[:-1] * dy[1:] - dy[:-1] * dx[1:]) / 12.0
    return float(0.5 * np.sum(x[:-1] * dy - y[:-1] * dx) + beside)


def _close(areas: np.ndarray, arcs: list[_Arc], limits: np.ndarray) -> None:
    """Join the borders that end at one saddle, or at the edge of one set of states at rest."""
    left, size = [arc for arc in arcs if not arc.through], np.ptp(limits, axis=1)
    while left:
        middle = left[0].places[-1]
        away = [np.max(np.abs(arc.places[-1] - middle) / size) for arc in left]
        group = [arc for arc, far in zip(left, away, strict=True) if far < ACCURACY.near**2]
        left = [arc for arc, far in zip(left, away, strict=True) if far >= ACCURACY.near**2]
        if sorted(arc.left for arc in group) != sorted(arc.right for arc in group):
            allowed = f"one whose edge all borders reach, also that which ends at {middle}"
            raise refusal("found.box", limits.tolist(), allowed)
        if max(np.max(np.abs(arc.places[-1] - middle) / size) for arc in group) > ACCURACY.near**4:
            # The triangles between are the square of that.
            raise refusal("found.box", limits.tolist(), f"without a saddle as weak as that at {middle}")
        for arc in group:
            closing = _swept(np.stack([arc.places[-1], middle]))
            areas[arc.left] += closing
            areas[arc.right] -= closing
