"""Counts of the house stay where they are, or fall; words that a reader stumbles over stay away."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator

import pytest

from tests.house import counts

# Most that is allowed today: lower these with the counts, never raise them.
MOST_NUMBERS = 150
MOST_ARGUMENTS = 9
MOST_FIELDS = 16  # of a constructor: the parameters of a machine
# Packages whose functions are named for what they do, and whose sentences begin with a subject.
CLEAN = (
    "analysis", "basin", "contact", "continuation", "control", "derived", "estimation", "friction",
    "hybrid", "identification", "mechanism", "plot", "structure", "sweep", "systems", "view",
)  # fmt: skip
# Sentences that begin with their object, and words for which English has plainer ones.
STUMBLES = re.compile(
    r"(?:^|(?<=[.:] ))(?:What |Of the |Of those |Those that )"
    r"|\brefus(?:e|es|ed|ing)\b|(?<![Tt]here )\bis no (?!\w+er\b|more|less)"
)


def texts(path, tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Docstrings and blocks of comments of a file, each with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module) and (
            text := ast.get_docstring(node)
        ):
            yield getattr(node, "lineno", 1), text
    block: list[str] = []
    last = 0
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type == tokenize.COMMENT:
            if token.start[0] != last + 1 and block:
                yield last, " ".join(block)
                block = []
            block.append(token.string.lstrip("# "))
            last = token.start[0]
    if block:
        yield last, " ".join(block)


def stumbles(package: str) -> list[str]:
    return [
        f"{path.relative_to(counts.ROOT)}:{line} {found.group()}"
        for path, tree in counts.trees(package).items()
        for line, text in texts(path, tree)
        for paragraph in re.split(r"\n\s*\n", text)
        for found in STUMBLES.finditer(" ".join(paragraph.split()))
    ]


@pytest.mark.parametrize("name", CLEAN)
def test_functions_are_named_for_what_they_do(name):
    assert counts.participles(f"stickslip/{name}") == []


@pytest.mark.parametrize("name", CLEAN)
def test_sentences_begin_with_their_subject(name):
    assert stumbles(f"stickslip/{name}") == []


def test_a_sentence_that_begins_with_its_object_is_seen():
    words = ["What is cut is lost.", "It ends. Of the two one stays.", "It is no orbit.", "It refuses."]
    assert all(STUMBLES.search(text) for text in words)
    plain = ["There is no orbit.", "It is no longer one.", "See what is cut.", "A guard of the two."]
    assert not any(STUMBLES.search(text) for text in plain)


def test_numbers_and_arguments_do_not_grow():
    assert len(counts.numbers("stickslip")) <= MOST_NUMBERS
    assert next(iter(counts.arguments("stickslip").values())) <= MOST_ARGUMENTS
    assert next(iter(counts.fields("stickslip").values())) <= MOST_FIELDS


@pytest.mark.parametrize("name", counts.LAYERS)
def test_no_modules_import_each_other(name):
    assert counts.circles(f"stickslip/{name}") == []
