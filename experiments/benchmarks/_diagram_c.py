"""The C file compiled for this machine, with the widths and flags that run fastest here."""

import ctypes
import dataclasses
import itertools
import pathlib
import time
from typing import Any

import numpy as np

from ._c import compiled
from ._diagram_job import Case, Job, Points, tsit5

SOURCE = pathlib.Path(__file__).with_name("diagram.c")
SCHEDULING = ("-fschedule-insns", "-fsched-pressure")


def _header(case: Case) -> str:
    a, b = tsit5()
    values = {**case.values, "START_X": case.start[0], "START_Y": case.start[1]}
    if case.drive is not None:
        values |= _drive_values(case)
    values |= {f"A_{i}_{j}": float(a[i, j]) for i in range(6) for j in range(i)}
    values |= {f"B_{i}": float(value) for i, value in enumerate(b)}
    return "".join(f"#define {name} ({value!r})\n" for name, value in values.items())


def _drive_values(case: Case) -> dict[str, float]:
    drive: Any = case.drive
    names = ("L_w", "R_w", "k_e", "k_m", "T_k", "rho", "eta", "r_bp", "U_in")
    values = {name.upper(): float(getattr(drive, name)) for name in names}
    values |= {"B_DC": float(drive.b), "J_DRIVE": float(drive.inertia)}
    return {**values, "START_I_W": case.start_current}


@dataclasses.dataclass(frozen=True)
class Build:
    """One compilation: lanes in a register, registers interleaved, further flags."""

    width: int
    groups: int
    flags: tuple[str, ...] = ()

    def __str__(self) -> str:
        flags = ", scheduled" if self.flags else ""
        return f"width {self.width} x {self.groups}{flags}"

    def load(self, case: Case):
        name = f"{case.name.replace(' ', '-')}-{self.width}-{self.groups}-{len(self.flags)}"
        flags = (*self.flags, f"-DWIDTH={self.width}", f"-DGROUPS={self.groups}")
        function = compiled(SOURCE, name, _header(case), flags).diagram
        number, pointer = ctypes.c_long, ctypes.c_void_p
        function.argtypes = [
            number, pointer, ctypes.c_double, number, number, number, ctypes.c_int,
            pointer, pointer, pointer, pointer,
        ]  # fmt: skip
        function.restype = None
        return function


def runner(build: Build, job: Job, threads: int):
    """Function of k3 that gives the job's points."""
    function = build.load(job.case)

    def run(k3: np.ndarray) -> Points:
        k3 = np.ascontiguousarray(k3, np.float64)
        out, end = job.empty(k3.size), np.zeros(k3.size)
        pointers = [a.ctypes.data for a in (*out, end)]
        function(k3.size, k3.ctypes.data, job.h, job.steps, job.first, job.room, threads, *pointers)
        return out

    return run


def widths() -> list[Build]:
    """What is worth a trial: registers of 256 and 512 bits, one to three in flight."""
    pairs = [(4, 2), (4, 3), (8, 1), (8, 2), (8, 3), (16, 1)]
    return [Build(w, g, f) for (w, g), f in itertools.product(pairs, ((), SCHEDULING))]


def fastest(case: Case) -> Build:
    """The build that takes the least time for a part of the job on one thread here."""
    job = Job(case, lanes=96, transient=1.0, duration=1.5)
    best = {}
    programs = {build: runner(build, job, 1) for build in widths()}
    for _ in range(5):
        for build, program in programs.items():
            start = time.perf_counter()
            program(job.k3)
            best[build] = min(best.get(build, np.inf), time.perf_counter() - start)
    return min(best, key=lambda build: best[build])
