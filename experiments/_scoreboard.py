"""The scoreboard: every statement that an experiment has measured."""

import json
import pathlib
import textwrap
from typing import Any

WORDS = {True: "holds", False: "does not hold", None: "open"}


def scoreboard(out: pathlib.Path) -> str:
    """One line per statement from the records in `out`."""
    lines, count = [], {word: 0 for word in WORDS.values()}
    for path in sorted(out.glob("*.json")):
        try:
            found, words = _read(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            lines.append(f"{path.name}: not a record of an experiment")
            continue
        lines += found
        for word in words:
            count[word] += 1
    if not count or not any(count.values()):
        return f"No statements in {out}: run some experiments first, see python -m experiments --list."
    total = ", ".join(f"{number} {word}" for word, number in count.items())
    return "\n".join([*lines, "", total])


def _read(record: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Lines of one record and the verdicts in it; an error of some kind for any other JSON."""
    lines, words = [], []
    for statement in record["statements"]:
        holds = statement["holds"]
        if not (holds is None or isinstance(holds, bool)):
            raise TypeError
        words.append(WORDS[holds])
        head = f"{statement['id']:<16} {WORDS[holds]:<14} {record['name']}"
        lines.append(head + (" (quick)" if record.get("quick") else ""))
        for text in (statement["claim"], "measured: " + statement["measured"]):
            lines += textwrap.wrap(text, 100, initial_indent="    ", subsequent_indent="    ")
    return lines, words
