"""Many synthetic cases, each a row of numbers: kept on disk, on several processes if wished."""

import concurrent.futures
import functools
import hashlib
import importlib
import json
import multiprocessing
import os
import pathlib
import shutil
import zipfile
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from stickslip.progress import Progress
from stickslip.sweep import as_json

from .._experiment import Context

Case = dict[str, Any]
One = Callable[[dict[str, Any], int], Case]
NOT_OF_A_CASE = ("count", "workers")


def many(name: str, one: One, parameters: dict[str, Any], context: Context, block: int) -> Case:
    """`one(parameters, number)` of all numbers below `parameters["count"]`, stacked by name.

    Blocks of cases are kept below `context.stores`, so that the same command goes on where it was
    stopped, and more cases cost only what is new. A case knows its number alone, so that neither the
    blocks nor the processes, `parameters["workers"]` of them, have a say. `one` is a function of a
    module: the other processes import it.
    """
    folder = context.stores / name / _digest(parameters)
    if context.fresh:
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    count = parameters["count"]
    blocks = [(a, min(a + block, count)) for a in range(0, count, block)]
    todo = [part for part in blocks if _read(_path(folder, *part)) is None]
    tasks = [(one, parameters, first, last, folder) for first, last in todo]
    with Progress(name, len(blocks), len(blocks) - len(todo), things="blocks") as meter:
        for _ in _each(tasks, min(parameters["workers"], len(tasks))):
            meter.advance(1)
    rows = [_read(_path(folder, *part)) for part in blocks]
    return {key: np.concatenate([row[key] for row in rows if row]) for key in rows[0] or ()}


def _digest(parameters: dict[str, Any]) -> str:
    """Of the parameters, the version of JAX and the text of all that a case is made by."""
    kept = {key: value for key, value in parameters.items() if key not in NOT_OF_A_CASE}
    text = json.dumps([as_json(kept), jax.__version__, _sources()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@functools.cache
def _sources() -> str:
    """Digest of the modules of the three packages: a row made by another engine is another row."""
    total = hashlib.sha256()
    for name in ("stickslip", "corexy_jax", "experiments"):
        folder = pathlib.Path(importlib.import_module(name).__path__[0])
        for path in sorted(folder.rglob("*.py")):
            total.update(f"{name}/{path.relative_to(folder)}\n".encode() + path.read_bytes())
    return total.hexdigest()


def _path(folder: pathlib.Path, first: int, last: int) -> pathlib.Path:
    return folder / f"{first:05d}-{last:05d}.npz"


def _read(path: pathlib.Path) -> Case | None:
    try:
        with path.open("rb") as file, np.load(file) as found:
            return dict(found)
    except (OSError, ValueError, zipfile.BadZipFile):
        return None


def _each(tasks: list[Any], workers: int):
    if workers <= 1:
        yield from map(_work, tasks)
        return
    # A copy of a process that runs XLA's threads would hang.
    fresh = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(workers, fresh, _begin) as pool:
        waiting = [pool.submit(_work, task) for task in tasks]
        try:
            for future in concurrent.futures.as_completed(waiting):
                yield future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _begin() -> None:
    os.environ["STICKSLIP_PROGRESS"] = "off"  # the process that began this one counts
    if not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        from stickslip import enable_compilation_cache

        enable_compilation_cache()


def _work(task: Any) -> str:
    one, parameters, first, last, folder = task
    rows = [one(parameters, number) for number in range(first, last)]
    path = _path(folder, first, last)
    part = path.with_suffix(f".{os.getpid()}.part")
    with part.open("wb") as file:
        found: Any = {key: np.stack([np.asarray(row[key]) for row in rows]) for key in rows[0]}
        np.savez(file, **found)
    os.replace(part, path)
    return path.stem


def covered(low: np.ndarray, high: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Which intervals hold the truth; one that is not known does not."""
    return (low <= truth) & (truth <= high)
