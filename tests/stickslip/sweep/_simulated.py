"""Claims without files: a ground with a clock of its own, and a thousand workers on it."""

import heapq
import math
import random
import statistics
from collections import Counter

from stickslip.sweep._claims import Claims
from stickslip.sweep._work import BEATS, SHORTEST_PAUSE


class Memory:
    """Claims in memory, at a time that is set; counts what is asked of it."""

    def __init__(self):
        self.time = 0.0
        self.files: dict[str, tuple[float, str]] = {}
        self.asked: Counter[str] = Counter()
        self.seconds: Counter[int] = Counter()

    def _count(self, what):
        self.asked[what] += 1
        self.seconds[int(self.time)] += 1

    def now(self):
        self._count("now")
        return self.time

    def names(self):
        self._count("list")
        return list(self.files)

    def create(self, name, text):
        self._count("create")
        if name in self.files:
            return False
        self.files[name] = (self.time, text)
        return True

    def look(self, name):
        self._count("look")
        return self.files.get(name)

    def touch(self, name):
        self._count("touch")
        if name not in self.files:
            return False
        self.files[name] = (self.time, self.files[name][1])
        return True

    def expire(self, name):
        self._count("expire")
        if name in self.files:
            self.files[name] = (-1e9, self.files[name][1])

    def remove(self, name):
        self._count("remove")
        self.files.pop(name, None)


def simulate(workers=1000, units=10_000, seconds=300.0, failures=0.01, expiry=120.0, seed=18):
    """A sweep by workers who each die with the chance `failures` in a unit, and come back a minute on.

    A unit takes `seconds`, give or take a fifth. The steps are those of `Worker`; one sees what is
    finished and claimed, and acts on it up to 0.2 s later, when it may be otherwise.
    """
    chance, ground = random.Random(seed), Memory()
    todo = set(range(units))
    pause = dict.fromkeys(range(workers), SHORTEST_PAUSE)
    computed: Counter[int] = Counter()
    died: dict[int, float] = {}
    waited, refused, deaths, busy = [], 0, 0, 0.0
    # (time, order, what happens, worker, more); each worker begins within a minute.
    events = [(chance.uniform(0.0, 60.0), i, "look", i, None) for i in range(workers)]
    heapq.heapify(events)
    order = workers
    claims = {i: Claims(ground, expiry=expiry, owner={"host": "h", "pid": i}, gone=lambda o: False)
              for i in range(workers)}  # fmt: skip
    start = {i: chance.randrange(2**32) for i in range(workers)}
    end = 0.0

    def later(delay, what, worker, more=None):
        nonlocal order
        order += 1
        heapq.heappush(events, (ground.time + delay, order, what, worker, more))

    while events:
        ground.time, _, what, worker, more = heapq.heappop(events)
        mine = claims[worker]
        if what == "look":
            ground.names()  # of the records
            if not todo:
                continue
            found = mine.candidates(todo, start[worker])
            if found:
                pause[worker] = SHORTEST_PAUSE
                later(chance.uniform(0.0, 0.2), "take", worker, found[0])
            else:
                later(pause[worker] * chance.uniform(0.5, 1.0), "look", worker)
                pause[worker] = min(2 * pause[worker], expiry / BEATS)
        elif what == "take":
            claim = mine.take(more)
            if claim is None:
                refused += 1
                later(0.0, "look", worker)
            elif more not in todo:
                mine.release(claim, finished=True)
                later(0.0, "look", worker)
            else:
                if more in died:
                    waited.append(ground.time - died.pop(more))
                length = seconds * chance.uniform(0.8, 1.2)
                fate = chance.uniform(0.0, length) if chance.random() < failures else math.inf
                later(min(length, fate), "dies" if fate < length else "done", worker, claim)
                later(expiry / BEATS, "beat", worker, (claim, ground.time + min(length, fate)))
        elif what == "beat":
            claim, until = more
            if ground.time < until:
                mine.beat(claim)
                later(expiry / BEATS, "beat", worker, more)
        elif what == "dies":
            deaths += 1
            died[more.unit] = ground.time
            later(60.0, "look", worker)
        elif mine.holds(more):
            computed[more.unit] += 1
            todo.discard(more.unit)
            busy, end = busy + seconds, ground.time
            mine.release(more, finished=True)
            later(0.0, "look", worker)
        else:
            later(0.0, "look", worker)
    return {
        "hours": end / 3600,
        "ideal hours": units * seconds / workers / 3600,
        "deaths": deaths,
        "units computed twice": sum(n - 1 for n in computed.values()),
        "units missing": len(todo),
        "claims refused": refused,
        "median wait for a dead claim, s": statistics.median(waited) if waited else 0.0,
        "longest wait for a dead claim, s": max(waited, default=0.0),
        "operations per s, mean": ground.asked.total() / end,
        "operations per s, most": max(ground.seconds.values()),
        "operations": dict(ground.asked),
        "claims left": len(ground.files),
    }


if __name__ == "__main__":
    for name, value in simulate().items():
        print(f"{name}: {value}")
