"""The scoreboard: every statement that an experiment has measured, one row for each reading of it."""

import collections
import dataclasses
import json
import pathlib
import textwrap
from collections.abc import Iterable, Mapping
from typing import Any

from ._experiment import natural
from ._statement import FOUND, MACHINES, OWN, PAPERS, RECORDS, SYNTHETIC, Statement

WORDS = {True: "holds", False: "does not hold", None: "open"}
GROUPS = (PAPERS, FOUND, OWN, MACHINES, RECORDS, SYNTHETIC)
NOT_FULL = "a first look, counted nowhere: quick runs, the demo and runs with changed settings"


@dataclasses.dataclass(frozen=True)
class Row:
    """A statement in one reading; what every record that judges it says, by the record's name."""

    group: str
    id: str
    reading: str
    claim: str
    told: Mapping[str, Statement]

    @property
    def agreed(self) -> bool:
        """Whether all records say the same."""
        return len({s.holds for s in self.told.values()}) == 1

    @property
    def holds(self) -> bool | None:
        """Verdict of all records; None where they do not agree."""
        return next(iter(self.told.values())).holds if self.agreed else None


def is_full(record: Mapping[str, Any]) -> bool:
    """Whether a record is of a run at full size with the settings that the experiment states."""
    return not (record["quick"] or record.get("changed") or record["name"] == "demo")


def statements_of(record: Mapping[str, Any]) -> list[Statement]:
    """Statements of a record. Errors: `KeyError`, `TypeError` or `ValueError` for another content."""
    found = [Statement(**entry) for entry in record["statements"]]
    for one in found:
        if one.holds is not None and not isinstance(one.holds, bool):
            raise ValueError(f"holds is {one.holds!r}")
        if not one.group or not all(isinstance(t, str) for t in (one.claim, one.measured, one.reading)):
            raise ValueError(f"{one.id} is not a statement")
    return found


def rows(records: Iterable[Mapping[str, Any]]) -> list[Row]:
    """Rows of the records of full runs, by group, identifier and reading."""
    told: dict[tuple[str, str, str], dict[str, Statement]] = collections.defaultdict(dict)
    for record in records:
        if is_full(record):
            for one in statements_of(record):
                key = one.group, one.id, one.reading
                if record["name"] in told[key]:
                    raise ValueError(f"{record['name']} judges {one.id} {one.reading} twice")
                told[key][record["name"]] = one
    found = [Row(*key, next(iter(by.values())).claim, by) for key, by in told.items()]
    return sorted(found, key=lambda row: (GROUPS.index(row.group), natural(row.id), row.reading))


def totals(found: Iterable[Row]) -> dict[str, str]:
    """How many rows of each group hold, in words."""
    words = {}
    found = list(found)
    for group in GROUPS:
        own = [row for row in found if row.group == group]
        if own:
            count = collections.Counter(WORDS[row.holds] for row in own)
            apart = sum(not row.agreed for row in own)
            words[group] = ", ".join(f"{count[word]} {word}" for word in WORDS.values()) + (
                f" ({apart} of these because records do not agree)" if apart else ""
            )
    return words


def scoreboard(out: pathlib.Path) -> str:
    """The rows from the records in `out` with what was measured, and how many of each group hold.

    Runs that are not full are listed last and counted nowhere.
    """
    full, others, wrong = [], [], []
    for path in sorted(out.glob("*.json")):
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            statements_of(record)
            (full if is_full(record) else others).append(record)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            wrong.append(f"{path.name}: not a record of an experiment")
    found = rows(full)
    first = [(one, record) for record in others for one in statements_of(record)]
    if not found and not first:
        nothing = (
            f"No statements in {out}: run some experiments first, see python -m experiments --list."
        )
        return "\n".join([*wrong, nothing])
    lines = list(wrong)
    for group in dict.fromkeys(row.group for row in found):
        lines += ["", f"{group}:"]
        for row in found:
            if row.group == group:
                lines += _row(row)
    if first:
        lines += ["", f"{NOT_FULL}:"]
        for one, record in first:
            quick = "quick" if record["quick"] else "not at full size"
            lines.append(f"{_head(one.id, one.reading, one.holds)}  {record['name']} ({quick})")
    return "\n".join([*lines, "", *(f"{group}: {text}" for group, text in totals(found).items())])


def _head(id: str, reading: str, holds: bool | None) -> str:
    return f"{id:<6} {reading:<17} {WORDS[holds]:<14}"


def _row(row: Row) -> list[str]:
    lines = [_head(row.id, row.reading, row.holds).rstrip()]
    texts = [row.claim]
    for name, one in row.told.items():
        verdict = "" if row.agreed else f"{WORDS[one.holds]}, "
        texts.append(f"{verdict}measured by {name}: {one.measured}")
    for text in texts:
        lines += textwrap.wrap(text, 100, initial_indent="    ", subsequent_indent="    ")
    return lines
