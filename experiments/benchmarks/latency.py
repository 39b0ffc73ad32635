"""How long until the first result: imports, tracing, compiling; beside diffrax in the same run.

Each program runs in a process of its own, one after the other, in turns. Instructions of the
compiled program are exact counts; seconds move with whatever else the machine does.
"""

import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile

from . import _latency_child

IMPORTS = {
    "import jax, equinox, diffrax": "jax,equinox,diffrax",
    "import stickslip": "stickslip",
    "import corexy_jax": "corexy_jax",
}
PROGRAMS = {
    "block_diffrax": "block on belt, diffrax Dopri8, 1e-10",
    "block": "block on belt",
    "block_section": "block on belt, a recorded section",
    "stick_slip": "stick-slip oscillator",
    "stick_slip_jacfwd": "stick-slip oscillator, jacfwd",
    "stick_slip_grad": "stick-slip oscillator, grad",
    "corexy": "CoreXY, consistent",
    "corexy_jvp": "CoreXY, jvp by one parameter",
}
KINDS = {
    "call": "plain calls, programs kept on disk",
    "load": "programs of `export`, kept on disk when compiled",
}
CACHED = ("stick_slip", "corexy")  # once more by a second process with a warm cache


def _child(*words: str, **environment: str) -> dict[str, float]:
    """What `_latency_child` prints."""
    # One device and no cache but the one asked for, as for somebody who has just installed it.
    clean = {k: v for k, v in os.environ.items() if k not in ("XLA_FLAGS", "JAX_COMPILATION_CACHE_DIR")}
    command = [sys.executable, "-m", _latency_child.__name__, *words]
    run = subprocess.run(command, capture_output=True, text=True, env=clean | environment, check=False)
    if run.returncode:
        raise RuntimeError(f"{' '.join(words)}: {run.stderr.strip().splitlines()[-1]}")
    return json.loads(run.stdout.splitlines()[-1])


def _median(rows: list[dict[str, float]]) -> dict[str, float]:
    return {key: statistics.median(row[key] for row in rows) for key in rows[0]}


def main(size: str = "normal") -> str:
    """Table: seconds of imports; seconds to trace, to compile and to the first result; size; runs."""
    rounds = {"quick": 1, "normal": 3, "full": 5}[size]
    names = ("block_diffrax", "block", "stick_slip") if size == "quick" else tuple(PROGRAMS)
    warm = [name for name in CACHED if name in names]
    imports: dict[str, list] = {}
    programs: dict[str, list] = {}
    calls: dict[tuple[str, str, bool], list] = {}
    with tempfile.TemporaryDirectory() as cache:
        for number in range(rounds):
            for name, modules in IMPORTS.items():
                imports.setdefault(name, []).append(_child("import", modules))
            for name in names:
                programs.setdefault(name, []).append(_child("program", name))
            for name in warm:
                for kind in KINDS:
                    found = _child(kind, name, STICKSLIP_CACHE=cache)
                    calls.setdefault((kind, name, number > 0), []).append(found)
        for kind, name in itertools.product(KINDS, warm):
            found = _child(kind, name, STICKSLIP_CACHE=cache)
            calls.setdefault((kind, name, True), []).append(found)
    lines = [f"Time to the first result, seconds, medians of {rounds}", _row("", "import", "ratio")]
    peer = _median(next(iter(imports.values())))["import"]
    for name, rows in imports.items():
        own = _median(rows)["import"]
        lines.append(_row(name, f"{own:.2f}", f"{own / peer:.2f}"))
    lines.append(_row("compiled by jax.jit", "trace", "compile", "first", "next", "instr."))
    for name, rows in programs.items():
        row = _median(rows)
        times = [f"{row[key]:.2f}" for key in ("trace", "compile", "first")]
        lines.append(_row(PROGRAMS[name], *times, f"{row['next']:.4f}", f"{row['size']:.0f}"))
    for kind, title in KINDS.items():
        lines.append(_row(title, "", "", "first", "next"))
        for (own, name, again), rows in calls.items():
            if own == kind:
                label = f"{PROGRAMS[name]}, {'another process' if again else 'empty folder'}"
                row = _median(rows)
                lines.append(_row(label, "", "", f"{row['first']:.2f}", f"{row['next']:.4f}"))
    return "\n".join(lines)


def _row(label: str, *words: str) -> str:
    return f"  {label:50s} " + " ".join(f"{word:>9s}" for word in words)
