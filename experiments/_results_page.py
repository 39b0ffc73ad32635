"""`experiments/RESULTS.md` and `THRESHOLDS.md`, from the records in the repository and nothing else."""

import collections
import pathlib
import re
from collections.abc import Iterable, Mapping
from typing import Any

from ._experiment import Experiment
from ._records import FOLDER
from ._scoreboard import GROUPS, WORDS, Row, rows, totals
from ._statement import PAPERS
from ._thresholds import TABLE

SHORT = {True: "holds", False: "no", None: "open"}
FAMILIES = {
    "block": "Block on a belt",
    "beam": "Jointed beam",
    "corexy": "CoreXY mechanism",
    "mechanism": "Declared machines against known results",
    "identify": "Identification",
    "animate": "Animations",
}
HEAD = """\
# Results

Written by `python -m experiments results` from the records of full runs in `experiments/records`; a
test compares the two. `python -m experiments NAME` computes a figure anew into `results/` (`--quick`
for a coarse look), `make figures` all of them, and `python -m experiments record` takes full runs
over into the records. What the results mean: [What the results say](../notebooks/results.md).
"""
FIGURES = """\
## Figures

Minutes of processor time, compiling included, and of the clock, while other programs ran.
"""
SCORES = """\
## Scoreboard

One row for each statement and reading, from full runs only. What is claimed of parameters that our
searches found, and what we claim ourselves, is counted apart from what the papers claim. The numbers
that statements are judged by: [THRESHOLDS.md](THRESHOLDS.md).
"""
NUMBERS = """\
# The numbers that statements are judged by

Written by `python -m experiments results` from `experiments/_thresholds.py`. The papers seldom say how
much is "much". Where a number is not theirs (*paper*), nor *published* with a measured record, it is a
choice: *ours*, or that of an earlier *study* of the CoreXY statements with fixed steps.

| name | value | meaning | source |
|---|---|---|---|"""


def results(records: Mapping[str, Mapping[str, Any]], experiments: Mapping[str, Experiment]) -> str:
    """The page of figures and statements."""
    found = rows(records.values())
    parts = [HEAD, FIGURES, *_figures(records, experiments), SCORES, *_scores(found)]
    return "\n".join(parts).rstrip() + "\n"


def thresholds() -> str:
    """The page of the numbers that statements are judged by."""
    lines = [NUMBERS]
    for name, number in TABLE.items():
        value = f"{number.value:g} {number.unit}".strip()
        lines.append(f"| `{name}` | {value} | {_cell(number.meaning)} | {number.source} |")
    return "\n".join(lines) + "\n"


def write(
    records: Mapping[str, Mapping[str, Any]],
    experiments: Mapping[str, Experiment],
    folder: pathlib.Path = FOLDER.parent,
) -> list[pathlib.Path]:
    """Write both pages; their paths."""
    pages = {"RESULTS.md": results(records, experiments), "THRESHOLDS.md": thresholds()}
    for name, text in pages.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in pages]


def _figures(records, experiments) -> Iterable[str]:
    missing = []
    for family, title in FAMILIES.items():
        lines = [f"### {title}", "", "| | figure | CPU min | min |", "|---|---|---|---|"]
        for name, experiment in experiments.items():
            if name.split("-")[0] != family:
                continue
            if name not in records:
                missing.append(name)
                continue
            record = records[name]
            seconds = record["wall_time_s"]
            spent = _minutes(seconds["processor"]) if "processor" in seconds else "not measured"
            picture = f'<img src="records/{name}.png" width="240">'
            command = f"python -m experiments {name}" + (" --data FOLDER" if experiment.brought else "")
            lines.append(
                f"| {picture} | {_cell(record['title'])}<br>`{command}` | {spent} | "
                f"{_minutes(seconds['total'])} |"
            )
        if len(lines) > 4:
            yield "\n".join([*lines, ""])
    if missing:
        yield f"Not run for this page: {', '.join(f'`{name}`' for name in missing)}.\n"
    yield _machines(records.values()) + "\n"


def _minutes(seconds: float) -> str:
    return f"{seconds / 60:.1f}" if seconds >= 3.0 else "less than 0.1"


def _machines(records: Iterable[Mapping[str, Any]]) -> str:
    """Where the records come from, in a line for each kind of run."""
    kinds: dict[str, list[str]] = collections.defaultdict(list)
    for record in records:
        versions = record["versions"]
        names = ("python", "jax", "diffrax", "equinox", "numpy")
        used = ", ".join(f"{name} {versions[name]}" for name in names if name in versions)
        where = f"{record['cpu_count']} cores, {record['device']}, {used}"
        kinds[f"{where}; {record['date'][:10]}, revision {record['code_revision'][:10]}"].append(
            record["name"]
        )
    most = max(kinds, key=lambda kind: len(kinds[kind]), default="")
    lines = ["Computed on:", ""]
    for kind, names in kinds.items():
        lines.append(f"- {kind}: " + ("all others" if kind == most else ", ".join(names)))
    if len(kinds) == 1:
        lines = [f"Computed on {most}."]
    return "\n".join(lines)


def _scores(found: list[Row]) -> Iterable[str]:
    yield "\n".join(f"- {group}: {text}" for group, text in totals(found).items()) + "\n"
    papers = [row for row in found if row.group == PAPERS]
    if papers:
        yield "\n".join(_counts(papers))
    for group in GROUPS:
        own = [row for row in found if row.group == group]
        if own:
            yield f"### {group[0].upper()}{group[1:]}\n"
            yield "\n".join(_table(own))


def _counts(found: list[Row]) -> Iterable[str]:
    """How many hold of each paper, or part of it, and reading."""
    yield from ("| statements | reading | holds | does not hold | open |", "|---|---|---|---|---|")
    kinds: dict[tuple[str, str], list[Row]] = collections.defaultdict(list)
    for row in found:
        part = re.match(r"([A-Z]\d)\.|([A-Z])", row.id)
        assert part is not None
        kinds[part[1] or part[2], row.reading].append(row)
    for (part, reading), own in sorted(kinds.items()):
        count = collections.Counter(WORDS[row.holds] for row in own)
        numbers = " | ".join(str(count[word]) for word in WORDS.values())
        yield f"| {part} | {reading} | {numbers} |"
    yield ""


def _table(found: list[Row]) -> Iterable[str]:
    """Statements with their measured numbers, the readings one under the other."""
    yield from ("| | statement | reading | | measured |", "|---|---|---|---|---|")
    claim = ""
    for row in found:
        texts = []
        for name, one in row.told.items():
            verdict = "" if row.agreed else f"{SHORT[one.holds]} by {name}: "
            texts.append(f"{verdict}{one.measured}")
        # The claim once; two figures that measure the same say the same.
        shown = row.claim if row.claim != claim else ""
        claim = row.claim
        measured = "; ".join(dict.fromkeys(texts))
        yield (
            f"| {row.id} | {_cell(shown)} | {row.reading} | {SHORT[row.holds]} | {_cell(measured)} |"
        )
    yield ""


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
