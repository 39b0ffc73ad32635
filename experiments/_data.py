"""Records that users bring: found in a folder that they name, never part of the repository."""

import os
import pathlib

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
