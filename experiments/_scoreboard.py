"""The scoreboard: every statement that an experiment has measured."""

import json
import pathlib
import textwrap
from collections.abc import Mapping
from typing import Any

WORDS = {True: "holds", False: "does not hold", None: "open"}
OF_THE_PAPERS = "the papers' statements"
OWN = "statements on sets found by our searches"
MACHINES = "known results of declared machines"
RECORDS = "what is published on measured records"
SYNTHETIC = "what fits of synthetic records promise"
QUICK = "quick runs and demo, a first look"


def scoreboard(out: pathlib.Path) -> str:
    """One line per statement from the records in `out`, and how many of them hold.

    Full runs with the constructed parameters are counted apart from those with parameters that our
    searches found, both from known results of the machines declared here, on measured records and on
    synthetic ones, and all from quick runs. A statement that several figures measure counts once; if
    they do not agree it is open.
    """
    lines: list[str] = []
    verdicts: dict[str, dict[str, set]] = {
        OF_THE_PAPERS: {},
        OWN: {},
        MACHINES: {},
        RECORDS: {},
        SYNTHETIC: {},
        QUICK: {},
    }
    for path in sorted(out.glob("*.json")):
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            group, rows = _group(record), [_row(record, s) for s in record["statements"]]
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            lines.append(f"{path.name}: not a record of an experiment")
            continue
        for id, holds, row in rows:
            verdicts[group].setdefault(id, set()).add(holds)
            lines += row
    if not any(verdicts.values()):
        return f"No statements in {out}: run some experiments first, see python -m experiments --list."
    totals = [f"{group}: {_total(found)}" for group, found in verdicts.items() if found]
    return "\n".join([*lines, "", *totals])


def _group(record: Mapping[str, Any]) -> str:
    if record.get("quick") or record["name"] == "demo":
        return QUICK
    if record["name"].startswith("mechanism-"):
        return MACHINES
    if record["name"] in ("identify-coverage", "identify-corexy-machines"):
        return SYNTHETIC
    if record["name"].startswith("identify-"):
        return RECORDS
    found = record["name"].endswith("-search") or record.get("parameters", {}).get("set", "A") != "A"
    return OWN if found else OF_THE_PAPERS


def _row(record: Mapping[str, Any], statement: Mapping[str, Any]) -> tuple[str, Any, list[str]]:
    """Id, verdict and the lines of a statement. `KeyError` for a verdict that is none."""
    holds = statement["holds"]
    if holds is not None and not isinstance(holds, bool):
        raise KeyError(f"holds is {holds!r}")
    head = f"{statement['id']:<16} {WORDS[holds]:<14} {record['name']}"
    lines = [head + (" (quick)" if record.get("quick") else "")]
    for text in (statement["claim"], "measured: " + statement["measured"]):
        lines += textwrap.wrap(text, 100, initial_indent="    ", subsequent_indent="    ")
    return statement["id"], holds, lines


def _total(found: Mapping[str, set]) -> str:
    count = dict.fromkeys(WORDS.values(), 0)
    for verdicts in found.values():
        count[WORDS[next(iter(verdicts)) if len(verdicts) == 1 else None]] += 1
    text = ", ".join(f"{number} {word}" for word, number in count.items())
    apart = sum(len(verdicts) > 1 for verdicts in found.values())
    return text + (f" ({apart} of these because records do not agree)" if apart else "")
