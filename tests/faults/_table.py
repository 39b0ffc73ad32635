"""The faults of the tables beside this file, and what planting one makes of a file."""

import ast
import tomllib
from pathlib import Path
from typing import NamedTuple

TABLES = sorted(Path(__file__).parent.glob("*.toml"))


class Fault(NamedTuple):
    """A line that somebody could have written: `old` of `file` becomes `new`, and why that is wrong.

    `tests`: files of the quick suite, below `tests` and without their ending, that should see it.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    cause: str


def faults() -> list[Fault]:
    tables = (tomllib.loads(table.read_text(encoding="utf-8")) for table in TABLES)
    rows = (row for table in tables for row in table["fault"])
    return [Fault(**{**row, "tests": tuple(row["tests"])}) for row in rows]


def faulty(fault: Fault, text: str) -> str:
    """The file with the fault in it; `ValueError` where it cannot be planted exactly once."""
    if (found := text.count(fault.old)) != 1:
        raise ValueError(f"{fault.file} has `{fault.old}` {found} times")
    planted = text.replace(fault.old, fault.new)
    if ast.dump(ast.parse(planted)) == ast.dump(ast.parse(text)):
        raise ValueError(f"`{fault.new}` says the same as `{fault.old}`")
    return planted
