"""Sweeps by the workers of a Dask client: the bytes of one process, whatever happens to the workers."""

import errno
import json
import os
import random
import signal
import threading
import time

import numpy as np
import pytest

from stickslip.sweep import (
    Compute,
    SweepMismatchError,
    SweepWriteError,
    open_dataset,
    run_sweep,
    verify_store,
)
from stickslip.sweep import _store as store_module
from tests.stickslip.sweep import _sweeps
from tests.stickslip.sweep._killable import sweep
from tests.stickslip.sweep._options import contents, options


def assert_same(path, other):
    """The same results and records: manifests may say another revision of the code."""
    for part in ("data.zarr", "finished"):
        assert contents(path / part) == contents(other / part)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The store of one process that is left alone."""
    path = tmp_path_factory.mktemp("whole") / "store"
    sweep(path)
    return path


@pytest.mark.more
@pytest.mark.parametrize(
    ("function", "more"),
    [(_sweeps.small, {}), (_sweeps.small, {"chunk": 3, "shard": 6}), (_sweeps.carried, {}),
     (_sweeps.refined, {})],
    ids=["blocks", "shards", "carried", "refined"],
)  # fmt: skip
def test_workers_compute_what_one_process_does(function, more, client, tmp_path):
    alone = function(tmp_path / "alone", **more).load()
    found = function(tmp_path / "store", client=client, **more).load()
    assert found.attrs["sweep_state"] == "finished"
    assert found.drop_attrs().equals(alone.drop_attrs())
    assert_same(tmp_path / "store", tmp_path / "alone")
    if "refined" in os.listdir(tmp_path / "alone"):
        for step in os.listdir(tmp_path / "alone" / "refined"):
            assert_same(tmp_path / "store" / "refined" / step, tmp_path / "alone" / "refined" / step)


@pytest.mark.more
def test_the_program_of_a_motion_is_that_of_the_process_that_asks(client, tmp_path):
    """Workers compile with optimisation, unlike the quick suite: the last digits may differ."""
    alone = _sweeps.simulated(None)
    found = _sweeps.simulated(tmp_path / "store", client=client)
    assert found.attrs["sweep_state"] == "finished"
    np.testing.assert_allclose(found.x, alone.x, rtol=1e-9)


def workers_of(client):
    """Process numbers of the workers."""
    return list(client.run(os.getpid).values())


@pytest.mark.more
@pytest.mark.parametrize("kills", [1, pytest.param(6, marks=pytest.mark.slow)])
def test_killed_workers_cost_time_and_no_byte(kills, client, whole, tmp_path, monkeypatch):
    """`kill -9` while a worker has blocks in hand; what it had computed is computed by another."""
    path, chance, hit = tmp_path / "store", random.Random(kills), []
    write = store_module.Store.write
    at = sorted(chance.sample(range(2, 30), kills))

    def killing(self, unit, values, by=None):
        write(self, unit, values, by)
        if len(hit) < kills and self.count_finished() >= at[len(hit)]:
            victim = chance.choice(workers_of(client))
            os.kill(victim, signal.SIGKILL)
            hit.append(victim)

    monkeypatch.setattr(store_module.Store, "write", killing)
    found = sweep(path, client=client)
    assert len(hit) == kills
    assert found.attrs["sweep_state"] == "finished"
    assert_same(path, whole)
    assert not list(path.rglob("*.part"))
    client.wait_for_workers(2, timeout=120)


@pytest.mark.more
def test_a_flipped_byte_and_a_lost_record_are_computed_again(client, whole, tmp_path):
    path = tmp_path / "store"
    sweep(path, client=client)
    victim = path / "data.zarr" / "x" / "c" / "11" / "0" / "0"
    data = bytearray(victim.read_bytes())
    data[len(data) // 2] ^= 4
    victim.write_bytes(bytes(data))
    (path / "finished" / "000003.json").unlink()
    assert verify_store(path) == [str(victim.relative_to(path))]
    sweep(path, client=client)
    assert_same(path, whole)
    assert json.loads((path / "runs.jsonl").read_text().splitlines()[-2])["blocks_to_do"] == 2


@pytest.mark.more
def test_a_full_disk_keeps_what_is_finished_and_frees_the_workers(client, tmp_path, monkeypatch):
    path, write, left = tmp_path / "store", store_module.write_whole, [40]

    def full(target, content, mark=""):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(target))
        write(target, content, mark)

    with monkeypatch.context() as patch:
        patch.setattr(store_module, "write_whole", full)
        with pytest.raises(SweepWriteError, match=r"No space left.* finished blocks are kept"):
            sweep(path, client=client)
    limit = time.monotonic() + 60
    while any(client.processing().values()) and time.monotonic() < limit:
        time.sleep(0.05)
    assert not any(client.processing().values())
    assert open_dataset(path).attrs["sweep_state"].startswith("unfinished")
    assert sweep(path, client=client).attrs["sweep_state"] == "finished"


def test_a_worker_with_another_program_is_refused_by_name(client, tmp_path):
    def set_offset(text):
        os.environ["STICKSLIP_TEST_OFFSET"] = text

    client.run(set_offset, "0.25")
    with pytest.raises(SweepMismatchError, match=r"worker.* computes another sweep.*: program is "):
        _sweeps.elsewhere(tmp_path / "store", client=client)
    client.run(set_offset, "0.0")
    found = _sweeps.elsewhere(tmp_path / "store", client=client)
    np.testing.assert_array_equal(found.x, np.add.outer(*_sweeps.SMALL.values()))


def test_hosts_that_differ_are_refused_by_name_or_recorded(client, tmp_path):
    def wish(executor):
        os.environ["STICKSLIP_EXECUTOR"] = executor

    def auto(store, **more):
        return run_sweep(
            _sweeps.plain, _sweeps.SMALL,
            **options(store, chunk=2, executor="auto", client=client, **more),
        )  # fmt: skip

    before = os.environ.get("STICKSLIP_EXECUTOR", "auto")
    client.run(wish, "fused")
    os.environ["STICKSLIP_EXECUTOR"] = "portable"
    try:
        with pytest.raises(SweepMismatchError, match=r"is 'portable' there, 'fused' on the worker"):
            auto(tmp_path / "alike")
        found = auto(tmp_path / "any", hosts="any")
    finally:
        os.environ["STICKSLIP_EXECUTOR"] = before
        client.run(wish, before)
    np.testing.assert_allclose(found.x, np.add.outer(*_sweeps.SMALL.values()))
    record = json.loads((tmp_path / "any" / "finished" / "000001.json").read_text())
    assert record["computed_with"]["executor"] == "fused"
    assert verify_store(tmp_path / "any") == []


def test_an_error_of_a_lane_comes_back_and_an_interruption_ends_it(client, tmp_path, monkeypatch):
    def lane(k):
        if threading.current_thread() is not threading.main_thread():
            raise FloatingPointError("nothing is right here")
        return k

    with pytest.raises(FloatingPointError, match="nothing is right here"):
        run_sweep(lane, {"k": [1.0, 2.0]}, **options(client=client))

    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(store_module.Store, "write", stopped)
    with pytest.raises(KeyboardInterrupt, match=r"0 of 5 blocks are kept in store .*the same call"):
        _sweeps.small(tmp_path / "store", client=client)


def test_what_is_no_client_is_refused():
    with pytest.raises(TypeError, match="client = 3: it must be a Client of Dask distributed, or None"):
        Compute(client=3)
