"""One run of the job in this process alone: time of the first call, of the next, and memory."""

import os

os.environ.setdefault("XLA_FLAGS", f"--xla_force_host_platform_device_count={os.cpu_count()}")

import json
import pathlib
import re
import resource
import sys
import time

import numpy as np

from stickslip.analysis import Recording, orbit_diagram
from stickslip.sweep import Compute

from ._diagram_job import Job, set_a
from .diagram import engine, steps_of


def diagram(job: Job, check: int):
    """The same through `orbit_diagram`, with labels, periods and, with `check`, an error estimate."""
    system, start = job.case.system(80.0), job.case.initial

    section = system.zero_acceleration_section()
    record = Recording(job.transient, job.duration, section, "x", max_points=job.room, check=check)

    def run(k3: np.ndarray):
        return orbit_diagram(
            system, {"k3": k3}, start, record,
            integrator=steps_of(tolerance=1e-8),
            compute=Compute(progress=False),
        )  # fmt: skip

    return run


def most_memory() -> float:
    """Most memory this process has held [GB]."""
    status = pathlib.Path("/proc/self/status")
    if status.exists():  # what `getrusage` says there may be of the process that started this one
        found = re.search(r"VmHWM:\s*(\d+) kB", status.read_text())
        if found:
            return int(found[1]) / 1e6
    # Kilobytes on Linux, bytes on macOS.
    unit = 1e9 if sys.platform == "darwin" else 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def main() -> None:
    """Print the figures as JSON."""
    what, lanes, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    job = Job(set_a(), lanes, transient=0.375 * seconds, duration=0.625 * seconds)
    again = what.startswith("map_lanes")
    if again:
        run = engine(job, what.split(", ")[1], steps_of(tolerance=1e-8))
    else:
        run = diagram(job, 0 if "no check" in what else 32)
    times = []
    for _ in range(2 if again else 1):
        start = time.perf_counter()
        run(job.k3)
        times.append(time.perf_counter() - start)
    figures = {"first": times[0], "again": times[1] if again else None, "memory": most_memory()}
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
