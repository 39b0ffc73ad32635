"""A worker: one of any number, on any hosts that see the store, who compute what is left of it."""

import os
import random
import secrets
import threading
import time
from typing import Any

from ._claims import Claim, Claims
from ._manifest import code_revision
from ._records import recorded
from ._store import Store
from ._units import values_of
from .evaluate import Evaluate
from .grid import Block, chains
from .progress import Progress

BEATS = 6  # signs of life before a claim expires
SHORTEST_PAUSE = 0.25  # s between looks at what the others have done; the longest is that of the beats


class Worker:
    """Duty of one worker: claims a unit, computes it, writes it, gives the claim back, and again.

    Each computes with one thread, so that a unit is cut into the same pieces on every host.

    - `seconds`: no unit is begun that would, as those before it, not end by then.
    - `wait`: for the units of others, to compute them if they die; else the end comes before.
    """

    def __init__(
        self, *, expiry: float, seconds: float | None, wait: bool, progress: bool | None, threads: int
    ):
        self.mark = secrets.token_hex(4)
        self.threads: int | None = threads
        self.expiry, self.wait, self.progress = expiry, wait, progress
        self._until = None if seconds is None else time.monotonic() + seconds
        self._spent: list[float] = []
        self._computed = 0

    def goes_on(self, found: dict[str, Any]) -> bool:
        """Whether all of a store is finished, so that what follows from it is known."""
        return not found["left"]

    def do(self, store: Store, evaluate: Evaluate, units: list[Block]) -> dict[str, Any]:
        """Work on the store until nothing is left, or the time is up; what was done so far."""
        spent = len(self._spent)
        with store:
            store.open(resume=True)
            before = recorded(store.path)
            todo = {
                chain[0].number: chain
                for chain in chains(units, evaluate.axis)
                if not all(map(store.is_finished, chain))
            }
            total = sum(unit.lanes for unit in units)
            missing = sum(unit.lanes for chain in todo.values() for unit in chain)
            meter = Progress(total, total - missing, name="work", shown=self.progress)
            about = {"worker": self.mark, "pid": os.getpid()}
            store.log(
                event="begin", **about, blocks_to_do=len(todo), blocks=len(units),
                code_revision=code_revision(), workers=self.threads,
            )  # fmt: skip
            done = _Done()
            claims = Claims(store.path, expiry=self.expiry)
            try:
                with _Heart(claims) as heart:
                    self._through(todo, before, claims, heart, store, evaluate, done, meter)
            finally:
                meter.close()
                store.log(event="end", **about, computed=len(done.numbers), lanes=done.lanes,
                    core_seconds=round(sum(self._spent[spent:]), 3),
                )  # fmt: skip
            self._computed += len(done.numbers)
            return {"computed": self._computed, "left": len(todo)}

    def _through(self, todo, before, claims, heart, store, evaluate, done, meter) -> None:
        start, pause = int(self.mark, 16), SHORTEST_PAUSE
        while todo:
            news = recorded(store.path) - before
            for number in [n for n, chain in todo.items() if all(u.number in news for u in chain)]:
                meter.advance(sum(unit.lanes for unit in todo.pop(number)))
            if not todo:
                return
            # Each begins elsewhere, so that they do not all ask for the same.
            found = claims.candidates(todo, start)
            if not found and not self.wait:
                found = claims.candidates(todo, start, looks=len(todo))
            for number in found:
                if self._is_late():
                    return
                claim = claims.take(number)
                if claim is None:
                    continue
                heart.claim, finished = claim, False
                try:
                    finished = self._compute(todo[number], claim, claims, store, evaluate, done)
                finally:
                    heart.claim = None
                    claims.release(claim, finished=finished)
                pause = SHORTEST_PAUSE
                break
            else:
                if not self.wait or self._is_late():
                    return
                time.sleep(pause * random.uniform(0.5, 1.0))
                pause = min(2 * pause, max(self.expiry / BEATS, SHORTEST_PAUSE))
                meter.show()

    def _compute(self, chain, claim: Claim, claims: Claims, store: Store, evaluate, done) -> bool:
        """Compute what is not finished of a unit of work; whether all of it is now."""
        if claim.after:
            for unit in chain:
                store.remove_half_written(unit, claim.after)
        behind = False
        for unit in chain:
            # Another may have finished it since this worker looked. A carried block is computed from
            # the one before it, so that all after a damaged one count.
            if not behind and store.is_finished(unit):
                continue
            behind = True
            begin = time.monotonic()
            values = values_of(unit, evaluate, store, lambda lanes: None)
            if not claims.holds(claim):
                return False  # this worker was taken for dead, and another has the unit
            store.write(unit, values, claim.token)
            done.numbers.append(unit.number)
            done.lanes += unit.lanes
            self._spent.append(time.monotonic() - begin)
        return True

    def _is_late(self) -> bool:
        if self._until is None:
            return False
        # The first one compiles.
        known = self._spent[1:] or self._spent
        return time.monotonic() + (max(known) if known else 0.0) > self._until


class _Done:
    """What a worker has computed."""

    def __init__(self):
        self.numbers: list[int] = []
        self.lanes = 0


class _Heart:
    """Touches the claim, if there is one, from a thread of its own."""

    def __init__(self, claims: Claims):
        self.claim: Claim | None = None
        self._claims = claims
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> "_Heart":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _beat(self) -> None:
        while not self._end.wait(self._claims.expiry / BEATS):
            claim = self.claim
            if claim is not None:
                try:
                    self._claims.beat(claim)
                except OSError:
                    continue  # the next may succeed; if none does, the claim expires
