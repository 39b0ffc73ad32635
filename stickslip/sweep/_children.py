"""The stores inside a store: the steps of a refinement, each a sweep of its own.

    STORE/refined/0001/   the points of the first step, a store like any other

Which points a step has follows from the results before it.
"""

import os
import pathlib

REFINED = "refined"


def child(path: pathlib.Path, number: int) -> pathlib.Path:
    """Where step `number` of a refinement is kept; number 0 is the grid, the store itself."""
    return path / REFINED / f"{number:04d}" if number else path


def children(path: pathlib.Path) -> list[pathlib.Path]:
    """The steps that there are, in their order."""
    try:
        names = os.listdir(path / REFINED)
    except OSError:
        return []
    places = [path / REFINED / name for name in sorted(names, key=_number) if _number(name)]
    return [place for place in places if is_begun(place)]


def is_begun(place: pathlib.Path) -> bool:
    """Whether a step is more than a folder whose maker was killed."""
    return any(os.path.lexists(place / name) for name in ("manifest.json", "finished"))


def _number(name: str) -> int:
    return int(name) if name.isascii() and name.isdecimal() and len(name) >= 4 else 0
