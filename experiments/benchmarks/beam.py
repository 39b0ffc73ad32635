"""Figs. 2.3 and 2.13 of the jointed beam against the same algorithm in numba.

Both take DOP853 at the same step, locate events and crossings within it, and drop and record the same
times. The truth for the errors is the algorithm at half of the step by whichever of the two is not the
one judged, on lanes below the first bifurcation, where errors do not grow.
"""

import dataclasses
import functools
import os
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.analysis import Segments, lyapunov_spectrum

from ..beam._diagram import points
from ..beam._exponent import PARAMETERS as EXPONENTS
from ..beam._exponent import options
from ..beam._model import CONTACT_PERIOD, norm_of, system_of
from ._harness import Candidate, absent, interleave, table

LOW, HIGH, SETTLED = 1e-4, 3e-2, 2.3e-3
WORKERS = os.cpu_count() or 1
Found = dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Job:
    """Lanes evenly over the belt speed and what is done in each."""

    lanes: int
    h: float = 0.005
    modes: int = 5
    transient: float = 300.0
    duration: float = 100 * CONTACT_PERIOD
    room: int = 256
    segment: float = 0.5
    segments: int = 800

    @property
    def speeds(self) -> np.ndarray:
        return np.linspace(LOW, HIGH, self.lanes)

    @property
    def sample(self) -> np.ndarray:
        """Belt speeds at which errors do not grow."""
        return np.linspace(LOW, SETTLED, 8)

    def finer(self, times: int) -> "Job":
        return dataclasses.replace(self, h=self.h / times)


def engine_diagram(job: Job, executor: str):
    """Points of x, y and w and the number of sticks, as the figure computes them."""
    settings = {
        "transient": job.transient, "duration": job.duration, "max_points": job.room, "h": job.h,
        "direction": "falling",
    }  # fmt: skip

    def lane(v):
        system = system_of("consistent", v, job.modes)
        return points(system, system.start(), settings)

    program = ss.map_lanes(lane, executor=executor, workers=WORKERS)
    return lambda speeds: jax.tree.map(np.asarray, program(jnp.asarray(speeds)))


def engine_exponents(job: Job, executor: str):
    """All exponents of y and the beam."""
    settings = {**EXPONENTS, "h": job.h}
    record = Segments(job.segment, job.segments, job.transient)

    def lane(v):
        system = system_of("consistent", v, job.modes)
        found = lyapunov_spectrum(
            system, system.start(), record, scales=norm_of(system), **options(settings)
        )  # fmt: skip
        return {"exponents": found.exponents}

    program = ss.map_lanes(lane, executor=executor, workers=WORKERS)
    return lambda speeds: jax.tree.map(np.asarray, program(jnp.asarray(speeds)))


def _beam(job: Job) -> Any:
    from ._beam_numba import Beam

    s: Any = system_of("consistent", 1e-3, job.modes)
    m, k1, k2, k3, mu, gamma = (float(a) for a in (s.m, s.k1, s.k2, s.k3, s.mu_s, s.gamma))
    squares = np.asarray(s.frequencies()) ** 2
    phi = np.asarray(s.shapes(s.z_A))
    return Beam(m, k1, k2, k3, mu, gamma, phi, squares, float(s.start().x))


def numba_diagram(job: Job, threads: int = WORKERS):
    """The same by numba."""
    import numba  # pyright: ignore[reportMissingImports]

    from ._beam_numba import kernels

    numba.set_num_threads(min(threads, numba.get_num_threads()))
    beam, run = _beam(job), kernels()[0]

    def call(speeds) -> Found:
        found = np.full((len(speeds), 3, job.room), np.nan)
        counts, sticks = np.zeros((len(speeds), 3), np.int64), np.zeros(len(speeds), np.int64)
        run(np.asarray(speeds), beam, job.h, job.transient, job.duration, found, counts, sticks)
        return {**dict(zip("xyw", found.transpose(1, 0, 2), strict=True)), "sticks": sticks}

    return call


def numba_exponents(job: Job, threads: int = WORKERS):
    """The same by numba."""
    import numba  # pyright: ignore[reportMissingImports]

    from ._beam_numba import kernels

    numba.set_num_threads(min(threads, numba.get_num_threads()))
    beam, run = _beam(job), kernels()[1]
    size = 2 + 2 * job.modes
    # The frame that the library starts from.
    rows, columns = np.arange(1.0, size + 1)[:, None], np.arange(1.0, size + 1)[None, :]
    frame = np.linalg.qr(np.sin(rows * columns**2 + 0.7 * rows**2))[0]

    def call(speeds) -> Found:
        found, lost = np.zeros((len(speeds), size)), np.zeros((len(speeds), size), np.int64)
        run(
            np.asarray(speeds), beam, job.h, job.transient, job.segment, job.segments // 10,
            job.segments, frame, found, lost,
        )  # fmt: skip
        return {"exponents": np.where(lost > 0, -np.inf, found)}

    return call


def error(found: Found, truth: Found) -> float:
    """Largest difference of y against its size, or of an exponent; infinite if they do not match."""
    if "exponents" in found:
        a, b = found["exponents"], truth["exponents"]
        if not np.array_equal(np.isfinite(a), np.isfinite(b)):
            return np.inf
        return float(np.abs(a[np.isfinite(a)] - b[np.isfinite(b)]).max())
    a, b = found["y"], truth["y"]
    if not np.array_equal(np.isnan(a), np.isnan(b)) or not np.array_equal(
        found["sticks"], truth["sticks"]
    ):
        return np.inf
    size = np.nanmax(np.abs(b), axis=1, keepdims=True)
    return float(np.nanmax(np.abs(a - b) / size))


def comparison(
    title: str, job: Job, by_engine, by_numba, finer: int, rounds: int, executors=("fused", "portable")
) -> str:
    """One table: numba first where it is there, so that the ratios are to it."""
    fine = job.finer(finer)
    sample = job.sample
    here = not absent("numba")
    candidates = []
    if here:
        run = by_numba(job)
        truth = by_engine(fine, "fused")(sample)
        call = functools.partial(run, job.speeds)
        mistake = error(run(sample), truth)
        candidates.append(Candidate(f"numba, {WORKERS} threads", call, mistake, compiled=True))
    truth = by_numba(fine)(sample) if here else by_engine(fine, "fused")(sample)
    for executor in executors:
        run = by_engine(job, executor)
        call = functools.partial(run, job.speeds)
        name = f"engine, {executor}, {WORKERS} workers"
        candidates.append(Candidate(name, call, error(run(sample), truth)))
    return table(title, interleave(candidates, rounds), [] if here else ["numba"])


def main(size: str = "normal") -> Iterator[str]:
    """Tables as they come; `size`: "quick", "normal" (every tenth lane) or "full" (fused only)."""
    share = {"quick": 40, "normal": 10, "full": 1}[size]
    rounds = {"quick": 2, "normal": 3, "full": 1}[size]
    executors = ("fused",) if size == "full" else ("fused", "portable")
    short: dict[str, Any] = {"transient": 20.0, "duration": 21.62} if size == "quick" else {}
    diagram = Job(lanes=2000 // share, **short)
    spectrum = Job(
        lanes=300 // share, modes=4, transient=10.0 if size == "quick" else 200.0,
        segments=40 if size == "quick" else 800,
    )  # fmt: skip
    head = "DOP853 with steps of {h:g}; error on 8 lanes up to v = {v:g}"
    words = head.format(h=diagram.h, v=SETTLED)
    yield comparison(
        f"Fig. 2.3: {diagram.lanes} belt speeds x {diagram.transient + diagram.duration:g}, {words}, "
        "of y against its size",
        diagram, engine_diagram, numba_diagram, 2, rounds, executors,
    )  # fmt: skip
    yield comparison(
        f"\nFig. 2.13: {spectrum.lanes} belt speeds, all exponents of y and {spectrum.modes} modes "
        f"over {spectrum.segments * spectrum.segment:g}, {words}, of an exponent",
        spectrum, engine_exponents, numba_exponents, 2, rounds, executors,
    )  # fmt: skip
