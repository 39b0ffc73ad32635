"""The results in a store as a dataset; only blocks with a valid checksum are shown."""

import os
import pathlib
from collections.abc import AsyncIterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from zarr.storage import LocalStore, WrapperStore

from ._files import checksum, read_json
from ._layout import DATA, Files, record_file
from ._manifest import fault_of, identity
from ._records import is_record, made_by, record, recorded_units

BY_AGE = "by size and age"
_ASK = "it must be as run_sweep left it, or read unverified with verify=False"


class _Vouched(WrapperStore):
    """Files of a zarr store out of a set of names; all others are as if they were not there."""

    def __init__(self, store: Any, names: frozenset[str] = frozenset()):
        super().__init__(store)
        self._names = names
        self._tops = {name.partition("/")[0] for name in names}

    def _with_store(self, store: Any) -> "_Vouched":
        return type(self)(store, self._names)

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        return await super().get(key, prototype, byte_range) if key in self._names else None

    async def exists(self, key: str) -> bool:
        return key in self._names and await super().exists(key)

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:
        async for name in super().list_dir(prefix):
            if prefix.strip("/") or name in self._tops:
                yield name


def open_store(path: pathlib.Path, verify: bool) -> tuple[xr.Dataset, Any]:
    """The results in one store, and its manifest, as far as there is one."""
    begin = f"path = {str(path)!r}"
    manifest: Any = None
    try:
        manifest = read_json(path / "manifest.json")
        why = fault_of(manifest)
    except FileNotFoundError:
        why = "has no manifest.json"
    except ValueError as error:
        why = f"has an unreadable manifest.json ({error})"
    if verify:
        if why is not None:
            raise ValueError(f"{begin} {why}: {_ASK}.")
        state, names = _verified_files(begin, path, manifest)
        return _dataset(begin, path, state, "yes", names), manifest
    state = "unknown" if why is not None else _recorded_files(path, manifest)
    return _dataset(begin, path, state, "no", None), manifest if why is None else None


def dataset_so_far(path: pathlib.Path, manifest: Mapping[str, Any]) -> xr.Dataset:
    """The dataset of a store whose units were looked at or written a moment ago, if they are there."""
    names, there = list(manifest["files"]), recorded_units(path)
    for number, own in Files(manifest).blocks():
        names += own if number in there else []
    return _dataset(f"store = {str(path)!r}", path, _recorded_files(path, manifest), BY_AGE, names)


def _recorded_files(path: pathlib.Path, manifest: Mapping[str, Any]) -> str:
    total = Files(manifest).total
    return _state(sum(number < total for number in recorded_units(path)), total)


def _state(done: int, total: int) -> str:
    return "finished" if done == total else f"unfinished: {done} of {total} blocks"


def _verified_files(
    begin: str, path: pathlib.Path, manifest: Mapping[str, Any]
) -> tuple[str, list[str]]:
    """State of the store and the files with a checksum; `ValueError` naming the first damaged one."""

    def damage(file: str) -> ValueError:
        what = "is not as it was written" if os.path.lexists(path / file) else "is missing"
        return ValueError(f"{begin} is damaged, {file} {what}: {_ASK}; the same sweep repairs most.")

    names = []
    for file, sum_ in manifest["files"].items():
        if checksum(path / file) != sum_:
            raise damage(file)
        names.append(file)
    sweep, wanted, done = identity(manifest), Files(manifest), 0
    for number, files in wanted.blocks():
        own = record_file(number)
        try:
            value = read_json(path / own)
        except FileNotFoundError:
            continue
        except ValueError:
            raise damage(own) from None
        now = record(path, sweep, number, files, manifest["format"], made_by(value))
        if not is_record(value) or value.keys() != now.keys():
            raise damage(own)
        if value != now:
            sums = value["files"]
            bad = [file for file in files if sums.get(file) != now["files"][file]]
            raise damage((bad or [own])[0])
        names += files
        done += 1
    return _state(done, wanted.total), names


def _dataset(begin: str, path: pathlib.Path, state: str, verified: str, names: Any) -> xr.Dataset:
    store: Any = LocalStore(path / DATA, read_only=True)
    if names is not None:
        store = _Vouched(store, frozenset(name.removeprefix(f"{DATA}/") for name in names))
    try:
        # Nothing is decoded: a result in units of "days" is a number like any other.
        dataset = xr.open_zarr(store, chunks=None, consolidated=False, zarr_format=3, decode_cf=False)
    except Exception as error:  # whatever zarr meets in files that nobody has verified
        text = " ".join(str(error).split())[:80]
        raise ValueError(
            f"{begin} cannot be read ({type(error).__name__}: {text}): it must have whole headers."
        ) from error
    # The axis of an orbit diagram over several sections has their names, which a store keeps as an
    # attribute: its arrays are numbers.
    names = [str(name) for name in np.atleast_1d(dataset.attrs.get("sections", []))]
    if names and dataset.sizes.get("section") == len(names):
        dataset = dataset.assign_coords(section=names)
    return dataset.assign_attrs(sweep_state=state, sweep_verified=verified)
