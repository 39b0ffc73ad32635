"""Workers of a local Dask cluster on one store: how much faster two of them are than one.

Each run is a new cluster of one-threaded workers and a new store; one run after the other, in turns.
The rate at work counts from where each worker has finished its first unit: what a start costs, imports
and a program from the disk, weighs nothing in a sweep of hours. All stores must hold the same bytes.
"""

import hashlib
import importlib.util
import pathlib
import statistics
import tempfile
import time
from typing import Any

import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.sweep import Compute, Storage, run_sweep
from stickslip.systems import CoulombOscillator, Motion

SIZES = {"quick": (1, 16, 1000.0), "normal": (2, 40, 8000.0), "full": (4, 40, 8000.0)}
WORKERS = (1, 2)
UNIT = 256  # lanes


def _sweep(folder: pathlib.Path, client: Any, units: int, duration: float) -> None:
    """Where a block on a belt is after so many seconds, over the speed of the belt."""

    def lane(belt_speed):
        block = CoulombOscillator(1.0, 1.0, 1.5, 0.5, belt_speed)
        start = Motion(x=jnp.zeros(()), v=belt_speed)
        run = ss.simulate(block, 0.0, duration, start, saveat=ss.SaveAt(max_events=None), throw=False)
        return {"x": run.y1.x, "events": run.num_events, "ok": run.successful}

    grid = {"belt_speed": np.linspace(0.2, 0.4, units * UNIT)}
    compute = Compute(client=client, progress=False)
    run_sweep(lane, grid, store=Storage(folder, chunk=UNIT), compute=compute)


def _run(folder: pathlib.Path, workers: int, units: int, duration: float) -> dict[str, float | str]:
    """Seconds from start to end, lanes per second at work, and a digest of what was computed."""
    import distributed

    begin = time.perf_counter()
    options: Any = {"dashboard_address": None, "local_directory": str(folder.parent)}
    with (
        distributed.LocalCluster(n_workers=workers, threads_per_worker=1, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        _sweep(folder, client, units, duration)
    seconds = time.perf_counter() - begin
    times = sorted(path.stat().st_mtime for path in (folder / "finished").glob("*.json"))
    after = times[workers - 1 :]
    total = hashlib.sha256()
    for path in sorted((folder / "data.zarr").rglob("*")):
        if path.is_file():
            total.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    rate = (len(after) - 1) * UNIT / (after[-1] - after[0])
    return {"seconds": seconds, "rate": rate, "digest": total.hexdigest()}


def main(size: str = "normal") -> str:
    """Table: seconds from start to end and lanes per second at work, by the number of workers."""
    if importlib.util.find_spec("distributed") is None:
        return "Dask distributed is absent"
    rounds, units, duration = SIZES[size]
    found: dict[int, list[dict]] = {workers: [] for workers in WORKERS}
    with tempfile.TemporaryDirectory() as folder:
        # The first compiles for all.
        _run(pathlib.Path(folder, "first"), 1, 2, duration)
        for number in range(rounds):
            for workers in WORKERS:
                place = pathlib.Path(folder, f"{number} {workers}")
                found[workers].append(_run(place, workers, units, duration))
    lanes = units * UNIT
    lines = [
        f"{lanes:,} lanes of {duration:g} s of a block on a belt, {units} units; medians of {rounds}",
        f"  {'':12s} {'start to end s':>15s} {'ratio':>7s} {'at work lanes/s':>16s} {'ratio':>7s}",
    ]
    one = found[WORKERS[0]]
    for workers, runs in found.items():
        seconds = statistics.median(run["seconds"] for run in runs)
        rate = statistics.median(run["rate"] for run in runs)
        shorter = statistics.median(a["seconds"] / b["seconds"] for a, b in zip(one, runs, strict=True))
        faster = statistics.median(b["rate"] / a["rate"] for a, b in zip(one, runs, strict=True))
        name = f"{workers} worker{'s' if workers > 1 else ''}"
        lines.append(f"  {name:12s} {seconds:15.1f} {shorter:7.2f} {rate:16.0f} {faster:7.2f}")
    digests = {run["digest"] for runs in found.values() for run in runs}
    lines.append(f"  the same bytes in all stores: {'yes' if len(digests) == 1 else 'NO'}")
    return "\n".join(lines)
