"""Pages name tests, files and fields of the engine that are there."""

import ast
import functools
import re

import pytest

from experiments._attempt_picture import VERBS
from stickslip.hybrid import _loop_state
from tests.house._repository import ROOT
from tests.house.test_readme import PAGES, text_of

NAMED = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")
FAULTS = ROOT / "notebooks" / "what_can_go_wrong.md"
ATTEMPT = ROOT / "notebooks" / "one_attempt.md"
WITHOUT_FAULTS = "## How they were found"


@functools.cache
def functions_of(path):
    """Names of the test functions of a file, none if it does not exist."""
    if not (ROOT / path).exists():
        return frozenset()
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    functions = (node.name for node in tree.body if isinstance(node, ast.FunctionDef))
    return frozenset(name for name in functions if name.startswith("test_"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tests_that_a_page_names_exist(page):
    named = NAMED.findall(text_of(page))
    assert [(path, name) for path, name in named if not is_there(path, name)] == []


def is_there(path, name):
    return name in functions_of(path) if name else (ROOT / path).exists()


def test_every_fault_names_its_test():
    faults = text_of(FAULTS).split(WITHOUT_FAULTS)[0].split("\n- ")[1:]
    assert len(faults) >= 60
    assert [fault[:60] for fault in faults if not NAMED.search(fault)] == []


def test_the_attempt_has_all_codes_and_fields():
    text = text_of(ATTEMPT)
    codes = {name: int(value) for name, value in vars(_loop_state).items() if type(value) is float}
    rows = re.findall(r"^\| `([A-Z]+)` \| (\d+) \|", text, flags=re.MULTILINE)
    assert {name: int(number) for name, number in rows} == codes
    named = set(re.findall(r"`(\w+)`", text.split("## A lane")[1].split("## Watch it")[0]))
    assert set(_loop_state.Lane._fields) <= named


def test_the_picture_has_the_verbs_of_the_page():
    verbs = re.findall(r"^\d+\. \*\*(\w+)\*\*", text_of(ATTEMPT), flags=re.MULTILINE)
    assert [verb.lower() for verb in verbs] == [verb for verb, _, _ in VERBS]
    files = {file for _, _, files in VERBS for file in files.split(", ")}
    assert {file for file in files if not (ROOT / "stickslip" / "hybrid" / file).exists()} == set()
