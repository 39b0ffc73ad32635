"""One structure of the attack: drawn, compared, shrunk where it is wrong, and counted."""

from collections import Counter

import numpy as np

from ._draw import structure_of
from ._shrink import shrunk
from ._structure import Numbers, Structure, script
from ._verdict import (
    CLASSES,
    CRASH,
    FLAGGED_WRONG,
    LOUD,
    REFUSED,
    TIMES,
    UNDECIDED,
    WRONG,
    Finding,
    again,
    attacked,
)


def attack(seed: int, number: int, seconds: float) -> tuple[list[str], Counter, Counter]:
    """Lines to print, counts by check and class, refusals by their words."""
    rng = np.random.default_rng([seed, number])
    structure = structure_of(rng)
    lines: list[str] = []
    counts: Counter = Counter()
    refusals: Counter = Counter()
    for found in attacked(structure, rng):
        counts[found.check, found.verdict] += 1
        if found.verdict == REFUSED:
            refusals[found.words[:110]] += 1
        if found.verdict in (CRASH, FLAGGED_WRONG, LOUD, UNDECIDED):
            lines.append(f"{found.verdict}: {found.check}: {found.words}")
        if found.verdict == WRONG:
            lines.append(f"{WRONG}: {found.check}: {found.words}")
            if counts[found.check, WRONG] == 1:
                lines.append(smallest(structure, found, seconds))
    return lines, counts, refusals


def smallest(structure: Structure, found: Finding, seconds: float) -> str:
    """What is wrong as a script, shrunk for so many seconds."""
    assert found.numbers is not None

    def wrong(s: Structure, n: Numbers) -> bool:
        return again(s, n, found.check).verdict == WRONG

    # In other units a machine with a number for its mass is another machine.
    s, n = shrunk(structure, found.numbers, wrong, seconds, literals=found.check != "units")
    last = again(s, n, found.check)
    text = "\n".join("    " + line for line in script(s, n, TIMES).splitlines())
    return f"shrunk ({last.verdict}: {last.words}):\n{text}"


def table(verdicts: Counter, refusals: Counter) -> str:
    """Counts by check (rows) and class (columns)."""
    checks = sorted({check for check, _ in verdicts if check != "structures"})
    lines = [f"{verdicts['structures', 'all']} structures", " | ".join(["check", *CLASSES])]
    for check in [*checks, "all"]:
        rows = [
            sum(n for (c, v), n in verdicts.items() if v == verdict and check in (c, "all"))
            for verdict in CLASSES
        ]
        lines.append(" | ".join([check, *map(str, rows)]))
    lines += [f"{n:4d} refused: {words}" for words, n in refusals.most_common()]
    return "\n".join(lines)


def tally(verdicts: Counter) -> str:
    """One line of counts."""
    sums = {v: sum(n for (_, w), n in verdicts.items() if w == v) for v in CLASSES}
    counts = ", ".join(f"{v} {n}" for v, n in sums.items() if n)
    return f"{verdicts['structures', 'all']} structures: {counts}"
