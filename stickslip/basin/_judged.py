"""Motions that are followed until it is known which attractor they come to."""

from collections.abc import Callable, Iterator

import numpy as np

from ..progress import Progress
from ._accuracy import ACCURACY
from ._attractor import Attractor, Found, Search, motions_at, rest_at, with_radius
from ._codes import FAILED, LEFT, NOT_SETTLED, codes, known_of
from ._lanes import Lanes, Moved
from ._settle import Settle
from ._successor import successor_of
from ._tube import distances
from ._wandering import wanderings_at


class Judged:
    """Motions from flat states `y`, `[lane, size]`, from time 0 on, and the attractors so far.

    `known`: attractors of other motions, of which those that the system has keep their names.

    `code`: number of the attractor, or one of `OTHERS`; `entry` [s]: when that was known first.
    """

    def __init__(
        self, lanes: Lanes, settle: Settle, y: np.ndarray, turn: np.ndarray,
        known: tuple[Attractor, ...] = (),
    ):  # fmt: skip
        self.lanes, self.settle, self.turn = lanes, settle, turn
        count, size = y.shape
        self.t, self.y = 0.0, y.copy()
        self.mode, self.still = np.full(count, -1), np.zeros(count, bool)
        self.code, self.entry = np.full(count, NOT_SETTLED), np.full(count, np.nan)
        self.failure = np.full(count, "", object)
        self.low, self.high = np.min(y, axis=0), np.max(y, axis=0)
        self.named = [attractor.name for attractor in known]  # that there are and that there were
        self.attractors: list[Attractor] = []
        for before in known:
            scale = np.ones(size) if before.tube is None else before.tube.scale
            found = successor_of(self.search._replace(scale=scale), before)
            if found is not None:
                self.attractors.append(found)

    @property
    def open(self) -> np.ndarray:
        """Numbers of the motions that are not judged yet."""
        return np.flatnonzero(self.code == NOT_SETTLED)

    @property
    def search(self) -> Search:
        """The motions so far, to look for attractors with."""
        extent = np.minimum(self.high - self.low, self.turn)  # an angle may go round for ever
        scale = np.where(extent > 0.0, extent, 1.0)
        period = self.settle.forcing_period
        return Search(self.lanes, scale, self.turn, self.settle.duration, period)

    def follow(self, *, finds: bool = True) -> None:
        """All motions over the duration; `finds`: whether attractors may be new."""
        times = self.settle.times
        with Progress("basins", total=len(self.code), things="starts") as meter:
            for number, t in enumerate(times, 1):
                before = self.open.size
                self.go_on(t)
                # After each doubling of the time, so that it is seldom for what settles slowly.
                if finds and (number & (number - 1) == 0 or number == len(times)):
                    self._look(motions_at)
                if finds and number == len(times):
                    self._look(wanderings_at)
                meter.advance(before - self.open.size)
                if not self.open.size:
                    break

    def go_on(self, t: float) -> None:
        """The open motions until a time [s], and what is known of them then."""
        at = self.open
        moved = self.lanes(self.t, t, self.y[at], self.mode[at])
        self.t = t
        self.y[at], self.mode[at], self.still[at] = moved.y, moved.mode, moved.still
        self._judge(at, moved.successful)
        failed = self.code[at] == FAILED
        self.failure[at[failed]] = moved.result[failed]
        inside = self.y[at[self.code[at] > LEFT]]
        if inside.size:
            self.low = np.minimum(self.low, np.min(inside, axis=0))
            self.high = np.maximum(self.high, np.max(inside, axis=0))

    def _judge(self, at: np.ndarray, successful: np.ndarray) -> None:
        """Some motions by what is known; one at rest that is none of these is an attractor."""
        while at.size:
            known = known_of(self.attractors, self.settle, self.lanes)
            moved = Moved(None, self.y[at], self.mode[at], self.still[at], successful, None)
            self.code[at] = code = codes(self.lanes, known, self.t, moved)
            self.entry[at] = np.where((code == NOT_SETTLED) | (code == FAILED), np.nan, self.t)
            # Without a force of the time they stay there.
            free = self.settle.forcing_period is None
            at = at[(code == NOT_SETTLED) & self.still[at] & free]
            rest = None
            while at.size and rest is None:
                rest = rest_at(self.lanes, self.y[at[0]], int(self.mode[at[0]]))
                at = at if rest else at[1:]
            if rest:
                self.add(rest)
            successful = np.ones(at.shape, bool)

    def _look(self, motions: Callable[..., Iterator[Found]]) -> None:
        """Ask some of the open motions for an attractor that is not known."""
        asked: set[int] = set()
        # Spread over all of them by the golden section.
        for number in range(ACCURACY.few):
            at = self.open
            if not at.size:
                return
            i = int(at[int(0.6180339887498949 * number % 1.0 * at.size)])
            if i in asked:
                continue
            asked.add(i)
            search = self.search
            for found in motions(search, self.t, self.y[i], int(self.mode[i])):
                if found.rate < 0.0 and self.number_of(found.attractor) is None:
                    new = with_radius(search, self.t, found)
                    if new is not None:
                        self.add(new)
                        self._judge(self.open, np.ones(self.open.shape, bool))
                        break

    def number_of(self, found: Attractor) -> int | None:
        """Number of an attractor that is known already."""
        tubes = {k: a.tube for k, a in enumerate(self.attractors) if a.tube is not None}
        if not tubes or found.tube is None:
            return None
        away = np.min(distances(list(tubes.values()), found.tube.start, found.tube.mode), axis=0)
        # A motion that is within the radius of another one anywhere is that one: it comes to it.
        radii = np.array([self.attractors[k].radius for k in tubes])
        nearest = int(np.argmin(away / radii))
        return list(tubes)[nearest] if away[nearest] <= radii[nearest] else None

    def add(self, found: Attractor) -> None:
        """One more, with its number among those of its kind in its name."""
        count = 1 + sum(name.startswith(found.kind) for name in self.named)
        self.named.append(f"{found.kind} {count}")
        self.attractors.append(found._replace(name=self.named[-1]))


def codes_from(lanes: Lanes, settle: Settle, attractors: list[Attractor], y: np.ndarray) -> np.ndarray:
    """Codes of motions from flat states by the attractors that are known."""
    motions = Judged(lanes, settle, y, np.full(lanes.size, np.inf))
    motions.attractors = attractors  # a rest that is new is one of them from now on
    motions.named = [attractor.name for attractor in attractors]
    motions.follow(finds=False)
    return motions.code
