"""Many workers on one store: the results of one, whatever happens to them."""

import contextlib
import errno
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from stickslip.__main__ import main
from stickslip.sweep import (
    SweepMismatchError,
    SweepWriteError,
    open_dataset,
    plan_sweep,
    sweep_status,
    work_on,
)
from stickslip.sweep import _store as store_module
from stickslip.sweep._claims import Claims
from tests.house._repository import ROOT
from tests.stickslip.sweep import _planned

UNSHARED = {"runs.jsonl", "lock", "clock"}


def contents(path: pathlib.Path) -> dict[str, bytes]:
    """Every file of a store but its diary, its lock and the clock of its claims."""
    return {
        str(p.relative_to(path)): p.read_bytes()
        for p in sorted(path.rglob("*"))
        if p.is_file() and p.name not in UNSHARED
    }


def computed(path: pathlib.Path) -> int:
    """Units computed by workers who came to their end, by the diary."""
    runs = [json.loads(line) for line in (path / "runs.jsonl").read_text().splitlines()]
    return sum(run.get("computed", 0) for run in runs)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The store of one worker who is left alone."""
    path = tmp_path_factory.mktemp("whole") / "store"
    assert plan_sweep(_planned.small, path) == {"lanes": 10, "units": 5}
    assert work_on(path) == {"computed": 5, "left": 0}
    return path


def test_a_worker_computes_what_one_call_does(whole, tmp_path):
    alone = _planned.small(tmp_path / "alone").load()
    stored = open_dataset(whole).load()
    assert stored.attrs["sweep_state"] == "finished"
    assert stored.drop_attrs().equals(alone.drop_attrs())
    np.testing.assert_array_equal(stored.x, np.add.outer(*_planned.SMALL.values()))
    data, other = contents(whole / "data.zarr"), contents(tmp_path / "alone" / "data.zarr")
    assert data == other


def test_work_goes_on_where_another_left_it_and_computes_nothing_twice(whole, tmp_path):
    path = tmp_path / "store"
    shutil.copytree(whole, path)
    for number in (1, 3):
        (path / "finished" / f"{number:06d}.json").unlink()
    assert work_on(path) == {"computed": 2, "left": 0}
    assert work_on(path) == {"computed": 0, "left": 0}
    assert contents(path) == contents(whole)


def test_one_call_goes_on_where_workers_left_it_and_they_where_it_did(whole, tmp_path):
    path = tmp_path / "store"
    shutil.copytree(whole, path)
    (path / "finished" / "000002.json").unlink()
    _planned.small(path)
    assert contents(path) == contents(whole)


def test_what_another_finished_meanwhile_is_not_computed_again(tmp_path, monkeypatch):
    """Between a worker's look at the store and its first claim, another does everything."""
    path, take, met = tmp_path / "store", Claims.take, []
    plan_sweep(_planned.small, path)

    def late(self, unit):
        if not met:
            met.append(unit)
            assert work_on(path) == {"computed": 5, "left": 0}
        return take(self, unit)

    monkeypatch.setattr(Claims, "take", late)
    assert work_on(path) == {"computed": 0, "left": 0}
    assert met
    assert computed(path) == 5


def test_what_another_claims_is_left_to_him_and_taken_over_when_he_is_dead(whole, tmp_path):
    path = tmp_path / "store"
    shutil.copytree(whole, path)
    (path / "finished" / "000003.json").unlink()
    other = Claims(path, expiry=300.0, owner={"host": "elsewhere", "pid": 1, "boot": "other"})
    claim = other.take(3)
    assert claim is not None
    half = path / "data.zarr" / "x" / "c" / "3" / f"0.{claim.token}.part"
    half.write_bytes(b"half")
    assert work_on(path, wait=False) == {"computed": 0, "left": 1}
    with pytest.raises(ValueError, match=r"worked on by 1 workers \(process 1 on elsewhere\)"):
        _planned.small(path)
    # Its time is that of the file system: an hour without a sign of life.
    long_ago = time.time() - 3600
    os.utime(path / "claims" / claim.name, (long_ago, long_ago))
    assert work_on(path, wait=False) == {"computed": 1, "left": 0}
    assert not other.holds(claim)
    assert not half.exists()
    assert contents(path) == contents(whole)


def test_a_process_of_this_host_that_is_gone_holds_nothing(whole, tmp_path):
    path = tmp_path / "store"
    shutil.copytree(whole, path)
    (path / "finished" / "000003.json").unlink()
    done = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True)
    owner = {**Claims(path).owner, "pid": int(done.stdout)}
    assert Claims(path, owner=owner).take(3) is not None
    assert work_on(path, wait=False) == {"computed": 1, "left": 0}
    assert contents(path) == contents(whole)


def test_a_carried_sweep_is_computed_in_its_order(tmp_path):
    _planned.carried(tmp_path / "alone")
    plan_sweep(_planned.carried, tmp_path / "store")
    assert work_on(tmp_path / "store") == {"computed": 10, "left": 0}
    assert contents(tmp_path / "store" / "data.zarr") == contents(tmp_path / "alone" / "data.zarr")


def test_shards_hold_the_same_numbers_in_fewer_files(whole, tmp_path):
    path = tmp_path / "store"
    plan_sweep(_planned.small, path, shard=4)
    assert work_on(path) == {"computed": 3, "left": 0}
    assert open_dataset(path).drop_attrs().equals(open_dataset(whole).drop_attrs())
    assert sum(p.is_file() for p in (path / "data.zarr" / "x" / "c").rglob("*")) == 3
    with pytest.raises(SweepMismatchError, match="shard is"):
        _planned.small(path, shard=6)


def test_a_full_disk_stops_with_a_clear_error_and_keeps_what_is_finished(whole, tmp_path, monkeypatch):
    path = tmp_path / "store"
    plan_sweep(_planned.small, path)
    write, left = store_module.write_whole, [9]

    def full(target, content, mark=""):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(target))
        write(target, content, mark)

    with monkeypatch.context() as patch:
        patch.setattr(store_module, "write_whole", full)
        with pytest.raises(SweepWriteError, match=r"No space left.*2 finished blocks are kept"):
            work_on(path)
    assert not any(standing.alive for standing in Claims(path).standing().values())
    assert sweep_status(path)["claims"] == []
    assert work_on(path) == {"computed": 3, "left": 0}
    assert contents(path) == contents(whole)


def test_a_store_whose_function_changed_is_refused_by_name(tmp_path, monkeypatch):
    path = tmp_path / "store"
    plan_sweep(_planned.halves, path)
    monkeypatch.setenv("STICKSLIP_TEST_OFFSET", "0.25")
    with pytest.raises(SweepMismatchError, match=r"settings.offset is 0.0 in the store, 0.25 now.*pro"):
        work_on(path)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda store: None, "not a lambda; write it into a module"),
        (_planned.none, "one that sweeps into its `store`"),
    ],
)
def test_a_function_that_no_other_process_finds_is_refused(function, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        plan_sweep(function, tmp_path / "store")
    assert not (tmp_path / "store").exists()


def test_a_function_of_the_script_or_inside_another_is_refused(tmp_path, monkeypatch):
    def inner(store):
        """Nobody else finds it."""

    with pytest.raises(ValueError, match="not one that a function defines"):
        plan_sweep(inner, tmp_path / "store")
    monkeypatch.setattr(_planned.none, "__module__", "__main__")
    with pytest.raises(ValueError, match="not of the script that is run"):
        plan_sweep(_planned.none, tmp_path / "store")
    monkeypatch.setattr(_planned.none, "__module__", _planned.__name__)
    with pytest.raises(TypeError, match=r"parameters\['offset'\] = .*it must be a number, a text"):
        plan_sweep(_planned.small, tmp_path / "store", offset=np.float32(1.0))


def test_a_store_that_does_not_say_its_function_says_what_to_do(tmp_path):
    path = tmp_path / "store"
    _planned.small(path)
    with pytest.raises(ValueError, match=r"does not say which function makes it: .*stickslip plan"):
        work_on(path)
    plan_sweep(_planned.small, path)
    assert work_on(path) == {"computed": 0, "left": 0}
    with pytest.raises(ValueError, match="the directory of a sweep's store"):
        work_on(tmp_path / "nowhere")


def test_nothing_is_begun_that_would_not_end_in_time(tmp_path):
    plan_sweep(_planned.small, tmp_path / "store")
    assert work_on(tmp_path / "store", seconds=1e-6) == {"computed": 0, "left": 5}


def test_the_commands(whole, tmp_path, capsys):
    path, name = str(tmp_path / "store"), "tests.stickslip.sweep._planned"
    assert main(["plan", f"{name}:small", path, "--set", "chunk=4"]) == 0
    assert capsys.readouterr().out == f"{path}: 10 lanes in 3 units\n"
    assert main(["work", path, "--until", "2h", "--quiet"]) == 0
    assert capsys.readouterr().out == f"{path}: 3 units computed, 0 left\n"
    assert main(["work", path, "--until", "soon"]) == 2
    assert "until = 'soon': it must be a span, as 90m or 1h30m, or" in capsys.readouterr().err
    assert main(["plan", f"{name}:nothing", path]) == 2
    assert "it must be a module and a function in it" in capsys.readouterr().err


def start(path, *more):
    """A worker in a process of its own."""
    command = [sys.executable, "-m", "stickslip", "work", str(path), "--quiet", *more]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)


def at_work(path) -> set[int]:
    """The processes that have claimed a unit."""
    found = set()
    for claim in path.glob("claims/*.?"):
        with contextlib.suppress(OSError, ValueError):
            found.add(json.loads(claim.read_text())["pid"])
    return found


@pytest.mark.slow
def test_four_workers_ten_kills_and_signals_equal_one(tmp_path):
    """10 times `kill -9`, and SIGINT and SIGTERM, at random moments."""
    plan_sweep(_planned.logistic_map, tmp_path / "one")
    plan_sweep(_planned.logistic_map, tmp_path / "four", pause=1.5)
    work_on(tmp_path / "one")
    path, chance = tmp_path / "four", random.Random(18)
    signals = [signal.SIGKILL] * 10 + [signal.SIGINT, signal.SIGTERM] * 2
    chance.shuffle(signals)
    running, hit = [start(path) for _ in range(4)], 0
    limit = time.monotonic() + 500
    for kind in signals:
        # Two of three are hit while they have a unit, the others whatever they are doing.
        while not (busy := {p.pid for p in running} & at_work(path)) and time.monotonic() < limit:
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 1.0))
        some = [p for p in running if p.pid in busy] if chance.random() < 0.67 else running
        victim = chance.choice(some)
        hit += victim.pid in at_work(path) and victim.poll() is None
        victim.send_signal(kind)
        # By the signal itself where it came before the command had begun; by none where it had ended.
        code = victim.wait(60)
        if code not in (-kind, 128 + kind):
            told = sweep_status(path)
            assert (code, told["units_finished"]) == (0, told["units"])
        running[running.index(victim)] = start(path)
    for process in running:
        assert process.wait(300) == 0
    assert hit >= 7
    assert open_dataset(path).attrs["sweep_state"] == "finished"
    assert not list(path.rglob("*.part"))
    assert contents(path / "data.zarr") == contents(tmp_path / "one" / "data.zarr")
    assert contents(path / "finished") == contents(tmp_path / "one" / "finished")


@pytest.mark.slow
def test_without_a_kill_nothing_is_computed_twice(tmp_path):
    plan_sweep(_planned.logistic_map, tmp_path / "store", pause=0.05)
    running = [start(tmp_path / "store") for _ in range(4)]
    for process in running:
        assert process.wait(300) == 0
    assert computed(tmp_path / "store") == 35
    assert open_dataset(tmp_path / "store").attrs["sweep_state"] == "finished"


@pytest.mark.slow
def test_a_pool_of_processes(tmp_path, whole):
    path = tmp_path / "store"
    plan_sweep(_planned.small, path)
    assert work_on(path, processes=2, progress=False) == {"computed": 5, "left": 0}
    assert computed(path) == 5
    assert contents(path) == contents(whole)
