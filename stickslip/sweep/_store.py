"""A directory that holds a sweep: finished blocks in zarr, each with a checksum.

    STORE/manifest.json      what the sweep is, sealed, with checksums of headers and coordinates;
                             written before anything else
    STORE/data.zarr/         the results, zarr format 3, one file per unit and variable
    STORE/finished/0007.json checksums of the files of unit 7; written after them, in one rename
    STORE/runs.jsonl         when and by what it was worked on; free to differ between equal stores
    STORE/lock               held while somebody works on it; freed by the system if he is killed
    STORE/refined/           further points that follow from the results, see `_children`

A unit is a block or a shard of whole blocks. It counts as finished if its record exists and every file
has the checksum recorded. So a run may be killed between any two instructions: units without a valid
checksum are computed again. Headers and coordinates follow from the sweep, so that lost ones are
written again. Nothing else is ever removed.

Every file is made in memory and put in place by a rename. So whoever writes the same unit at the same
time, against all rules, writes the same bytes, and no one reads half of them.
"""

import contextlib
import errno
import json
import os
import pathlib
import re
import secrets
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import zarr

from ._children import REFINED, children
from ._files import checksum, checksum_of, link_above, read_json, write_whole
from ._layout import DATA, Encoder, Files, Layout, chunk_file, record_file
from ._manifest import as_stored, differences, fault_of, identity, is_manifest, with_checksum
from ._records import Looked, record_of, recorded_units
from .grid import Block

try:
    import fcntl
except ImportError:  # no advisory locks on this system
    fcntl = None

CLAIMS = "claims"  # an empty folder of stores that were made by workers of earlier versions
_OURS = {
    "manifest.json", "manifest.json.damaged", DATA, "finished", "runs.jsonl", "lock", CLAIMS, REFINED
}  # fmt: skip
_BEFORE_MANIFEST = re.compile(r"lock|manifest\.json(\.[0-9a-f]+)?\.part")
_READ_ONLY = (errno.EROFS, errno.EACCES, errno.EPERM)
_ELSE = "Use another store, or replace this one with resume=False."


class SweepMismatchError(ValueError):
    """The store holds another sweep than the one asked for; the message names each difference."""


class SweepWriteError(OSError):
    """Results could not be written; the message says what is kept and what to do."""


class Store:
    """Units of a sweep on disk. Use as a context: the lock is held inside it.

    `shared`: with others, each of whom computes a part; they share the lock.
    """

    def __init__(
        self, path: pathlib.Path, layout: Layout, manifest: dict[str, Any], *, shared: bool = False
    ):
        self.path = path
        self.layout, self.manifest = layout, manifest
        self.shared = shared
        # Distinguishes what each of them writes. Who is alone writes over what he left half written.
        self._mark = secrets.token_hex(4) if shared else ""
        self._by = manifest["computed_with"] if manifest.get("hosts") == "any" else None
        self._lock: int | None = None
        self._arrays: dict[str, zarr.Array] = {}
        self._encoder: Encoder | None = None
        self._looked: Looked | None = None
        self._identity = ""

    def __enter__(self) -> "Store":
        if self.path.exists() and not self.path.is_dir():
            raise ValueError(f"store = {str(self.path)!r} is a file: it must be a directory.")
        self._check_ours()
        with self._writing("make the directory"):
            self.path.mkdir(parents=True, exist_ok=True)
        with self._writing("open the lock"):
            self._lock = _open_lock(self.path / "lock")
        if fcntl is not None and self._lock is not None:
            try:
                kind = fcntl.LOCK_SH if self.shared else fcntl.LOCK_EX
                fcntl.flock(self._lock, kind | fcntl.LOCK_NB)
            except OSError as error:
                if error.errno in (errno.EAGAIN, errno.EACCES):
                    self.__exit__()
                    raise ValueError(
                        f"store = {str(self.path)!r} is being worked on by another process: it must "
                        "be another store, or wait until that one has ended."
                    ) from None
                if not self.shared:
                    self.__exit__()
                    raise
                # Not every network file system knows locks, and parts do not need them.
        return self

    def __exit__(self, *_: object) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _check_ours(self) -> None:
        """Raise for a directory that is neither new nor a store: its files may be somebody's work."""
        if not self.path.is_dir() or os.path.lexists(self.path / "manifest.json"):
            return
        names = {p.name for p in self.path.iterdir() if not _BEFORE_MANIFEST.fullmatch(p.name)}
        if names - _OURS:
            raise ValueError(
                f"store = {str(self.path)!r} holds something else ({sorted(names - _OURS)[:3]}): "
                "it must be a sweep's store, an empty directory or a new one."
            )
        if names and not self._is_proven():
            raise ValueError(
                f"store = {str(self.path)!r} holds {', '.join(sorted(names))} and has lost its "
                "manifest.json: it must be a whole store, an empty directory or a new one; put the "
                "manifest back, or remove the directory by hand."
            )

    def open(self, *, resume: bool) -> None:
        """Make the store, or check that it holds this very sweep.

        With `resume=False` the sweep that it held is removed first, and no file but those of a sweep.
        """
        self._check_ours()
        stored, why = None, None
        try:
            stored = read_json(self.path / "manifest.json")
        except FileNotFoundError:
            pass
        except ValueError as error:
            why = f"has an unreadable manifest.json ({error})"
        else:
            why = fault_of(stored)
        if (why is not None or stored is None) and self._is_proven():
            self._set_aside("manifest.json")
            stored, why = self._set_up(self.manifest), None
        if why is not None and not is_manifest(stored):
            # Nothing says whose files these are, so not even resume=False may remove them.
            raise ValueError(
                f"store = {str(self.path)!r} {why}: it must be a whole store, an empty directory or a "
                "new one; put the manifest back, or remove the directory by hand."
            )
        if stored is not None and not resume:
            self._remove(stored)
            stored = None
        elif why is not None:
            raise SweepMismatchError(f"store = {str(self.path)!r} {why}. {_ELSE}")
        if stored is None:
            self._set_up(self.manifest)
        else:
            self._resume(stored)
        self._identity = identity(self.manifest)
        self._encoder = None
        self._looked = Looked(
            self.path, self._identity, self.manifest["format"], folders=not self.shared
        )
        if not self.shared:
            self._remove_half_written()
        group = zarr.open_group(self.path / DATA, mode="r+")
        # Without this a chunk that equals the fill value is not a file, and could not have a checksum.
        with zarr.config.set({"array.write_empty_chunks": True}):
            self._arrays = {name: _array(group, name) for name in self.layout.outputs}

    def _resume(self, stored: dict[str, Any]) -> None:
        """Take up the sweep in the store; put lost headers and coordinates back, and new labels in."""
        self.manifest = as_stored(self.manifest, stored)
        found = differences(stored, self.manifest)
        if found:
            raise SweepMismatchError(
                f"store = {str(self.path)!r} holds another sweep: " + "; ".join(found) + f". {_ELSE}"
            )
        if stored["host_code"]:
            raise SweepMismatchError(
                f"store = {str(self.path)!r} holds a sweep whose function calls the host "
                f"({', '.join(stored['host_code'])}), and what the host does has no digest to compare. "
                f"{_ELSE}"
            )
        attributes = stored["attributes"] if self.shared else self.manifest["attributes"]
        bad = [name for name, sum_ in stored["files"].items() if checksum(self.path / name) != sum_]
        if bad or stored["attributes"] != attributes:
            if _sums(self.layout.skeleton(stored["attributes"])) != stored["files"]:
                what = f"has a damaged {bad[0]}" if bad else "has other labels"
                raise SweepMismatchError(
                    f"store = {str(self.path)!r} {what}, and was made with another version of zarr, "
                    f"so that it cannot be written anew. {_ELSE}"
                )
            self._set_up({**stored, "attributes": attributes})
        else:
            self.manifest = stored

    def _set_up(self, manifest: dict[str, Any]) -> dict[str, Any]:
        """Write the manifest, then every header and coordinate that is not as it says."""
        files = self.layout.skeleton(manifest["attributes"])
        with self._writing("write headers and coordinates"):
            self.manifest = with_checksum({**manifest, "files": _sums(files)})
            text = json.dumps(self.manifest, indent=1) + "\n"
            write_whole(self._free("manifest.json"), text, self._mark)
            for name, data in files.items():
                if checksum(self.path / name) != self.manifest["files"][name]:
                    write_whole(self._free(name), data, self._mark)
        return self.manifest

    def _is_proven(self) -> bool:
        """Whether records and headers show that this is the very sweep, without its manifest."""
        if self.manifest["host_code"]:
            return False
        wanted = identity(self.manifest)
        if not any(_sweep_of(path) == wanted for path in (self.path / "finished").glob("*.json")):
            return False
        sums = _sums(self.layout.skeleton(self.manifest["attributes"]))
        return all(checksum(self.path / name) == sum_ for name, sum_ in sums.items())

    def _set_aside(self, name: str) -> None:
        """Keep a file that is not ours, or no longer, under another name."""
        path = self.path / name
        if path.is_file() and not path.is_symlink():
            with self._writing(f"set {name} aside"):
                os.replace(path, path.with_name(name + ".damaged"))

    def _free(self, name: str) -> pathlib.Path:
        """Path of a file about to be written, in directories that exist and lie in the store."""
        path = self.path / name
        link = link_above(path, self.path)
        if link is not None:
            raise OSError(errno.ELOOP, "a symbolic link leads out of the store", str(link))
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir() and not path.is_symlink():
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        return path

    def _remove(self, stored: dict[str, Any]) -> None:
        """Remove the files of the sweep and directories that are empty then; follow no link."""
        try:
            files = Files(stored)
        except (AttributeError, KeyError, TypeError, ValueError, ZeroDivisionError):
            return  # altered: its files stay, and no record of theirs counts in another sweep
        with self._writing("remove the sweep"):
            for step in children(self.path):
                self._remove_step(step)
            for top in (DATA, "finished"):
                if (self.path / top).is_symlink():
                    raise OSError(errno.ELOOP, "a symbolic link leads out of the store", top)
                for folder, _, names in os.walk(self.path / top, topdown=False):
                    for path in (pathlib.Path(folder, name) for name in names):
                        if files.has(path.relative_to(self.path).as_posix()):
                            path.unlink()
                    with contextlib.suppress(OSError):
                        os.rmdir(folder)

    def _remove_step(self, path: pathlib.Path) -> None:
        """Remove a step of a refinement, unless somebody works on it; no file of others in it."""
        try:
            stored = read_json(path / "manifest.json")
        except (OSError, ValueError):
            return
        if not is_manifest(stored):
            return
        with Store(path, self.layout, self.manifest) as step:
            step._remove(stored)
        for name in ("manifest.json", "manifest.json.damaged", "runs.jsonl", "lock", f"{CLAIMS}/clock"):
            (path / name).unlink(missing_ok=True)
        for folder in (path / CLAIMS, path, path.parent):
            with contextlib.suppress(OSError):
                os.rmdir(folder)

    @contextlib.contextmanager
    def _writing(self, what: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            file = error.filename2 or error.filename
            at = f" ({os.fsdecode(file)})" if isinstance(file, str | bytes) else ""
            raise SweepWriteError(
                error.errno or errno.EIO,
                f"could not {what} in store {str(self.path)!r}: {error.strerror or error}{at}. "
                f"{self.count_finished()} finished blocks are kept; remove the cause (space, "
                "permissions) and run the same sweep again to go on from there",
            ) from error

    def count_finished(self) -> int:
        """Number of units that have a record."""
        return len(recorded_units(self.path))

    def _chunks(self, unit: Block) -> list[str]:
        return [
            chunk_file(name, unit.place, len(tail))
            for name, (tail, _, _) in self.layout.outputs.items()
        ]

    def is_finished(self, unit: Block) -> bool:
        """Whether the unit is recorded and all its files are as they were written."""
        assert self._looked is not None
        return self._looked.is_finished(unit.number, self._chunks(unit))

    def write(self, unit: Block, values: Mapping[str, np.ndarray], by: Any = None) -> None:
        """Results of a unit, then its record; `by`: what computed it, if not this host."""
        if self._encoder is None:
            self._encoder = self.layout.encoder()
        files = self._encoder(unit, values)
        with self._writing(f"write block {unit.number}"):
            path = self._free(record_file(unit.number))
            targets = [(self._free(name), data) for name, data in files.items()]
            for target, data in targets:
                write_whole(target, data, self._mark)
            by = self._by if by is None else by
            record = record_of(self._identity, unit.number, files, self.manifest["format"], by)
            write_whole(path, json.dumps(record, indent=1) + "\n", self._mark)

    def _remove_half_written(self) -> None:
        """Files that processes which computed a part and were killed have left."""
        files = Files(self.manifest)
        for top in (DATA, "finished"):
            for folder, _, names in os.walk(self.path / top):
                for path in (pathlib.Path(folder, name) for name in names if name.endswith(".part")):
                    if files.has(path.relative_to(self.path).as_posix()):
                        with contextlib.suppress(OSError):
                            path.unlink()

    def interruption(self, meter: Any) -> str:
        """Words for what an interruption leaves."""
        return (
            f"interrupted: {self.count_finished()} of {Files(self.manifest).total} blocks are kept in "
            f"store {str(self.path)!r}, and the same call goes on from there"
        )

    def read(self, name: str, region: tuple[Any, ...]) -> np.ndarray:
        """Part of a variable."""
        return np.asarray(self._arrays[name][region])

    def log(self, **entry: Any) -> None:
        """Add a line to the diary of runs."""
        entry = {"time": time.strftime("%Y-%m-%dT%H:%M:%S%z"), **entry}
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
        with self._writing("write the diary"):
            with open(os.open(self.path / "runs.jsonl", flags, 0o666), "a") as file:
                file.write(json.dumps(entry) + "\n")


def _sweep_of(path: pathlib.Path) -> Any:
    try:
        value = read_json(path)
    except (OSError, ValueError):
        return None
    return value.get("sweep") if isinstance(value, dict) else None


def _sums(files: Mapping[str, bytes]) -> dict[str, str]:
    return {name: checksum_of(data) for name, data in files.items()}


def _array(group: zarr.Group, name: str) -> zarr.Array:
    array = group[name]
    assert isinstance(array, zarr.Array)
    return array


def _open_lock(path: pathlib.Path) -> int | None:
    """The lock's file, made if lost; `None` where it is lost and nothing can be written."""
    keep = getattr(os, "O_NOFOLLOW", 0)
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | keep, 0o666)
    except OSError as error:
        if error.errno not in _READ_ONLY:
            raise
    # A finished store on a read-only file system can still be read.
    try:
        return os.open(path, os.O_RDONLY | keep)
    except OSError as error:
        if error.errno == errno.ENOENT or error.errno in _READ_ONLY:
            return None
        raise
