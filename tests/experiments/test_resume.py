"""The commands of Figs. 2.3 and 2.13 are killed and go on where they were."""

import os
import pathlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray as xr

ROOT = pathlib.Path(__file__).parents[2]


def finished(out):
    """Blocks that are done, with the times of their records."""
    return {p: p.stat().st_mtime_ns for p in out.glob("stores/beam-*/finished/*.json")}


def begin(name, out, compiled, *changes):
    command = [sys.executable, "-m", "experiments", name, "--quick", "--out", str(out)]
    for change in changes:
        command += ["--set", change]
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(compiled)}
    return subprocess.Popen(command, cwd=ROOT, env=environment)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "blocks"),
    [
        ("beam-fig2.3", ("chunk=2", "speeds=16"), 2 * 8),
        ("beam-fig2.13", ("chunk=1", "segments=40", "transient=20"), 2 * (8 + 4)),
    ],
)
def test_killed_and_resumed_equals_uninterrupted(name, changes, blocks, tmp_path):
    whole, cut, compiled = (tmp_path / folder for folder in ("whole", "cut", "compiled"))
    assert begin(name, whole, compiled, *changes).wait() == 0
    assert len(finished(whole)) == blocks
    kept = {}
    # In the first reading of the equations, and in the second.
    for least in (2, blocks // 2 + 1):
        process = begin(name, cut, compiled, *changes)
        while process.poll() is None and len(finished(cut)) < least:
            time.sleep(0.001)
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert not (cut / f"{name}.nc").exists()
        now = finished(cut)
        assert len(kept) < len(now) < blocks
        assert kept.items() <= now.items(), "a block that was done was done again"
        kept = now
    assert begin(name, cut, compiled, *changes).wait() == 0
    assert kept.items() <= finished(cut).items()
    one, other = (xr.load_dataset(p / f"{name}.nc", engine="h5netcdf") for p in (whole, cut))
    assert set(one.variables) == set(other.variables)
    for key in one.variables:
        assert np.asarray(one[key]).tobytes() == np.asarray(other[key]).tobytes(), key
    assert (whole / f"{name}.svg").read_bytes() == (cut / f"{name}.svg").read_bytes()
