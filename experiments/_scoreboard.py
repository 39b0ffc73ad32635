"""The scoreboard: every statement that an experiment has measured."""

import json
import pathlib
import textwrap

WORDS = {True: "holds", False: "does not hold", None: "open"}


def scoreboard(out: pathlib.Path) -> str:
    """One line per statement from the records in `out`."""
    lines, count = [], {word: 0 for word in WORDS.values()}
    for path in sorted(out.glob("*.json")):
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            statements = record["statements"]
        except (ValueError, KeyError, TypeError):
            lines.append(f"{path.name}: not a record of an experiment")
            continue
        for statement in statements:
            word = WORDS[statement["holds"]]
            count[word] += 1
            head = f"{statement['id']:<16} {word:<14} {record['name']}"
            lines.append(head + (" (quick)" if record.get("quick") else ""))
            for text in (statement["claim"], "measured: " + statement["measured"]):
                lines += textwrap.wrap(text, 100, initial_indent="    ", subsequent_indent="    ")
    if not count or not any(count.values()):
        return f"No statements in {out}: run some experiments first, see python -m experiments --list."
    total = ", ".join(f"{number} {word}" for word, number in count.items())
    return "\n".join([*lines, "", total])
