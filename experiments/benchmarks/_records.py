"""Records of benchmarks that lie in the repository, and the page written from them."""

import importlib.metadata
import json
import os
import pathlib
import platform
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

from stickslip.sweep import versions

from .._output import write_record

FOLDER = pathlib.Path(__file__).parent / "records"
PAGE = FOLDER.parent / "RESULTS.md"
PEERS = ("numba", "heyoka", "xpplab")
HEAD = """\
# Benchmarks

Written by `python -m experiments.benchmarks results` from the records in
`experiments/benchmarks/records`; a test compares the two. `make bench` runs all of them,
`python -m experiments.benchmarks NAME --record` keeps the tables of one. Ratios within a table are of
candidates that took turns; seconds move with whatever else the machine does, which `load` shows.
"""


def record(
    name: str, size: str, parts: list[str], seconds: float, load: float, revision: str | None
) -> dict[str, Any]:
    """What is kept of a benchmark: its tables, the machine and the versions."""
    used = versions()
    for peer in PEERS:
        try:
            used[peer] = importlib.metadata.version(peer)
        except importlib.metadata.PackageNotFoundError:
            used[peer] = "absent"
    return {
        "name": name,
        "size": size,
        "tables": "\n".join(parts).strip("\n"),
        "machine": platform.machine(),
        "cpu_count": os.cpu_count(),
        "load": load,
        "versions": used,
        "code_revision": revision,
        "date": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "seconds": round(seconds, 1),
    }


def keep(entry: Mapping[str, Any], folder: pathlib.Path = FOLDER) -> pathlib.Path:
    """Write a record."""
    folder.mkdir(exist_ok=True)
    return write_record(dict(entry), folder / f"{entry['name']}.json")


def page(benchmarks: Mapping[str, Callable], folder: pathlib.Path = FOLDER) -> str:
    """The whole page."""
    parts, missing = [HEAD], []
    for name, main in benchmarks.items():
        path = folder / f"{name}.json"
        if not path.exists():
            missing.append(name)
            continue
        entry = json.loads(path.read_text(encoding="utf-8"))
        words = (sys.modules[main.__module__].__doc__ or "").strip()
        option = {"quick": " --quick", "full": " --full"}.get(entry["size"], "")
        used = ", ".join(f"{key} {value}" for key, value in entry["versions"].items())
        parts.append(
            f"## {name}\n\n{words}\n\n`python -m experiments.benchmarks {name}{option}`, "
            f"{entry['seconds']:.0f} s on {entry['date'][:10]}: {entry['machine']}, "
            f"{entry['cpu_count']} cores, load {entry['load']:.1f} before; {used}; revision "
            f"{(entry['code_revision'] or 'unknown')[:10]}.\n\n```text\n{entry['tables']}\n```\n"
        )
    if missing:
        parts.append(f"Not run for this page: {', '.join(missing)}.\n")
    return "\n".join(parts)


def write(benchmarks: Mapping[str, Callable], path: pathlib.Path = PAGE) -> pathlib.Path:
    """Write the page; its path."""
    path.write_text(page(benchmarks), encoding="utf-8")
    return path
