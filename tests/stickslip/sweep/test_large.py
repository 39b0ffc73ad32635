"""A million lanes: few files, taken up at once, in memory that does not grow with their number."""

import json
import subprocess
import sys
import time

import numpy as np
import pytest

from stickslip.sweep import open_dataset
from stickslip.sweep.evaluate import Evaluate
from tests.house._repository import ROOT
from tests.stickslip.sweep import _sweeps

pytestmark = pytest.mark.slow


def in_a_process(store, rows):
    """Seconds and MB of the sweep in a new process."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.stickslip.sweep._sweeps", str(store), str(rows)],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    seconds, memory = map(float, done.stdout.split())
    return seconds, memory


def test_a_million_lanes(tmp_path, monkeypatch):
    store = tmp_path / "store"
    _, small = in_a_process(tmp_path / "small", 263)  # one shard, as large as any
    _, large = in_a_process(store, 1000)
    files = [p for p in store.rglob("*") if p.is_file()]
    assert len(files) <= 200
    monkeypatch.setattr(Evaluate, "__call__", None)  # nothing is computed
    _sweeps.large(store)
    begin = time.process_time()
    dataset = _sweeps.large(store)
    resumed = time.process_time() - begin
    assert resumed < 2.0
    a, b = np.linspace(0.0, 1.0, 1000), np.linspace(2.0, 3.0, 1000)
    np.testing.assert_array_equal(dataset.x1[500:502], np.add.outer(a[500:502], b))
    assert dataset.attrs["sweep_state"] == "finished"
    begin = time.monotonic()
    open_dataset(store)
    hashed = time.monotonic() - begin
    # The results are 160 MB. One shard is 42 MB, of which a few copies are held at a time.
    assert large < small + 60.0
    print(json.dumps({
        "files": len(files), "resumed": resumed, "hashed": hashed, "MB": [small, large],
        "bytes": sum(p.stat().st_size for p in files),
    }))  # fmt: skip
