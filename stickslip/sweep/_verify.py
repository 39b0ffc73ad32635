"""All checksums of a store, computed again."""

import contextlib
import json
import pathlib
from typing import Any

from .._paths import the_directory
from .._types import Given, Path
from .._validation import check_flag, refusal
from ._children import children
from ._files import checksum, read_json, write_whole
from ._layout import Files, record_file
from ._manifest import fault_of, identity, with_checksum
from ._records import is_record, made_by, record, recorded_units


def verify_store(store: Path, *, repair: Given[bool] = False) -> list[str]:
    """Names of the files of a store that are not as they were written, by their checksums.

    A later `run_sweep` looks at sizes and times of change, which show what any program
    did; a byte that decayed on the disk shows here alone.

    **Arguments**

    - `store`: of a sweep, finished or not, with all steps of one that is refined. Files that others are
      writing meanwhile may be named as damaged.
    - `repair`: remove the records of units with a damaged file, so that the next `run_sweep` computes
      them again. It writes damaged headers and coordinates again in any case.

    **Returns** the names relative to the store, in the order of units; none if the store is sound. Not
    counted are the diary `runs.jsonl` and `lock`, on which no number depends.

    **Errors** `TypeError` or `ValueError` if `store` is not the directory of a store, or if its
    manifest is damaged; `OSError` if a record cannot be removed.
    """
    check_flag("repair", repair)
    path = the_directory("store", store)
    found = _one(path, repair)
    for step in children(path):
        found += [f"{step.relative_to(path).as_posix()}/{name}" for name in _one(step, repair)]
    return found


def _one(path: pathlib.Path, repair: bool) -> list[str]:
    """The same of a store without those inside it."""
    manifest = the_manifest(path)
    canonical = json.dumps(manifest, indent=1) + "\n"
    found = [] if _text(path / "manifest.json") == canonical else ["manifest.json"]
    found += [name for name, sum_ in manifest["files"].items() if checksum(path / name) != sum_]
    there = recorded_units(path)
    sweep = identity(manifest)
    for number, names in Files(manifest).blocks():
        if number not in there:
            continue
        own, by = record_file(number), None
        with contextlib.suppress(OSError, ValueError):
            by = made_by(read_json(path / own))
        bad = _damaged_files(path, own, record(path, sweep, number, names, manifest["format"], by))
        found += bad
        if bad and repair:
            (path / own).unlink(missing_ok=True)
    if repair and found[:1] == ["manifest.json"]:
        # Its words are whole, or there were no manifest; only its spaces are not.
        write_whole(path / "manifest.json", canonical)
    return found


def the_manifest(path: pathlib.Path) -> dict[str, Any]:
    """The manifest of a store; `ValueError` if there is none that can be relied on."""
    if not path.is_dir():
        raise refusal("store", str(path), "the directory of a sweep's store")
    try:
        manifest = read_json(path / "manifest.json")
        why = fault_of(manifest)
    except FileNotFoundError:
        why, manifest = "has no manifest.json", None
    except ValueError as error:
        why, manifest = f"has an unreadable manifest.json ({error})", None
    if why is not None:
        raise ValueError(
            f"store = {str(path)!r} {why}: it must have a whole one; the `run_sweep` that made "
            "it writes it again, as far as its records show that it is the same sweep."
        )
    assert isinstance(manifest, dict)
    return manifest


def _damaged_files(path: pathlib.Path, own: str, now: dict[str, Any]) -> list[str]:
    """Which files of a unit are not as recorded: the record, or what it vouches for."""
    try:
        value = read_json(path / own)
    except (OSError, ValueError):
        return [own]
    if value == now and _text(path / own) == json.dumps(now, indent=1) + "\n":
        return []
    if not is_record(value) or value.get("seal", None) != (
        with_checksum(value)["seal"] if "seal" in now else None
    ):
        return [own]
    bad = [name for name, sum_ in now["files"].items() if value["files"].get(name) != sum_]
    return bad or [own]


def _text(path: pathlib.Path) -> str | None:
    with contextlib.suppress(OSError, ValueError):
        return path.read_text(encoding="utf-8")
    return None
