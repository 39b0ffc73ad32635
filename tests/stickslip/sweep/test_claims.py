"""Claims: of any number who ask for a unit, in any order of their steps, one has it."""

import json
import os
import random
import threading
import time

import pytest

from stickslip.sweep._claims import Claims, Folder
from tests.stickslip.sweep._simulated import Memory, simulate


class Turns:
    """A ground on which several threads do one step at a time, in an order drawn by lot."""

    def __init__(self, ground, seed):
        self.ground, self.chance = ground, random.Random(seed)
        self.waiting: dict[threading.Thread, threading.Event] = {}
        self.arrived = threading.Condition()

    def _in_turn(self, name, *args):
        self.wait()
        return getattr(self.ground, name)(*args)

    # One by one: a protocol is recognised by attributes of the class.
    def now(self):
        return self._in_turn("now")

    def names(self):
        return self._in_turn("names")

    def create(self, name, text):
        return self._in_turn("create", name, text)

    def look(self, name):
        return self._in_turn("look", name)

    def touch(self, name):
        return self._in_turn("touch", name)

    def expire(self, name):
        return self._in_turn("expire", name)

    def remove(self, name):
        return self._in_turn("remove", name)

    def wait(self):
        event = threading.Event()
        with self.arrived:
            self.waiting[threading.current_thread()] = event
            self.arrived.notify()
        event.wait()

    def run(self, *functions):
        names = map(str, range(len(functions)))
        threads = [threading.Thread(target=f, name=n) for f, n in zip(functions, names, strict=True)]
        for thread in threads:
            thread.start()
        alive = threads
        while alive:
            with self.arrived:
                self.arrived.wait_for(
                    lambda alive=alive: all(t in self.waiting or not t.is_alive() for t in alive), 0.001
                )
                if not all(t in self.waiting or not t.is_alive() for t in alive):
                    continue
                if self.waiting:
                    ready = sorted(self.waiting, key=lambda thread: thread.name)
                    self.waiting.pop(self.chance.choice(ready)).set()
            alive = [t for t in threads if t.is_alive()]


@pytest.mark.parametrize("begin", ["free", "dead", "dead twice", "asleep"])
def test_one_alone_has_a_unit(begin):
    """Three ask for it, in 40 orders; the dead one may awake; whoever has it gives it back."""
    had = 0
    for seed in range(40):
        ground = Memory()
        sleeper = Claims(ground, expiry=10.0, owner={"pid": 1}, gone=lambda owner: False)
        first = None if begin == "free" else sleeper.take(7)
        if begin == "dead twice":
            ground.time = 100.0
            assert sleeper.take(7) is not None
        ground.time += 100.0
        turns = Turns(ground, seed)
        holders, most, released = [], [], threading.Lock()

        def ask(pid, turns=turns, holders=holders, most=most, released=released):
            claims = Claims(turns, expiry=10.0, owner={"pid": pid}, gone=lambda owner: False)
            for _ in range(2):
                claim = claims.take(7)
                if claim is None:
                    continue
                with released:
                    holders.append(pid)
                    most.append(len(holders))
                assert claims.holds(claim)
                with released:
                    holders.remove(pid)
                claims.release(claim, finished=False)

        def awake(turns=turns, first=first):
            claims = Claims(turns, expiry=10.0, owner={"pid": 1}, gone=lambda owner: False)
            assert first is not None
            claims.holds(first)
            claims.release(first, finished=False)

        turns.run(*[lambda pid=pid: ask(pid) for pid in (2, 3, 4)], *[awake] * (begin == "asleep"))
        assert max(most, default=0) <= 1, seed
        had += len(most)
    assert had > 40


@pytest.mark.parametrize("begin", ["free", "dead"])
def test_what_is_finished_is_computed_once(begin):
    """Three who ask until it is finished, in 40 orders; its record is there before claims are gone."""
    for seed in range(40):
        ground = Memory()
        if begin == "dead":
            Claims(ground, expiry=10.0, owner={"pid": 1}, gone=lambda owner: False).take(7)
        ground.time = 100.0
        turns, records, computed = Turns(ground, seed), set(), []

        def work(pid, turns=turns, records=records, computed=computed):
            claims = Claims(turns, expiry=10.0, owner={"pid": pid}, gone=lambda owner: False)
            for _ in range(4):
                claim = claims.take(7)
                if claim is None:
                    continue
                turns.wait()
                if 7 not in records:
                    turns.wait()
                    computed.append(pid)
                    turns.wait()
                    records.add(7)
                claims.release(claim, finished=True)

        turns.run(*[lambda pid=pid: work(pid) for pid in (2, 3, 4)])
        assert len(computed) == 1, seed
        assert not ground.files


def test_a_claim_lives_as_long_as_it_is_touched(tmp_path):
    """By the time of the file system: an hour is an hour, whatever the clock of a host says."""
    mine = Claims(tmp_path, expiry=50.0, owner={"host": "a", "pid": 1})
    other = Claims(tmp_path, expiry=50.0, owner={"host": "b", "pid": 2})
    claim = mine.take(3)
    assert claim is not None
    assert other.take(3) is None
    assert json.loads((tmp_path / "claims" / "000003.0").read_text())["host"] == "a"
    late = time.time() - 60.0
    os.utime(tmp_path / "claims" / "000003.0", (late, late))
    assert other.candidates([3, 4], 0) == [3, 4]
    assert mine.beat(claim)
    assert other.candidates([3, 4], 0) == [4]
    os.utime(tmp_path / "claims" / "000003.0", (late, late))
    taken = other.take(3)
    assert taken is not None
    assert taken.after == claim.token
    assert not mine.holds(claim)
    mine.release(claim, finished=False)
    assert other.holds(taken)
    other.release(taken, finished=False)
    again = mine.take(3)
    assert again is not None
    mine.release(again, finished=True)
    assert sorted(p.name for p in (tmp_path / "claims").iterdir()) == ["clock"]


def test_a_name_given_anew_is_not_taken_for_the_old_claim(tmp_path):
    mine, other = Claims(tmp_path), Claims(tmp_path)
    claim = mine.take(0)
    assert claim is not None
    (tmp_path / "claims" / claim.name).unlink()
    again = other.take(0)
    assert again is not None
    assert again.name == claim.name
    assert not mine.holds(claim)
    assert not mine.beat(claim)
    mine.release(claim, finished=True)
    assert other.holds(again)


def test_claims_that_say_nothing_hold_until_they_expire(tmp_path):
    folder = Folder(tmp_path / "claims")
    assert folder.create("000001.0", "")
    assert folder.create("000002.0", '{"expiry": "never", "pid": "x", "token": [1]}')
    assert folder.create("notes.txt", "mine")
    claims = Claims(tmp_path, expiry=5.0)
    assert claims.take(1) is None
    assert {unit: s.expiry for unit, s in claims.standing().items()} == {1: 5.0, 2: 5.0}
    for name in ("000001.0", "000002.0"):
        os.utime(tmp_path / "claims" / name, (0, 0))
    claims.remove_dead()
    assert sorted(p.name for p in (tmp_path / "claims").iterdir()) == ["clock", "notes.txt"]


def test_workers_who_die_are_replaced_on_paper():
    found = simulate(workers=20, units=160, failures=0.1)
    assert found["deaths"] > 8
    assert found["units missing"] == found["units computed twice"] == found["claims left"] == 0


@pytest.mark.slow
def test_a_thousand_workers_on_paper():
    """10,000 units of 300 s; 1% of them see their worker die."""
    found = simulate()
    print(json.dumps(found))
    assert found["deaths"] > 70
    assert found["units missing"] == found["units computed twice"] == found["claims left"] == 0
    assert found["hours"] < 1.35 * found["ideal hours"]
    assert found["operations per s, mean"] < 500
