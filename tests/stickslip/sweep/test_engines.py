"""The same bytes by whatever starts the workers."""

import concurrent.futures
import multiprocessing
import os
import signal
import threading
import time

import pytest

from stickslip.sweep import open_dataset, plan_sweep, work_on, work_with
from tests.stickslip.sweep import _planned
from tests.stickslip.sweep.test_work import at_work, contents


class Here:
    """Runs what is submitted at once."""

    def submit(self, function, *args, **kwargs):
        future = concurrent.futures.Future()
        future.set_result(function(*args, **kwargs))
        return future


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("engines") / "store"
    plan_sweep(_planned.logistic_map, path)
    work_on(path)
    return path


def test_an_engine_only_starts_workers(tmp_path):
    path = tmp_path / "store"
    plan_sweep(_planned.small, path)
    assert work_with(Here(), path, tasks=3) == {"computed": 5, "left": 0}
    with pytest.raises(TypeError, match=r"client = .*it must be one with a method `submit`"):
        work_with(None, path, tasks=1)


def test_threads_of_one_process_share_the_work(tmp_path):
    """As the threads of a Dask worker do."""
    path = tmp_path / "store"
    plan_sweep(_planned.small, path, pause=0.02)
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        assert work_with(pool, path, tasks=3) == {"computed": 5, "left": 0}
    assert open_dataset(path).attrs["sweep_state"] == "finished"


@pytest.mark.slow
def test_a_pool_of_the_standard_library(whole, tmp_path):
    path = tmp_path / "store"
    plan_sweep(_planned.logistic_map, path, pause=0.1)
    spawn = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, spawn) as pool:
        assert work_with(pool, path, tasks=2) == {"computed": 35, "left": 0}
    for part in ("data.zarr", "finished"):
        assert contents(path / part) == contents(whole / part)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_dask_with_a_worker_killed_in_the_middle(whole, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask distributed is not installed")
    path = tmp_path / "store"
    plan_sweep(_planned.logistic_map, path, pause=0.4)
    killed = []

    def kill():
        limit = time.monotonic() + 200
        while not killed and time.monotonic() < limit:
            busy = at_work(path)
            if len(busy) > 1:
                time.sleep(0.2)
                os.kill(min(busy), signal.SIGKILL)
                killed.append(min(busy))
            time.sleep(0.05)

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path)
    ) as cluster:
        with distributed.Client(cluster) as client:
            thread = threading.Thread(target=kill)
            thread.start()
            found = work_with(client, path, tasks=2)
            thread.join()
    assert killed
    assert found["left"] == 0
    assert open_dataset(path).attrs["sweep_state"] == "finished"
    for part in ("data.zarr", "finished"):
        assert contents(path / part) == contents(whole / part)
