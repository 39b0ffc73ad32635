"""Workers on one store: how much faster two of them are than one, from the command line.

Each run is a new store and `python -m stickslip work STORE --processes N`; one run after the other, in
turns. The rate at work counts from where each worker has finished its first unit: what a start costs,
imports and a program from the disk, weighs nothing in a sweep of hours. All stores must hold the same
bytes.
"""

import hashlib
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

from stickslip.sweep import plan_sweep

from . import _workers_sweep

SIZES = {"quick": (1, 16, 1000.0), "normal": (2, 40, 8000.0), "full": (4, 40, 8000.0)}
WORKERS = (1, 2)


def _run(folder: pathlib.Path, workers: int, units: int, duration: float) -> dict[str, float | str]:
    """Seconds from start to end, lanes per second at work, and a digest of what was computed."""
    plan_sweep(_workers_sweep.sweep, folder, units=units, duration=duration)
    # As from a shell: one device.
    clean = {key: value for key, value in os.environ.items() if key != "XLA_FLAGS"}
    command = [sys.executable, "-m", "stickslip", "work", str(folder), "--quiet"]
    begin = time.perf_counter()
    done = subprocess.run(
        [*command, f"--processes={workers}"], capture_output=True, text=True, env=clean, check=False
    )
    seconds = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
    times = sorted(path.stat().st_mtime for path in (folder / "finished").glob("*.json"))
    after = times[workers - 1 :]
    total = hashlib.sha256()
    for path in sorted((folder / "data.zarr").rglob("*")):
        if path.is_file():
            total.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    rate = (len(after) - 1) * _workers_sweep.UNIT / (after[-1] - after[0])
    return {"seconds": seconds, "rate": rate, "digest": total.hexdigest()}


def main(size: str = "normal") -> str:
    """Table: seconds from start to end and lanes per second at work, by the number of workers."""
    rounds, units, duration = SIZES[size]
    found: dict[int, list[dict]] = {workers: [] for workers in WORKERS}
    with tempfile.TemporaryDirectory() as folder:
        # The first compiles for all.
        _run(pathlib.Path(folder, "first"), 1, 2, duration)
        for number in range(rounds):
            for workers in WORKERS:
                place = pathlib.Path(folder, f"{number} {workers}")
                found[workers].append(_run(place, workers, units, duration))
    lanes = units * _workers_sweep.UNIT
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
