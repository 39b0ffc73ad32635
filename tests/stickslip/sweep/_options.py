"""Options of a sweep by single words, and the files of its store, for tests."""

import pathlib
from typing import Any

from stickslip.sweep import Compute, Labels, Storage

FREE = {"runs.jsonl", "lock"}  # files of a store that may differ between equal sweeps


def options(
    store: Any = None, *, executor="portable", workers=1, client=None, progress=False, part=None,
    chunk=None, shard=None, resume=True, hosts="alike", **labels: Any,
) -> dict[str, Any]:  # fmt: skip
    """Arguments of everything that sweeps; those that are not named are labels."""
    return {
        "store": Storage(store, chunk, shard, resume, hosts),
        "labels": Labels(**labels),
        "compute": Compute(executor, workers, client, progress),
        **({} if part is None else {"part": part}),
    }


def contents(path: pathlib.Path) -> dict[str, bytes]:
    """Every file of a store but its diary and its lock."""
    return {
        str(p.relative_to(path)): p.read_bytes()
        for p in sorted(path.rglob("*"))
        if p.is_file() and p.name not in FREE
    }
