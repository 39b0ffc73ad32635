"""The stores inside a store: the steps of a refinement, each a sweep of its own.

    STORE/refined/0001/                 the points of the first step, a store like any other
    STORE/refined/0002.8f3c0a12.part/   of somebody who is making one, or was killed at it

Which points a step has follows from the results before it.
"""

import os
import pathlib
import shutil

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
    return [path / REFINED / name for name in sorted(names, key=_number) if _number(name)]


def family(path: pathlib.Path) -> list[pathlib.Path]:
    """The store of the grid, then those of the steps."""
    return [path, *children(path)]


def remove_half_made(path: pathlib.Path, number: int) -> None:
    """What workers who were killed have left of making a step that exists by now."""
    for place in (path / REFINED).glob(f"{child(path, number).name}.*.part"):
        shutil.rmtree(place, ignore_errors=True)


def _number(name: str) -> int:
    return int(name) if name.isascii() and name.isdecimal() and len(name) >= 4 else 0
