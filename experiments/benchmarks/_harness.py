"""Timing side by side: candidates take turns, and what counts is the ratio within a round."""

import dataclasses
import importlib.util
import os
import platform
import statistics
import time
from collections.abc import Callable

import jax


@dataclasses.dataclass
class Candidate:
    """One way to do the job. `share` is the part of the job that one call does."""

    name: str
    call: Callable[[], object]
    error: float | None = None
    share: float = 1.0
    rounds: int | None = None  # slow ones may sit out after this many
    error_t: float | None = None  # of times, where they are compared too
    compiled: bool = False  # already, whatever the number of lanes: needs no call to warm up


def absent(module: str) -> bool:
    """Whether an optional peer is not installed."""
    return importlib.util.find_spec(module) is None


def interleave(candidates: list[Candidate], rounds: int = 7) -> list[dict]:
    """Run the candidates in turn. The first is the reference of all ratios.

    Returns one row per candidate: best and median seconds for the whole job, and the median over the
    rounds of its time divided by the reference's in the same round; and the median of the seconds of
    processor time of all threads, which other programs on the machine disturb less.
    """
    for candidate in candidates:
        if not candidate.compiled:
            candidate.call()
    times: dict[str, list[float]] = {c.name: [] for c in candidates}
    processor: dict[str, list[float]] = {c.name: [] for c in candidates}
    for number in range(rounds):
        for c in candidates:
            if c.rounds is not None and number >= c.rounds:
                continue
            start, spent = time.perf_counter(), time.process_time()
            c.call()
            times[c.name].append((time.perf_counter() - start) / c.share)
            processor[c.name].append((time.process_time() - spent) / c.share)
    reference = times[candidates[0].name]
    return [
        dict(
            name=c.name,
            best=min(times[c.name]),
            median=statistics.median(times[c.name]),
            ratio=statistics.median(a / b for a, b in zip(times[c.name], reference, strict=False)),
            processor=statistics.median(processor[c.name]),
            error=c.error,
            error_t=c.error_t,
        )
        for c in candidates
    ]


def table(title: str, rows: list[dict], missing: list[str]) -> str:
    """Text table of `interleave`'s rows, with the peers that were not there."""
    names = ["error", "error t"] if any(row["error_t"] is not None for row in rows) else ["error"]
    head = " ".join(f"{word:>9s}" for word in ("best s", "median s", "CPU s", "ratio", *names))
    lines = [title, f"  {'':50s} {head}"]
    for row in rows:
        errors = [row["error"], row["error_t"]][: len(names)]
        words = ["" if error is None else f"{error:.1e}" for error in errors]
        times = " ".join(f"{row[key]:9.4f}" for key in ("best", "median", "processor"))
        figures = f"{times} {row['ratio']:9.2f} "
        lines.append(f"  {row['name']:50s} {figures}" + " ".join(f"{word:>9s}" for word in words))
    lines += [f"  {name}: absent, not measured" for name in missing]
    return "\n".join(lines)


def machine() -> str:
    """One line about where the numbers come from."""
    return (
        f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, Python "
        f"{platform.python_version()}, JAX {jax.__version__} on {jax.default_backend()}"
    )
