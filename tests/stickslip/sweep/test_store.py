"""A sweep's store after kills, damage, a full disk, and with somebody else's settings."""

import contextlib
import errno
import json
import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from stickslip.sweep import SweepMismatchError, SweepWriteError, open_dataset, run_sweep
from stickslip.sweep import _store as store_module
from stickslip.sweep.evaluate import Evaluate
from tests.house._repository import ROOT
from tests.stickslip.sweep._killable import GRID, logistic, sweep
from tests.stickslip.sweep._options import contents, options


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Store of an uninterrupted run."""
    path = tmp_path_factory.mktemp("whole") / "store"
    sweep(path)
    return path


@contextlib.contextmanager
def counted(monkeypatch):
    """Numbers of the blocks that are computed inside."""
    numbers = []
    evaluate = Evaluate.__call__

    def counting(self, block, read):
        numbers.append(block.number)
        return evaluate(self, block, read)

    with monkeypatch.context() as patch:
        patch.setattr(Evaluate, "__call__", counting)
        yield numbers


def run_and_kill(path, seconds: float) -> int:
    """Start the sweep in a process of its own and kill it `seconds` after its first sign of life."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.stickslip.sweep._killable", str(path), "0.02"], cwd=ROOT
    )
    limit = time.monotonic() + 120
    before = len(list(path.glob("finished/*.json")))
    # Half of the kills hit the run while it makes or checks the store, half while it writes blocks.
    while process.poll() is None and time.monotonic() < limit:
        written = len(list(path.glob("finished/*.json")))
        if (path / "lock").exists() and (seconds < 0.05 or written > before):
            break
        time.sleep(0.002)
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    process.wait()
    return len(list(path.glob("finished/*.json")))


@pytest.mark.more
@pytest.mark.parametrize("kills", [2, pytest.param(10, marks=pytest.mark.slow)])
def test_killed_and_resumed_equals_uninterrupted(kills, tmp_path, whole):
    chance = random.Random(kills)
    path = tmp_path / "store"
    finished = [run_and_kill(path, chance.uniform(0.0, 0.1)) for _ in range(kills)]
    assert finished[0] < 35
    sweep(path)
    assert contents(path) == contents(whole)


def test_every_instruction_of_a_write_may_be_the_last(tmp_path, whole, monkeypatch):
    """Stop at each file operation of a run in turn; what is left is always a store to go on from."""
    path = tmp_path / "store"

    class Stopped(BaseException):
        pass

    for name in ("replace", "fsync"):
        for after in (1, 2, 5):
            calls = 0
            original = getattr(os, name)

            def stop(*args, original=original, after=after):
                nonlocal calls
                calls += 1
                if calls >= after:
                    raise Stopped
                return original(*args)

            with monkeypatch.context() as patch:
                patch.setattr(store_module.os, name, stop)
                with pytest.raises(Stopped):
                    sweep(path, resume=after != 1)
    sweep(path)
    assert {k: v for k, v in contents(path).items() if not k.endswith(".part")} == contents(whole)


@pytest.mark.more
@pytest.mark.parametrize("damage", ["truncated", "altered", "missing", "empty", "record"])
def test_damage_is_found_and_that_block_alone_computed_again(damage, tmp_path, whole, monkeypatch):
    path = tmp_path / "store"
    sweep(path)
    victim = path / "data.zarr" / "x" / "c" / "11" / "0" / "0"
    data = victim.read_bytes()
    if damage == "truncated":
        victim.write_bytes(data[: len(data) // 2])
    elif damage == "altered":
        victim.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    elif damage == "missing":
        victim.unlink()
    elif damage == "empty":
        victim.write_bytes(b"")
    else:
        (path / "finished" / "000011.json").write_text("{")
    with counted(monkeypatch) as numbers:
        sweep(path)
    assert numbers == [11]
    assert contents(path) == contents(whole)


def test_nothing_is_computed_twice(whole, monkeypatch):
    with counted(monkeypatch) as numbers:
        sweep(whole)
    assert numbers == []


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"settings": {"points": 8, "seed": 2}}, "settings.seed is 1 in the store, 2 now"),
        ({"settings": {"points": 8}}, "settings.seed = 1 is in the store only"),
        ({"chunk": 12}, "block"),
        ({"grid": {**GRID, "a": GRID["a"] + 1e-12}}, "grid.a.sha256"),
        ({"function": lambda a, b: logistic(a, b + 1e-9)}, "program"),
    ],
)
def test_another_sweep_is_refused_and_the_store_untouched(change, names, whole):
    before = contents(whole)
    call = {"settings": {"points": 8, "seed": 1}, "chunk": 9, **change}
    what = call.pop("function", logistic), call.pop("grid", GRID)
    with pytest.raises(SweepMismatchError, match="holds another sweep") as error:
        run_sweep(*what, **options(whole, **call))
    assert names in str(error.value)
    assert contents(whole) == before


def test_replacing_must_be_asked_for(tmp_path):
    path = tmp_path / "store"
    run_sweep(lambda a: a, {"a": [1.0]}, **options(path))
    new = run_sweep(lambda a: 2.0 * a, {"a": [1.0]}, **options(path, resume=False))
    assert float(new.value[0]) == 2.0


def test_full_disk_keeps_what_is_finished(tmp_path, whole, monkeypatch):
    path = tmp_path / "store"
    write = store_module.write_whole

    def full(target, text, mark=""):
        if target.name == "000007.json":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(target, text, mark)

    with monkeypatch.context() as patch:
        patch.setattr(store_module, "write_whole", full)
        with pytest.raises(SweepWriteError) as error:
            sweep(path)
    assert error.value.errno == errno.ENOSPC
    assert "could not write block 7" in str(error.value)
    assert "No space left on device" in str(error.value)
    assert "7 finished blocks are kept" in str(error.value)
    with counted(monkeypatch) as numbers:
        sweep(path)
    assert numbers == list(range(7, 35))
    assert contents(path) == contents(whole)


def test_a_place_that_is_no_store_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("three years of work")
    with pytest.raises(ValueError, match=r"store = .* holds something else \(\['thesis.tex'\]\)"):
        sweep(tmp_path, resume=False)
    assert (tmp_path / "thesis.tex").exists()
    with pytest.raises(ValueError, match="is a file: it must be a directory"):
        sweep(tmp_path / "thesis.tex")


def test_two_processes_do_not_share_a_store(tmp_path):
    fcntl = pytest.importorskip("fcntl")
    path = tmp_path / "store"
    sweep(path)
    with open(path / "lock", "a") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(ValueError, match="being worked on by another process"):
            sweep(path)


def test_the_manifest_says_what_the_sweep_is(whole):
    manifest = json.loads((whole / "manifest.json").read_text())
    assert manifest["settings"] == {"points": 8, "seed": 1}
    assert manifest["grid"]["a"]["size"] == 103
    assert manifest["information"]["versions"]["stickslip"]
    runs = [json.loads(line) for line in (whole / "runs.jsonl").read_text().splitlines()]
    assert {run["event"] for run in runs} == {"begin", "end"}


def test_what_is_read_is_what_was_computed(whole):
    stored = open_dataset(whole).load()
    memory = sweep(None)
    assert stored.equals(memory)
    assert stored.x.dims == ("a", "b", "point")
    assert stored.x.attrs == {"units": "1", "long_name": "population"}
    assert stored.end_log.dtype == np.float64
    assert np.isnan(stored.end_log).any()
