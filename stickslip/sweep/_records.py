"""Records of finished units: what vouches for their files, and when files are believed unread."""

import math
import os
import pathlib
import stat
from collections.abc import Mapping, Sequence
from typing import Any

from ._files import checksum, checksum_of, read_json
from ._layout import FINISHED, record_file
from ._manifest import BEFORE_SHARDS, with_checksum


def record(
    path: pathlib.Path, sweep: str, number: int, names: Sequence[str], kind: int, by: Any = None
) -> dict[str, Any]:
    """Record of a unit by its files as they are now: of which sweep, which one, and their checksums.

    `by`: what computed it, where hosts may differ.
    """
    sums = {name: checksum(path / name) for name in names}
    return _record(sweep, number, sums, {name: _size(path / name) for name in names}, kind, by)


def record_of(
    sweep: str, number: int, files: Mapping[str, bytes], kind: int, by: Any = None
) -> dict[str, Any]:
    """Record of a unit by what is written into its files."""
    sums = {name: checksum_of(data) for name, data in files.items()}
    return _record(sweep, number, sums, {name: len(data) for name, data in files.items()}, kind, by)


def made_by(value: Any) -> Any:
    """Software that computed a unit, by its record, where that says so."""
    return value.get(BY) if isinstance(value, dict) else None


def _record(sweep, number, sums, sizes, kind, by) -> dict[str, Any]:
    made = {"sweep": sweep, "block": number, "files": sums}
    if kind == BEFORE_SHARDS:
        return made
    return with_checksum({**made, "bytes": sizes, **({} if by is None else {BY: by})})


BY = "computed_with"


def recorded_units(path: pathlib.Path) -> set[int]:
    """Numbers of the units that have a record, whatever it is worth."""
    try:
        names = os.listdir(path / FINISHED)
    except OSError:
        return set()
    parts = (name.partition(".") for name in names)
    return {int(number) for number, _, end in parts if end == "json" and number.isdecimal()}


def is_record(value: Any) -> bool:
    """Whether this vouches for files: a record of files that are not there does not."""
    return (
        isinstance(value, dict)
        and isinstance(value.get("files"), dict)
        and all(isinstance(sum_, str) for sum_ in value["files"].values())
    )


class Looked:
    """Whether units are recorded and their files as they were written, most of them unread.

    A file of the size recorded that did not change since the record was written is believed; of all
    others the checksum is computed. A change of a file through the system shows in its time of change,
    which a program cannot set back; the decay of a disk does not show, and is what `verify_store` is
    for. A folder that changed after the last record may have been put there whole, with old files in
    it: they are read. While others write, that is so of every folder, and `folders=False` leaves it.
    """

    def __init__(self, path: pathlib.Path, sweep: str, kind: int, *, folders: bool):
        self.path, self.sweep, self.kind = path, sweep, kind
        self._folders: dict[pathlib.Path, bool] = {}
        self._last = None
        if folders:
            self._last = max((_time_of_change(p) for p in (path / FINISHED).glob("*.json")), default=0)

    def is_finished(self, number: int, names: Sequence[str]) -> bool:
        """Whether the unit counts, whose files have these names."""
        own = self.path / record_file(number)
        try:
            value = read_json(own)
        except (OSError, ValueError):
            return False
        if not is_record(value):
            return False
        sums, sizes = value["files"], value.get("bytes")
        if self.kind == BEFORE_SHARDS or not isinstance(sizes, dict) or os.name != "posix":
            return value == record(self.path, self.sweep, number, names, self.kind)
        if value != _record(self.sweep, number, sums, sizes, self.kind, made_by(value)):
            return False
        if not set(sums) == set(sizes) == set(names):
            return False
        written = _time_of_change(own)
        for name in names:
            path = self.path / name
            if _size(path) != sizes[name]:
                return False
            unread = _time_of_change(path) < written and self._is_old(path.parent)
            if not unread and checksum(path) != sums[name]:
                return False
        return True

    def _is_old(self, folder: pathlib.Path) -> bool:
        """Whether no folder from here to the store is a link, or changed after the last record."""
        if folder == self.path:
            return True
        if folder not in self._folders:
            old = not folder.is_symlink() and (
                self._last is None or _time_of_change(folder) < self._last
            )
            self._folders[folder] = old and self._is_old(folder.parent)
        return self._folders[folder]


def _time_of_change(path: pathlib.Path) -> float | int:
    """When the file, or the link in its place, changed last, in ns; for ever where it is not there."""
    try:
        about = os.lstat(path)
    except OSError:
        return math.inf
    return math.inf if stat.S_ISLNK(about.st_mode) else about.st_ctime_ns


def _size(path: pathlib.Path) -> int | None:
    try:
        return os.stat(path).st_size
    except OSError:
        return None
