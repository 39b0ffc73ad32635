"""Parts of a sweep, as an array of jobs computes them: each a fixed share, into one store."""

import os
import random
import signal
import subprocess
import sys
import time

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.sweep import (
    Compute,
    Labels,
    Storage,
    Variable,
    open_dataset,
    run_sweep,
    sweep_status,
)
from stickslip.sweep import _store as store_module
from tests.house._repository import ROOT
from tests.stickslip.sweep import _sweeps
from tests.stickslip.sweep._killable import sweep
from tests.stickslip.sweep._options import contents
from tests.stickslip.sweep.test_dask import assert_same


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The store of one call that is left alone."""
    path = tmp_path_factory.mktemp("whole") / "store"
    _sweeps.small(path)
    return path


def test_parts_make_the_bytes_of_one_call(whole, tmp_path):
    path = tmp_path / "store"
    states = [_sweeps.small(path, part=(i, 3)).attrs["sweep_state"] for i in (2, 0, 1)]
    assert states == ["unfinished: 1 of 5 blocks", "unfinished: 3 of 5 blocks", "finished"]
    assert contents(path) == contents(whole)


@pytest.mark.parametrize(
    ("words", "kind", "absent"),
    [([-1, 0, 1], np.int64, -2), ([0, 1], np.int64, -1), ([0, 1], np.uint8, 2), ([1, 2], np.uint8, 0)],
)
def test_a_code_that_is_not_computed_is_none_of_its_words(words, kind, absent, tmp_path):
    def code(k):
        return {"code": jnp.asarray(words, kind)[jnp.asarray(k, int) % len(words)]}

    attributes = {"flag_values": words, "flag_meanings": " ".join("abc"[: len(words)])}
    done = run_sweep(
        code, {"k": np.arange(8)}, store=Storage(tmp_path / "store", chunk=4), part=(0, 2),
        labels=Labels({"code": Variable(attrs=attributes)}),
        compute=Compute("portable", progress=False),
    )  # fmt: skip
    expected = [words[k % len(words)] for k in range(8)]
    assert sorted(done.code.values.tolist()) == sorted([*expected[:4], *[absent] * 4])
    counts = sweep_status(tmp_path / "store")["codes"]["code"]
    assert sum(counts.values()) == 4


def test_a_later_call_completes_what_is_missing_and_a_share_is_the_same_each_time(whole, tmp_path):
    path = tmp_path / "store"
    _sweeps.small(path, part=(1, 2))
    (path / "finished" / "000003.json").unlink()
    before = (path / "finished" / "000001.json").stat().st_mtime_ns
    _sweeps.small(path, part=(1, 2))
    assert sorted(os.listdir(path / "finished")) == ["000001.json", "000003.json"]
    assert (path / "finished" / "000001.json").stat().st_mtime_ns == before
    assert sweep_status(path)["units_missing"] == 3
    assert _sweeps.small(path).attrs["sweep_state"] == "finished"
    assert contents(path) == contents(whole)


def test_rows_of_a_carried_sweep_are_shared_whole(tmp_path):
    _sweeps.carried(tmp_path / "alone")
    states = [_sweeps.carried(tmp_path / "store", part=(i, 2)).attrs["sweep_state"] for i in (0, 1)]
    assert states == ["unfinished: 5 of 10 blocks", "finished"]
    assert_same(tmp_path / "store", tmp_path / "alone")


def test_a_refinement_takes_no_more_arrays_than_steps(tmp_path):
    alone, path, arrays = _sweeps.refined(tmp_path / "alone"), tmp_path / "store", 0
    found = None
    while found is None or found.attrs["sweep_state"] != "finished":
        arrays += 1
        for i in range(2):
            found = _sweeps.refined(path, part=(i, 2))
    assert found.drop_attrs().equals(alone.drop_attrs())
    assert 1 < arrays <= 1 + len(os.listdir(path / "refined"))
    for step in os.listdir(path / "refined"):
        assert_same(path / "refined" / step, tmp_path / "alone" / "refined" / step)


def test_parts_work_side_by_side_and_alone_is_alone(tmp_path, monkeypatch):
    path, write, met = tmp_path / "store", store_module.Store.write, []

    def beside(self, unit, values, by=None):
        if not met:
            met.append(unit.number)
            _sweeps.small(path, part=(1, 2))
            with pytest.raises(ValueError, match="is being worked on by another process"):
                _sweeps.small(path)
        write(self, unit, values, by)

    monkeypatch.setattr(store_module.Store, "write", beside)
    assert _sweeps.small(path, part=(0, 2)).attrs["sweep_state"] == "finished"
    assert met == [0]


def test_what_a_killed_part_left_half_written_is_removed(whole, tmp_path):
    path = tmp_path / "store"
    _sweeps.small(path, part=(0, 2))
    half = path / "data.zarr" / "x" / "c" / "1" / "0.0a1b2c3d.part"
    half.parent.mkdir()
    half.write_bytes(b"half")
    _sweeps.small(path)
    assert contents(path) == contents(whole)


@pytest.mark.parametrize(
    ("part", "error", "words"),
    [
        (3, TypeError, r"part = 3: it must be a pair \(i, n\) of integers with 0 <= i < n"),
        ((1, 0), ValueError, r"part\[1\] = 0"),
        ((2, 2), ValueError, r"part\[0\] = 2"),
        ((0.5, 2), ValueError, r"part\[0\] = 0.5"),
    ],
)
def test_what_is_no_part_is_refused(part, error, words, tmp_path):
    with pytest.raises(error, match=words):
        _sweeps.small(tmp_path / "store", part=part)
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize("store", [None, Storage("store", resume=False)])
def test_a_part_needs_a_store_that_others_may_complete(store):
    with pytest.raises(ValueError, match="unset without a store that others may complete"):
        run_sweep(lambda k: k, {"k": [1.0]}, store=store, part=(0, 2))


@pytest.mark.slow
def test_an_array_of_jobs_of_which_some_are_killed(tmp_path):
    """Three processes at once, each killed and started again at random moments."""
    path, chance = tmp_path / "store", random.Random(7)

    def start(i):
        command = [sys.executable, "-m", "tests.stickslip.sweep._killable", str(path), "0.05"]
        return subprocess.Popen([*command, str(i), "3"], cwd=ROOT)

    running, limit = [start(i) for i in range(3)], time.monotonic() + 300
    for i in (0, 1, 2, 1):
        while not (path / "lock").exists() and time.monotonic() < limit:
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 1.0))
        running[i].send_signal(signal.SIGKILL)
        running[i].wait()
        running[i] = start(i)
    assert [process.wait(300) for process in running] == [0, 0, 0]
    assert open_dataset(path).attrs["sweep_state"] == "finished"
    sweep(path)
    sweep(tmp_path / "alone")
    assert_same(path, tmp_path / "alone")
    assert not list(path.rglob("*.part"))
