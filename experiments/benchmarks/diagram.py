"""Fig. 2 of the block on a belt against C written by hand and against the peers.

25,001 values of k3, 40 s each, crossings located to 1e-8 s or better, points of 15 s to 40 s kept. C,
engine and numba take Tsit5 at the step that errs by 1e-8 per second; the engine also adaptive steps
and the peers their own, all with the errors beside them. All take turns in one run.
"""

import dataclasses
import functools
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss

from . import _diagram_peers as peers
from ._c import CompilerAbsentError
from ._diagram_c import Build, fastest, runner
from ._diagram_job import LANES, Case, Job, Points, errors, full_model, mild, plain_field, set_a
from ._harness import Candidate, absent, interleave, table

REFERENCE = 1e-15  # tolerance of heyoka as reference; without it SciPy's DOP853 at
REFERENCE_SCIPY = 1e-13
WORKERS = os.cpu_count() or 1
PRECISE = (1e-9, 1e-10, 1e-11, 1e-12)  # tolerances of the engine in the table of small errors
HEYOKA = (1e-6, 1e-7, 1e-8, 1e-9)  # and of heyoka, whose errors are far below its tolerances
MANY = 100_000_000  # steps; the end of a run, not their number, is what ends it


def steps_of(
    h: float | None = None, tolerance: float | None = None, method: Any = "tsit5"
) -> ss.Integrator:
    """A method with fixed or adaptive steps."""
    if tolerance is None:
        assert h is not None
        step = ss.FixedStep(h)
    else:
        step = ss.AdaptiveStep(tolerance, 0.1 * tolerance)
    return ss.Integrator(method, step, max_steps=MANY)


def engine(job: Job, executor: str, integrator=None) -> Callable[[np.ndarray], Points]:
    """The job through the public interface: two simulations a lane, mapped over the lanes."""
    options: Any = {"integrator": integrator or steps_of(job.h), "throw": False}

    def lane(k3):
        system = job.case.system(k3)
        settled = ss.simulate(
            system, 0.0, job.transient, job.case.initial, saveat=ss.SaveAt(max_events=None), **options
        )
        run = ss.simulate(
            system, job.transient, job.end, settled.y1, settled.mode1,
            saveat=ss.SaveAt(
                sections=system.zero_acceleration_section(), max_events=None, max_crossings=job.room
            ),
            **options,
        )  # fmt: skip
        rows = run.crossings[0]
        return rows.y.x, rows.t, rows.count

    program = ss.map_lanes(lane, executor=executor, workers=WORKERS)

    def run(k3):
        x, t, count = (np.asarray(a) for a in program(jnp.asarray(k3)))
        valid = np.arange(job.room) < count[:, None]
        return Points(np.where(valid, x, np.nan), np.where(valid, t, np.nan), count)

    return run


def reference(job: Job, k3: np.ndarray) -> tuple[str, Points]:
    """The true points of a few lanes, by an independent integrator."""
    if job.case.drive is not None:
        return "the engine at 1e-11", engine(job, "auto", steps_of(tolerance=1e-11))(k3)
    if absent("heyoka"):
        run = peers.scipy_dop853(job, REFERENCE_SCIPY)
        return f"SciPy's DOP853 at {REFERENCE_SCIPY:g}", run(k3)
    return f"heyoka at {REFERENCE:g}", peers.heyoka_serial(job, REFERENCE)(k3)


def accuracy(case: Case, number: int = 40) -> str:
    """Error of one second from states on the attractors, all k3, against SciPy's DOP853 at 1e-13."""
    from scipy.integrate import solve_ivp

    k3 = jnp.linspace(72.0, 97.0, number)

    def end(state, k3, seconds, integrator):
        options: Any = {
            "integrator": integrator, "saveat": ss.SaveAt(max_events=None), "throw": False
        }  # fmt: skip
        return ss.simulate(case.system(k3), 0.0, seconds, state, **options).y1

    zero = jax.tree.map(lambda a: jnp.full(number, a), case.initial)
    settle = ss.map_lanes(functools.partial(end, integrator=steps_of(case.h)))
    starts = settle(zero, k3, 20.0 + jnp.linspace(0.0, 1.0, number))
    truth = np.array(
        [
            solve_ivp(
                plain_field(case), (0, 1), [s[0], s[2], s[1], s[3]], "DOP853", args=(float(k),),
                rtol=1e-13, atol=1e-14,
            ).y[:, -1]
            for s, k in zip(np.stack(starts, axis=1), k3, strict=True)
        ]
    )  # fmt: skip
    parts = []
    for name, integrator in (
        (f"steps of 1/{1 / case.h:g} s", steps_of(case.h)),
        ("adaptive 1e-8", steps_of(tolerance=1e-8)),
    ):
        got = ss.map_lanes(functools.partial(end, integrator=integrator))(starts, k3, jnp.ones(number))
        gap = np.abs(np.stack([got.x, got.y, got.vx, got.vy], axis=1) - truth)
        parts.append(f"{gap[:, :2].max():.1e} m and {gap[:, 2:].max():.1e} m/s with {name}")
    return f"Error after 1 s from {number} states on the attractors: " + "; ".join(parts)


class Field:
    """Candidates of one job with their errors, and the names of those that were not there."""

    def __init__(self, job: Job, few: int):
        self.job = job
        self.sample = job.sample()
        self.source, self.truth = reference(job, job.k3[self.sample])
        self.part = job.k3[np.linspace(0, job.lanes - 1, few).round().astype(int)]
        self.candidates: list[Candidate] = []
        self.missing: list[str] = []

    def add(self, name, run, lanes, *, cores=WORKERS, found=None, sample=slice(None), rounds=None):
        """`lanes` of the job by `run`; a run on one core is credited with perfect scaling."""
        truth = Points(*(a[sample] for a in self.truth))
        found = run(self.job.k3[self.sample][sample]) if found is None else found
        error, error_t = errors(found, truth)
        share = lanes.size / self.job.lanes * WORKERS / cores
        self.candidates.append(
            Candidate(name, functools.partial(run, lanes), error, share, rounds, error_t)
        )

    def add_c(self) -> None:
        try:
            build = fastest(self.job.case)
            c, plain = runner(build, self.job, WORKERS), runner(Build(1, 1), self.job, 1)
        except CompilerAbsentError as problem:
            self.missing.append(f"C ({problem})")
            return
        self.add(f"C, {build}, {WORKERS} threads", c, self.job.k3)
        self.add("C, lane by lane, library functions (*)", plain, self.part, cores=1)

    def add_engine(self) -> None:
        for words, integrator in (
            ("fixed steps", steps_of(self.job.h)),
            ("adaptive 1e-8", steps_of(tolerance=1e-8)),
        ):
            for executor in ("fused", "portable"):
                run = engine(self.job, executor, integrator)
                found = Points(*(a[self.sample] for a in run(self.job.k3)))
                name = f"engine, {executor}, {words}, {WORKERS} workers"
                self.add(name, run, self.job.k3, found=found)

    def add_peers(self) -> None:
        job = self.job
        if absent("numba"):
            self.missing.append("numba")
        else:
            lanes = job.k3[:: max(1, job.lanes // (16 * self.part.size))]
            self.add(f"numba, {WORKERS} threads", peers.numba_lanes(job, WORKERS), lanes)
        if absent("heyoka"):
            self.missing.append("heyoka")
        else:
            for tolerance in (1e-6, 1e-7):
                run = peers.heyoka_batch(job, tolerance)
                self.add(f"heyoka, batches, events, {tolerance:g} (*)", run, self.part, cores=1)
            bare = functools.partial(peers.heyoka_batch(job, 1e-6, points=False), self.part)
            share = self.part.size / job.lanes * WORKERS
            self.candidates.append(
                Candidate("heyoka, the same at 1e-06, x not read (*)", bare, None, share)
            )
        short = dataclasses.replace(job, lanes=256, transient=2.0, duration=3.0)
        share = 256 / job.lanes * short.end / job.end
        sample = short.sample()
        _, truth = reference(short, short.k3[sample])
        for solver in ("Dopri8", "Tsit5"):
            run = peers.diffrax_points(short, solver, 1e-8)
            error, error_t = errors(Points(*(a[sample] for a in run(short.k3))), truth)
            name = f"diffrax, vmap, {solver}, 1e-8 (5 s of it)"
            self.candidates.append(
                Candidate(name, functools.partial(run, short.k3), error, share, 2, error_t)
            )
            run = functools.partial(peers.diffrax_end(short, solver, 1e-8), short.k3)
            name = f"diffrax, {solver}, end only, no points (5 s of it)"
            self.candidates.append(Candidate(name, run, None, share, 2))
        run = peers.scipy_dop853(job, 1e-9)
        one = job.k3[self.sample[:1]]
        self.add("SciPy, DOP853, events, 1e-9 (1 lane *)", run, one, cores=1, sample=slice(1), rounds=1)


def comparison(job: Job, rounds: int, few: int) -> str:
    """The table of one case."""
    field = Field(job, few)
    field.add_c()
    field.add_engine()
    if job.case.drive is None:
        field.add_peers()
    rows = interleave(field.candidates, rounds)
    title = (
        f"Diagram with {job.case.name}: {job.lanes} of {LANES} lanes x {job.end:g} s, Tsit5 with steps "
        f"of 1/{1 / job.h:g} s.\n  Seconds for these lanes; errors of x [m] and t [s] on "
        f"{field.sample.size} lanes with k3 up to {job.case.settled:g} against {field.source};\n"
        f"  (*) a part of the lanes on one core, perfect scaling to {WORKERS} cores credited"
    )
    lines = [table(title, rows, field.missing)]
    if job.case.drive is None:
        lines.insert(0, accuracy(job.case))
    return "\n".join(lines)


def work_and_precision(case: Case, lanes: int, rounds: int, few: int) -> str:
    """The engine and heyoka at small errors: tolerances in turn, all on the same job."""
    if absent("heyoka"):
        return "Work and precision: heyoka absent"
    field = Field(Job(case, lanes), few)
    for tolerance in PRECISE:
        run = engine(field.job, "fused", steps_of(tolerance=tolerance, method="dop853"))
        found = Points(*(a[field.sample] for a in run(field.job.k3)))
        field.add(f"engine, fused, DOP853, {tolerance:g}", run, field.job.k3, found=found)
    for tolerance in HEYOKA:
        run = peers.heyoka_batch(field.job, tolerance)
        field.add(f"heyoka, batches, events, {tolerance:g} (*)", run, field.part, cores=1)
    title = (
        f"Work and precision with {case.name}: {lanes} of {LANES} lanes x {field.job.end:g} s, "
        f"{WORKERS} workers; errors against {field.source};\n"
        f"  (*) a part of the lanes on one core, perfect scaling to {WORKERS} cores credited"
    )
    return table(title, interleave(field.candidates, rounds), field.missing)


def lanes_table(case: Case, numbers: list[int]) -> str:
    """Time per lane by the number of lanes."""
    try:
        build: Build | None = fastest(case)
    except CompilerAbsentError:
        build = None
    names = ["engine, fused", "C" if build else "C absent"]
    lines = [f"Microseconds per lane by the number of lanes, 2 s of motion, {WORKERS} workers"]
    lines.append(f"  {'lanes':>10s} " + " ".join(f"{name:>14s}" for name in names))
    for number in numbers:
        job = Job(case, lanes=number, transient=1.0, duration=1.0, room=8)
        runs = [engine(job, "fused")] + ([runner(build, job, WORKERS)] if build else [])
        runs[0](job.k3)
        times = [[_seconds(run, job.k3) for run in runs] for _ in range(5 if number < 100_000 else 2)]
        medians = [statistics.median(t) / number * 1e6 for t in zip(*times, strict=True)]
        lines.append(f"  {number:10d} " + " ".join(f"{m:14.2f}" for m in medians))
    return "\n".join(lines)


def _seconds(run, argument) -> float:
    start = time.perf_counter()
    run(argument)
    return time.perf_counter() - start


def fresh_processes(lanes: int, seconds: float) -> str:
    """Compile time, first call and memory, each in a process of its own, nothing kept from before."""
    environment = {**os.environ, "JAX_ENABLE_COMPILATION_CACHE": "0"}
    head = " ".join(f"{w:>9s}" for w in ("first s", "again s", "compile s", "memory GB"))
    lines = [f"{lanes} lanes x {seconds:g} s in a fresh process", f"  {'':34s} {head}"]
    for what in ("map_lanes, fused", "map_lanes, portable", "orbit_diagram", "orbit_diagram, no check"):
        command = [sys.executable, "-m", "experiments.benchmarks._diagram_child"]
        done = subprocess.run(
            [*command, what, str(lanes), str(seconds)],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            lines.append(f"  {what:34s} failed: {done.stderr.strip()[-200:] or done.returncode}")
            continue
        got = json.loads(done.stdout.strip().splitlines()[-1])
        again = got["again"]
        figures = [got["first"], again, None if again is None else got["first"] - again, got["memory"]]
        words = ["" if figure is None else f"{figure:.2f}" for figure in figures]
        lines.append(f"  {what:34s} " + " ".join(f"{word:>9s}" for word in words))
    return "\n".join(lines)


def main(size: str = "normal") -> Iterator[str]:
    """The tables, each when it is there; `size` is "quick", "normal" (every 25th lane) or "full"."""
    every = {"quick": 250, "normal": 25, "full": 1}[size]
    lanes = (LANES - 1) // every + 1
    rounds = {"quick": 3, "normal": 5, "full": 3}[size]
    few = {"quick": 16, "normal": 32, "full": 64}[size]
    numbers = [1_000, 10_000, 100_000, 1_000_000][: {"quick": 2, "normal": 3, "full": 4}[size]]
    yield comparison(Job(set_a(), lanes), rounds, few)
    yield "\n" + comparison(Job(mild(), lanes), rounds, few)
    yield "\n" + comparison(Job(full_model(), lanes), rounds, few)
    for case in (set_a(), mild()):
        yield "\n" + work_and_precision(case, lanes, rounds, few)
    yield "\n" + lanes_table(mild(), numbers)
    yield "\n" + fresh_processes(LANES, {"quick": 0.25, "normal": 2.0, "full": 40.0}[size])
