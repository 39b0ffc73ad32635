"""Motions that are followed until it is known which attractor they come to."""

import numpy as np

from ..hybrid.components import numbers_of
from ..progress import Progress
from ._accuracy import ACCURACY
from ._attractor import Attractor, Search, motions_at, successor_of, with_radius
from ._lanes import Lanes, flat
from ._rests import same_set
from ._settle import Settle
from ._tube import distances, stack_of

NOT_SETTLED, LEFT, FAILED = -1, -2, -3
OTHERS = {NOT_SETTLED: "not settled", LEFT: "left the limits", FAILED: "failed"}


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
        names = numbers_of(lanes.unravel(np.zeros(size)))
        self.limits = [(names.index(name), *pair) for name, pair in settle.limits.items()]

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
                    self._look()
                meter.advance(before - self.open.size)
                if not self.open.size:
                    break

    def go_on(self, t: float) -> None:
        """The open motions until a time [s], and what is known of them then."""
        at = self.open
        moved = self.lanes(self.t, t, self.y[at], self.mode[at])
        self.t = t
        self.y[at], self.mode[at], self.still[at] = moved.y, moved.mode, moved.still
        failed = ~moved.successful
        self.code[at[failed]], self.failure[at[failed]] = FAILED, moved.result[failed]
        for place, low, high in self.limits:
            outside = ~failed & ~((low <= moved.y[:, place]) & (moved.y[:, place] <= high))
            self.code[at[outside]], self.entry[at[outside]] = LEFT, t
        inside = moved.y[self.code[at] == NOT_SETTLED]
        if inside.size:
            self.low = np.minimum(self.low, np.min(inside, axis=0))
            self.high = np.maximum(self.high, np.max(inside, axis=0))
        self._judge()

    def _judge(self) -> None:
        if self.settle.forcing_period is None:
            self._judge_rests()
        tubes = {k: a.tube for k, a in enumerate(self.attractors) if a.tube is not None}
        at = self.open
        if not at.size or not tubes:
            return
        rows = np.resize(at, -(-at.size // ACCURACY.block) * ACCURACY.block)
        away = distances(stack_of(list(tubes.values())), self.y[rows], self.mode[rows])
        radius = np.array([self.attractors[k].radius for k in tubes])
        part = away[: at.size, : len(tubes)] / radius
        nearest = np.argmin(part, axis=1)
        near = np.min(part, axis=1) <= 1.0
        self.code[at[near]] = np.array(list(tubes))[nearest[near]]
        self.entry[at[near]] = self.t

    def _judge_rests(self) -> None:
        """Motions that have come to rest: without a force of the time they stay there."""
        while (at := self.open[self.still[self.open]]).size:
            mode = int(self.mode[at[0]])
            alike = at[self.mode[at] == mode]
            known = [k for k, a in enumerate(self.attractors) if (a.kind, a.mode) == ("rest", mode)]
            for k in known:
                there = flat(self.attractors[k].motion)
                of_it = alike[same_set(self.lanes, self.t, mode, there, self.y[alike])]
                self.code[of_it], self.entry[of_it] = k, self.t
                alike = alike[self.code[alike] == NOT_SETTLED]
            if alike.size:
                self.add(Attractor("rest", "rest", self.lanes.unravel(self.y[alike[0]]), mode))

    def _look(self) -> None:
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
            for found in motions_at(search, self.t, self.y[i], int(self.mode[i])):
                if found.rate < 0.0 and self.number_of(found.attractor) is None:
                    new = with_radius(search, self.t, found)
                    if new is not None:
                        self.add(new)
                        self._judge()
                        break

    def number_of(self, found: Attractor) -> int | None:
        """Number of an attractor that is known already."""
        tubes = {k: a.tube for k, a in enumerate(self.attractors) if a.tube is not None}
        if not tubes or found.tube is None:
            return None
        row = found.tube.start[:1], found.tube.mode[:1]
        away = distances(stack_of(list(tubes.values())), *row)[0, : len(tubes)]
        return list(tubes)[int(np.argmin(away))] if np.min(away) <= ACCURACY.same else None

    def add(self, found: Attractor) -> None:
        """One more, with its number among those of its kind in its name."""
        count = 1 + sum(name.startswith(found.kind) for name in self.named)
        self.named.append(f"{found.kind} {count}")
        self.attractors.append(found._replace(name=self.named[-1]))
