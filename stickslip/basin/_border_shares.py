"""Shares of a rectangle without sampling: the borders of a flow in a plane, arc by arc."""

from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import PyTree

from .._types import Given
from .._validation import check_type, refusal
from ..continuation import PeriodicOrbit
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, simulate
from ..hybrid.components import numbers_of
from ._accuracy import ACCURACY
from ._basins import Basins, check_start, turns
from ._border import border_between, border_motion
from ._codes import OTHERS
from ._judged import Judged, codes_from
from ._lanes import Lanes, rows_of
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
    saddle, whose stable manifold it is. By Green's theorem the area of a basin is

    $$A = \tfrac12 \oint x\,dy - y\,dx$$

    along its parts of the edge and its borders. A basin that does not reach the edge lies inside of an
    unstable orbit, which is solved (`border_motion`).

    **Arguments** `system`, `args`, `integrator`, `settle`: those of the map `found`.

    **Returns** the share of each attractor of the map by name, to some 1e-7. A part of a basin that is
    narrower at the edge than a 256th of a side may be missed.

    **Errors** `ValueError`/`TypeError` naming the argument; `ValueError` for other than two numbers or
    a system that depends on the time, where a part of the edge comes to no attractor, where a border
    begins inside of the box, and where the map itself says otherwise.
    """
    check_type("found", found, Basins, "a Basins")
    check_type("settle", settle, Settle, "a Settle(duration)")
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator or None")
    axes = found.code.ndim
    first = jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[axes:])[0], found.starts)
    y0, box = check_start(system, first, found.box, settle, args)
    names = numbers_of(y0)
    if len(names) != 2 or len(box) != 2 or settle.forcing_period is not None:
        raise refusal("found", found, "of a box of both numbers of a state, and of no forcing")
    places = [names.index(name) for name in box]
    lanes = Lanes(system, args, integrator, y0)
    start = rows_of(found.starts, found.code.size)[:1]
    attractors = Judged(lanes, settle, start, turns(system, y0), found.attractors).attractors
    if [a.name for a in attractors] != [a.name for a in found.attractors]:
        raise refusal("found", found, "of the same system")
    limits = np.array(list(box.values()))
    plane = _Plane(lanes, settle, attractors, limits, places)
    areas, arcs = plane.edge()
    for arc in arcs:
        areas[arc.left] += _swept(arc.places)
        areas[arc.right] -= _swept(arc.places)
    _close(areas, arcs, limits)
    rows, code = rows_of(found.starts, found.code.size), np.ravel(found.code)
    known = code >= 0
    for k in np.flatnonzero((areas == 0.0) & np.isin(np.arange(len(areas)), code)):
        # Inside of an orbit, about which there is the basin that is nearest.
        away = np.linalg.norm(rows[known] - rows[code == k][0], axis=1)
        around = next(j for j in code[known][np.argsort(away)] if j != k)
        between = attractors[k].name, attractors[around].name
        orbit = border_motion(system, found, between, settle, integrator=integrator, args=args)
        if not isinstance(orbit, PeriodicOrbit):
            raise refusal("found.box", box, "one whose edge all basins reach, or that an orbit borders")
        start = rows_of(orbit.y0, 1)[0, places]
        inside = abs(_swept(plane.motion(start, float(orbit.period) / int(orbit.repeats))))
        areas[k], areas[around] = areas[k] + inside, areas[around] - inside
    shares = areas / np.prod(np.ptp(limits, axis=1))
    for k, share in enumerate(shares[: len(attractors)]):
        seen = float(np.mean(code == k))
        # Two standard errors of a half, of points that are spread more evenly than random ones.
        if abs(seen - share) > code.size**-0.5 + np.mean(~known):
            name = f"found.shares[{attractors[k].name!r}]"
            raise refusal(name, seen, f"near {share:.4g}, as the edge of the box says")
    return {attractor.name: float(share) for attractor, share in zip(attractors, shares, strict=False)}


class _Plane:
    """The box and the motions in it."""

    def __init__(self, lanes: Lanes, settle: Settle, attractors: list, limits: Any, places: list[int]):
        self.lanes, self.settle, self.attractors = lanes, settle, attractors
        self.limits, self.places = limits, places

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
        open_ = code < 0
        if np.any(open_ & (np.roll(open_, 1) | np.roll(open_, -1))):
            word = OTHERS[int(np.min(code))]
            raise refusal("settle", self.settle, "one with which the edge of the box settles", but=word)
        ring, code = ring[~open_], code[~open_]
        # There may be more attractors on the way: states at rest to which nothing in the map came.
        areas, arcs, outs = np.zeros(ACCURACY.block), [], 0
        for i in range(len(ring)):
            here, after, own = ring[i], ring[(i + 1) % len(ring)], int(code[i])
            while own != code[(i + 1) % len(ring)]:
                ends = self.states(here), self.states(after)
                given = self.lanes, self.settle, self.attractors, ends, own
                low, high, beyond = border_between(
                    *given, lambda now, own=own: (now >= 0) & (now != own)
                )
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

    def border(self, place: np.ndarray, along: np.ndarray, left: int, right: int) -> _Arc | None:
        """The border from a place of the edge on, or None where it comes out of the box there."""
        end, size = self.settle.duration, np.ptp(self.limits, axis=1)
        own = self.motion(place, end)
        first = self.first_out(own)
        while 0 < first < ACCURACY.many:
            # Out at once, or after a corner of the box.
            end *= 4.0 * first / len(own)
            if end < ACCURACY.same**2 * self.settle.duration:
                return None
            own = self.motion(place, end)
            first = self.first_out(own)
        # Motions from both sides of it, further than the tolerance of the steps has moved it.
        beside = ACCURACY.same * ACCURACY.near**2 * size * along
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
        if through:
            last = self.first_out(found) or len(found) - 1
            before, after = found[last - 1], found[last]
            over = np.clip(after, *self.limits.T) - after
            away = np.where(over != 0.0, before - after, 1.0)
            found = np.concatenate([found[:last], [after + np.max(over / away) * (before - after)]])
        return _Arc(found, left, right, through)

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
            integrator=lanes.integrator, saveat=SaveAt(ts=ts, max_events=None),
        )  # fmt: skip
        assert run.outputs is not None
        return rows_of(run.outputs.y, ACCURACY.corners)[:, self.places]


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
