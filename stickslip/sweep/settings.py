"""How a sweep is kept and computed: objects that every function which sweeps takes by these names."""

import dataclasses
import os
import pathlib
import sys
from typing import Any, Literal, NamedTuple

from .._paths import DIRECTORY, the_directory
from .._types import Given, Path
from .._validation import check_count, check_flag, check_in, check_text, check_type, refusal
from ._labels import Labels
from .grid import block_lanes
from .lanes import EXECUTORS

DIRECTIONS = ("upwards", "downwards")


@dataclasses.dataclass(frozen=True)
class Storage:
    """Where results are kept, and in which pieces; `store="results"` means `Storage("results")`.

    - `path`: directory of results, made if absent; without one they are kept in memory.
    - `chunk`: lanes per block (default 4,096; 65,536 off the CPU; less for diagrams). Memory grows with
      it, not with the number of lanes.
    - `shard`: lanes per file, one block by default. A shard is computed block by block and written as a
      whole, so that an interruption loses what is computed of it. A sweep of a million lanes with
      `shard=2**18` is some ten files a variable instead of 245. Not with a carry.
    - `resume`: with `False` the sweep in the store is removed first, and no other file in it.
    - `hosts`: which hosts may compute for a store. With `"alike"` a host that uses another executor,
      backend, jax or jaxlib raises an error that names it; with `"any"` the record of each block says
      what computed it. Another program, also one that another jax makes of the same function, always
      raises an error.

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    path: Path | None = None
    chunk: Given[int | None] = None
    shard: Given[int | None] = None
    resume: Given[bool] = True
    hosts: Given[Literal["alike", "any"]] = "alike"

    def __post_init__(self):
        if self.path is not None:
            the_directory("path", self.path, f"{DIRECTORY}, or None")
        for name in ("chunk", "shard"):
            if getattr(self, name) is not None:
                check_count(name, getattr(self, name), 1)
        check_flag("resume", self.resume)
        check_in("hosts", self.hosts, ("alike", "any"))

    @property
    def directory(self) -> pathlib.Path | None:
        """The store's place."""
        return None if self.path is None else the_directory("path", self.path)

    def in_chunks(self, chunk: int) -> "Storage":
        """The same with so many lanes per block, unless it says how many."""
        return self if self.chunk is not None else dataclasses.replace(self, chunk=chunk)

    @property
    def lanes(self) -> int:
        """Lanes per block."""
        if self.chunk is not None:
            return self.chunk
        return block_lanes()


@dataclasses.dataclass(frozen=True)
class Compute:
    """With what a sweep is computed.

    - `executor`: `"auto"`, `"fused"` or `"portable"`, as for `map_lanes`.
    - `workers`: devices or, with a single CPU device, threads to use; by default all. With a `client`
      the threads of each task, by default one.
    - `client`: a `Client` of Dask distributed, whose workers compute the blocks: `Client()` starts some
      on this host. Blocks of a worker that is lost are computed by another. This process alone writes
      the store, which the workers need not see; functions travel by cloudpickle.
    - `progress`: a line on stderr with rate and time left; by default from the third second on, True at
      once, False never.

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    executor: Given[Literal["auto", "fused", "portable"]] = "auto"
    workers: Given[int | None] = None
    client: Given[Any] = None
    progress: Given[bool | None] = None

    def __post_init__(self):
        check_in("executor", self.executor, EXECUTORS)
        if self.workers is not None:
            check_count("workers", self.workers, 1)
        check_type("progress", self.progress, bool | None, "True, False or None")
        # Whoever has a client has imported its package, which takes longer than all of ours.
        distributed = sys.modules.get("distributed")
        if self.client is not None and not (
            distributed is not None and isinstance(self.client, distributed.Client)
        ):
            raise refusal("client", self.client, "a Client of Dask distributed, or None", TypeError)

    @property
    def threads(self) -> int | None:
        """Number that `map_lanes` takes as `workers`."""
        return 1 if self.workers is None and self.client is not None else self.workers


@dataclasses.dataclass(frozen=True)
class Carried:
    """Each run starts from the end of its neighbour, which shows hysteresis.

    - `direction`: `"upwards"` or `"downwards"`, from the neighbour below or above.
    - `along`: the parameter; None takes the first one of the grid.

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    direction: Given[Literal["upwards", "downwards"]] = "upwards"
    along: Given[str | None] = None

    def __post_init__(self):
        check_in("direction", self.direction, DIRECTIONS)
        if self.along is not None:
            check_text("along", self.along)


class Settings(NamedTuple):
    """All of this for one sweep, checked."""

    storage: Storage
    labels: Labels
    compute: Compute
    part: tuple[int, int] | None
    name: str


def settings_of(
    store: Any = None, labels: Any = None, compute: Any = None, part: Any = None, name: str = "sweep"
) -> Settings:
    """The settings as they are used; `ValueError` or `TypeError` naming the one that is wrong."""
    if isinstance(store, str | os.PathLike):
        the_directory("store", store)
        store = Storage(store)
    store = Storage() if store is None else store
    check_type("store", store, Storage, f"{DIRECTORY}, a Storage, or None")
    labels = check_type("labels", Labels() if labels is None else labels, Labels, "a Labels, or None")
    compute = Compute() if compute is None else compute
    check_type("compute", compute, Compute, "a Compute, or None")
    if part is not None:
        _check_part(part, store)
    return Settings(store, labels, compute, part, name if labels.name is None else labels.name)


def _check_part(part: Any, store: Storage) -> None:
    allowed = "a pair (i, n) of integers with 0 <= i < n"
    if not isinstance(part, tuple) or len(part) != 2:
        raise refusal("part", part, allowed, TypeError)
    check_count("part[1]", part[1], 1)
    check_count("part[0]", part[0], 0, part[1] - 1)
    if store.path is None or not store.resume:
        raise refusal("part", part, "unset without a store that others may complete")
