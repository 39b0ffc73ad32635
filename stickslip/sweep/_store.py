"""A directory that holds a sweep: finished blocks in zarr, each vouched for by a checksum.

    STORE/manifest.json      what the sweep is; written last when the store is made
    STORE/data.zarr/         the results, zarr format 3, one chunk per block and variable
    STORE/finished/0007.json checksums of the files of block 7; written after them, in one rename
    STORE/runs.jsonl         when and by what it was worked on; free to differ between equal stores
    STORE/lock               held while somebody works on it; freed by the system if he is killed

A block counts as finished if its record exists and every file has the checksum recorded. So a run may
be killed between any two instructions: what it had not vouched for is computed again.
"""

import contextlib
import dataclasses
import errno
import hashlib
import json
import os
import pathlib
import shutil
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
import zarr

from .._validation import check_mapping, check_path, check_type, refusal
from ._grid import Block
from ._manifest import differences

try:
    import fcntl
except ImportError:  # no advisory locks on this system
    fcntl = None

_OURS = {"manifest.json", "data.zarr", "finished", "runs.jsonl", "lock"}
_FILL = {"f": np.nan, "c": np.nan, "i": -1, "u": 0, "b": False}


class SweepMismatchError(ValueError):
    """The store holds another sweep than the one asked for; the message names each difference."""


class SweepWriteError(OSError):
    """Results could not be written; the message says what is kept and what to do."""


@dataclasses.dataclass(frozen=True)
class Variable:
    """How a result of a lane is labelled.

    - `dims`: names of its axes after those of the grid, e.g. `("point",)`.
    - `units`, `long_name`: for axes of pictures and for readers of the file.
    - `attrs`: further attributes, e.g. `flag_values` and `flag_meanings` of a code.

    Errors: `TypeError` for what is no name, text or mapping.
    """

    dims: tuple[str, ...] = ()
    units: str | None = None
    long_name: str | None = None
    attrs: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        names = isinstance(self.dims, tuple) and all(isinstance(dim, str) for dim in self.dims)
        if not names:
            raise refusal("dims", self.dims, "a tuple of names of axes", TypeError)
        check_type("units", self.units, str | None, "a text or None")
        check_type("long_name", self.long_name, str | None, "a text or None")
        check_type("attrs", self.attrs, Mapping, "a mapping from names")
        check_mapping("attrs", self.attrs)

    def attributes(self) -> dict[str, Any]:
        """Attributes of the array in the dataset."""
        named = {"units": self.units, "long_name": self.long_name}
        return {k: v for k, v in named.items() if v is not None} | dict(self.attrs)


@dataclasses.dataclass(frozen=True)
class Layout:
    """Names, shapes and labels of everything in the store."""

    coords: Mapping[str, np.ndarray]
    outputs: Mapping[str, tuple[tuple[int, ...], np.dtype, Variable]]
    sides: tuple[int, ...]
    labels: Mapping[str, Variable]
    attrs: Mapping[str, Any]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(values.size for values in self.coords.values())

    def dims(self, name: str) -> tuple[str, ...]:
        return (*self.coords, *self.outputs[name][2].dims)


def _write_atomically(path: pathlib.Path, text: str) -> None:
    """All of `text` at `path`, or what was there before; also after a power cut."""
    temporary = path.with_name(path.name + ".part")
    with open(temporary, "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


class Store:
    """Blocks of a sweep on disk. Use as a context: the lock is held inside it."""

    def __init__(self, path: str | os.PathLike, layout: Layout, manifest: dict[str, Any]):
        self.path = pathlib.Path(path)
        self.layout, self.manifest = layout, manifest
        self._lock = None
        self._arrays: dict[str, zarr.Array] = {}

    def __enter__(self) -> "Store":
        known = self.path / "lock"
        if self.path.exists() and not self.path.is_dir():
            raise ValueError(f"store = {str(self.path)!r} is a file: it must be a directory.")
        if self.path.is_dir():
            names = {p.name.removesuffix(".part") for p in self.path.iterdir()}
            if names and (not known.exists() or names - _OURS):
                raise ValueError(
                    f"store = {str(self.path)!r} holds something else ({sorted(names - _OURS)[:3]}): "
                    "it must be a sweep's store, an empty directory or a new one."
                )
        with self._writing("make the store"):
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock = open(known, "a")  # kept open as long as it is held
        if fcntl is not None:
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                self._lock.close()
                if error.errno not in (errno.EAGAIN, errno.EACCES):
                    raise
                raise ValueError(
                    f"store = {str(self.path)!r} is being worked on by another process: it must be "
                    "another store, or wait until that one has ended."
                ) from None
        return self

    def __exit__(self, *_: object) -> None:
        if self._lock is not None:
            self._lock.close()

    def open(self, *, resume: bool) -> None:
        """Make the store, or check that it holds this very sweep.

        With `resume=False` whatever sweep it held is removed first.
        """
        path = self.path / "manifest.json"
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            stored = None
        except ValueError as error:
            raise SweepMismatchError(
                f"store = {str(self.path)!r} has an unreadable manifest ({error}): use another store, "
                "or replace this one with resume=False."
            ) from None
        if not resume:
            stored = None
        if stored is None:
            self._create()
            _write_atomically(path, json.dumps(self.manifest, indent=1) + "\n")
        else:
            found = differences(stored, self.manifest)
            if found:
                raise SweepMismatchError(
                    f"store = {str(self.path)!r} holds another sweep: " + "; ".join(found) + ". Use "
                    "another store, or replace this one with resume=False."
                )
        group = zarr.open_group(self.path / "data.zarr", mode="r+")
        self._arrays = {name: self._array(group, name) for name in self.layout.outputs}

    def _array(self, group: zarr.Group, name: str) -> zarr.Array:
        # Without this a chunk that equals the fill value is no file, and could not be vouched for.
        with zarr.config.set({"array.write_empty_chunks": True}):
            array = group[name]
        assert isinstance(array, zarr.Array)
        return array

    def _create(self) -> None:
        layout = self.layout
        with self._writing("make the store"):
            for name in ("manifest.json", "data.zarr", "finished"):
                path = self.path / name
                if path.is_dir():
                    shutil.rmtree(path)
                else:
                    path.unlink(missing_ok=True)
            (self.path / "finished").mkdir()
            group = zarr.create_group(
                self.path / "data.zarr", attributes=dict(layout.attrs), zarr_format=3
            )
            for name, values in layout.coords.items():
                label = layout.labels.get(name, Variable())
                group.create_array(
                    name, data=values, dimension_names=(name,), attributes=label.attributes()
                )
            for name, (tail, dtype, label) in layout.outputs.items():
                group.create_array(
                    name,
                    shape=(*layout.shape, *tail),
                    chunks=(*layout.sides, *(max(n, 1) for n in tail)),
                    dtype=dtype,
                    fill_value=_FILL[dtype.kind],
                    dimension_names=layout.dims(name),
                    attributes=label.attributes(),
                )

    @contextlib.contextmanager
    def _writing(self, what: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            finished = self.path / "finished"
            kept = len(list(finished.glob("*.json"))) if finished.is_dir() else 0
            raise SweepWriteError(
                error.errno or errno.EIO,
                f"could not {what} in store {str(self.path)!r}: {error.strerror or error}. "
                f"{kept} finished blocks are kept; put the cause right (space, permissions) and run "
                "the same sweep again to go on from there",
            ) from error

    def _record(self, block: Block) -> pathlib.Path:
        return self.path / "finished" / f"{block.number:06d}.json"

    def _file(self, name: str, block: Block) -> pathlib.Path:
        tail = len(self.layout.outputs[name][0])
        place = [str(i) for i in (*block.place, *(0,) * tail)]
        return self.path.joinpath("data.zarr", name, "c", *place)

    def is_finished(self, block: Block) -> bool:
        """Whether the block is recorded and all its files are as they were written."""
        try:
            recorded = json.loads(self._record(block).read_text(encoding="utf-8"))
            return recorded == {name: _checksum(self._file(name, block)) for name in self._arrays}
        except (OSError, ValueError):
            return False

    def write(self, block: Block, values: Mapping[str, np.ndarray]) -> None:
        """Results of a block, then its record."""
        with self._writing(f"write block {block.number}"):
            record = self._record(block)
            record.unlink(missing_ok=True)
            for name, array in self._arrays.items():
                # A block at the edge is merged with the chunk that is there, which may be damaged.
                self._file(name, block).unlink(missing_ok=True)
                with zarr.config.set({"array.write_empty_chunks": True}):
                    array[block.region] = values[name]
            sums = {name: _checksum(self._file(name, block)) for name in self._arrays}
            _write_atomically(record, json.dumps(sums, indent=1) + "\n")

    def read(self, name: str, region: tuple[Any, ...]) -> np.ndarray:
        """Part of a variable."""
        return np.asarray(self._arrays[name][region])

    def log(self, **entry: Any) -> None:
        """Add a line to the diary of runs."""
        entry = {"time": time.strftime("%Y-%m-%dT%H:%M:%S%z"), **entry}
        with self._writing("write the diary"), open(self.path / "runs.jsonl", "a") as file:
            file.write(json.dumps(entry) + "\n")


def _checksum(path: pathlib.Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def open_dataset(path: str | os.PathLike) -> xr.Dataset:
    """The results in a store, read from disk when they are used.

    Errors: `TypeError` for what is no path, `ValueError` where there is no store.
    """
    check_path("path", path, "the path of a directory")
    if not (pathlib.Path(path) / "data.zarr").is_dir():
        raise refusal("path", path, "the directory of a sweep, which holds data.zarr")
    return xr.open_zarr(
        pathlib.Path(path) / "data.zarr", chunks=None, consolidated=False, zarr_format=3
    )
