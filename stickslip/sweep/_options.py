"""The options that all sweeps have, checked."""

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Any

import jax

from .._paths import DIRECTORY, the_directory
from .._validation import (
    check_count,
    check_flag,
    check_in,
    check_mapping,
    check_text,
    check_type,
)
from ._layout import Variable
from .grid import CHUNK
from .lanes import EXECUTORS


@dataclasses.dataclass(frozen=True)
class Options:
    """How a sweep is computed, labelled and kept; `run_sweep` says what each means."""

    name: str
    variables: Mapping[str, Variable]
    settings: Mapping[str, Any]
    attrs: Mapping[str, Any]
    path: pathlib.Path | None
    chunk: int
    shard: int | None
    resume: bool
    progress: bool | None
    executor: str
    workers: int | None
    hosts: str


def checked_options(
    *, name: Any, variables: Any, settings: Any, attrs: Any, store: Any, chunk: Any, shard: Any,
    resume: Any, progress: Any, executor: Any, workers: Any, hosts: Any,
) -> Options:  # fmt: skip
    """The options as they are used; `ValueError` or `TypeError` naming the one that is wrong."""
    check_text("name", name)
    check_type("progress", progress, bool | None, "True, False or None")
    variables, settings, attrs = (
        check_mapping(key, value)
        for key, value in (("variables", variables), ("settings", settings), ("attrs", attrs))
    )
    for key, label in variables.items():
        check_type(f"variables[{key!r}]", label, Variable, "a Variable")
    check_flag("resume", resume)
    for key, value in (("chunk", chunk), ("shard", shard), ("workers", workers)):
        if value is not None:
            check_count(key, value, 1)
    check_in("executor", executor, EXECUTORS)
    check_in("hosts", hosts, ("alike", "any"))
    path = None if store is None else the_directory("store", store, f"{DIRECTORY}, or None")
    if chunk is None:
        chunk = CHUNK if jax.default_backend() == "cpu" else 16 * CHUNK
    return Options(
        name, variables, settings, attrs, path, chunk, shard, resume, progress, executor, workers, hosts
    )
