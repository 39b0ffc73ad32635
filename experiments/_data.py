"""Records that users bring: found in a folder that they name, never part of the repository."""

import os
import pathlib
from collections.abc import Sequence
from typing import Any

VARIABLE = "STICKSLIP_DATA"


class MissingDataError(ValueError):
    """A record that is not there; says where it was looked for and where it comes from."""


def find(folder: pathlib.Path | None, group: str, name: str, origin: str) -> pathlib.Path:
    """The file `name` in `folder`, or in its subfolder `group`; without a folder, in the one that the
    environment variable `STICKSLIP_DATA` names.

    Errors: `MissingDataError`; `origin` says where the record can be had.
    """
    given = folder if folder is not None else os.environ.get(VARIABLE) or None
    if given is None:
        raise MissingDataError(
            f"{name} is needed: name its folder by --data FOLDER or {VARIABLE}. {origin}"
        )
    places = [pathlib.Path(given) / name, pathlib.Path(given) / group / name]
    for place in places:
        if place.is_file():
            return place
    said = "--data" if folder is not None else VARIABLE
    raise MissingDataError(
        f"{said} {given}: it must be a folder with {name} or {group}/{name}. {origin}"
    )


def listed(key: str, text: Any) -> tuple[str, ...]:
    """Names separated by commas, of records to fit or to score. Errors: `ValueError` for one twice."""
    found = tuple(filter(None, (part.strip() for part in str(text).split(","))))
    if len(set(found)) < len(found):
        raise ValueError(f"--set {key}={text}: it must name each record once.")
    return found


def numbered(key: str, text: Any, allowed: Sequence[int] | None = None) -> tuple[int, ...]:
    """The same of records that have numbers. Errors: `ValueError` for others than those `allowed`."""
    found = listed(key, text)
    among = "numbers" if allowed is None else f"among {', '.join(map(str, allowed))}"
    if not all(part.isdigit() and (allowed is None or int(part) in allowed) for part in found):
        raise ValueError(f"--set {key}={text}: it must be {among}, separated by commas.")
    return tuple(map(int, found))
