"""Words of the field and where they are here: for `python -m stickslip --find` and a page of the site.

`_glossary.txt` has them, separated by empty lines: words for one thing; behind a colon a sentence on
it; behind another where it is, or what to do instead. Texts are Markdown; links lead to `notebooks/`.
"""

import functools
import pathlib
import re
from typing import NamedTuple


class Term(NamedTuple):
    """Words for one thing, what it is, and where."""

    words: str
    meaning: str
    here: str


@functools.cache
def glossary() -> tuple[Term, ...]:
    """All entries, in alphabetical order."""
    text = pathlib.Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
    return tuple(
        Term(*(" ".join(part.split()) for part in entry.split("\n:"))) for entry in text.split("\n\n")
    )


def terms_with(text: str) -> list[Term]:
    """Entries that have every word of `text`, those named so first."""
    wanted = text.lower().split()

    def is_in(said: str) -> bool:
        return all(word in said.lower() for word in wanted)

    found = [term for term in glossary() if is_in(" ".join(term))]
    return sorted(found, key=lambda term: not is_in(term.words))


def without_links(text: str) -> str:
    """Markdown as a terminal shows it: of a link its title and the file."""
    return re.sub(r"\[([^]]+)\]\(([^)]+)\)", r"\1 (notebooks/\2)", text)
