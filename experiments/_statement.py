"""Statements: a claim beside the predicate that judges it, and what was measured."""

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import xarray as xr

PAPERS = "the papers' statements"
FOUND = "the papers' statements, with parameters that our searches found"
OWN = "what we claim of our own searches, plans and designs"
MACHINES = "known results of declared machines"
RECORDS = "what is published on measured records"
SYNTHETIC = "what fits of synthetic records promise"
# Who claims it, by the letters that the identifier begins with.
CLAIMED_BY = {
    "B": PAPERS,
    "C": PAPERS,
    "S": PAPERS,
    "X": OWN,
    "F": OWN,
    "I": OWN,
    "M": MACHINES,
    "R": RECORDS,
    "Y": SYNTHETIC,
}
Verdict = tuple[bool | None, str]


class Untold(Exception):
    """Raised where the data do not say whether a statement holds; the message says why."""


@dataclasses.dataclass(frozen=True)
class Statement:
    """A claim in one reading of it, and what was measured; `holds` is None where it stays open.

    `reading`: which of several readings of a paper, empty where there is one. `found`: whether it was
    judged with parameters that our searches found, of which the paper claims nothing.
    """

    id: str
    claim: str
    holds: bool | None
    measured: str
    reading: str = ""
    found: bool = False

    @property
    def group(self) -> str:
        """Who claims it, one of the values of `CLAIMED_BY` or `FOUND`."""
        by = claimed_by(self.id)
        return FOUND if self.found and by == PAPERS else by


def claimed_by(id: str) -> str:
    """Who claims the statement. Errors: `ValueError` for letters that nobody claims by."""
    letters = re.match("[A-Z]*", id)
    assert letters is not None
    if letters[0] not in CLAIMED_BY:
        raise ValueError(f"id = {id!r}: it must begin with one of {', '.join(CLAIMED_BY)}.")
    return CLAIMED_BY[letters[0]]


@dataclasses.dataclass(frozen=True)
class Claim:
    """A claim and its predicate; called with a reading and what the predicate takes, it judges."""

    id: str
    text: str
    predicate: Callable[..., Verdict]

    def __call__(self, reading: str, *data: Any, found: bool = False) -> Statement:
        """The statement; open where the predicate raises `Untold`."""
        try:
            holds, measured = self.predicate(*data)
        except Untold as reason:
            return self.open(reading, f"cannot be told: {reason}", found=found)
        holds = None if holds is None else bool(holds)
        return Statement(self.id, self.text, holds, measured, reading, found)

    def open(self, reading: str, why: str, *, found: bool = False) -> Statement:
        """The statement where nothing can be said."""
        return Statement(self.id, self.text, None, why, reading, found)


CLAIMS: dict[str, Claim] = {}


def statement(id: str, text: str) -> Callable[[Callable[..., Verdict]], Claim]:
    """Decorator that puts the claim `text` beside its predicate and enters it in `CLAIMS`.

    The predicate returns whether the claim holds, None where that stays open, and the measured
    numbers in words. Errors: `ValueError` for an `id` that is taken or that nobody claims by.
    """
    claimed_by(id)
    if id in CLAIMS:
        raise ValueError(f"id = {id!r}: it is taken by {CLAIMS[id].text!r}.")

    def enter(predicate: Callable[..., Verdict]) -> Claim:
        CLAIMS[id] = Claim(id, text, predicate)
        return CLAIMS[id]

    return enter


def claims(prefix: str) -> list[Claim]:
    """Claims whose identifiers begin with `prefix`, in the order in which they are declared."""
    return [claim for id, claim in CLAIMS.items() if id.startswith(prefix)]


def judge_all(prefix: str) -> Callable[[xr.Dataset], list[Statement]]:
    """Judge of an experiment: it judges every claim that begins with `prefix`, in its one reading."""

    def judge(dataset: xr.Dataset) -> list[Statement]:
        return [claim("", dataset) for claim in claims(prefix)]

    return judge
