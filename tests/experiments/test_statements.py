"""Claims stand beside their predicates, and their numbers in one table."""

import ast

import pytest

from experiments import _statement
from experiments._experiment import load
from experiments._statement import CLAIMS, FOUND, OWN, PAPERS, Statement, Untold, claims, statement
from experiments._thresholds import OURS, PAPER, PUBLISHED, STUDY, TABLE
from tests.house._repository import ROOT

SOURCES = sorted((ROOT / "experiments").rglob("*.py"))
# Of a formula, not of a judgement: zero, one, two, and a thousand to go from seconds to ms.
HARMLESS = {0, 1, 2, 1e3}
MODES = {3, 4}  # dynamic models of CoreXY


def predicates():
    """Functions under `@statement`, with the file each is in."""
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and any(
                isinstance(d, ast.Call) and getattr(d.func, "id", "") == "statement"
                for d in node.decorator_list
            ):
                yield path, node


def test_predicates_take_their_numbers_from_the_table():
    load()
    found = list(predicates())
    assert len(found) == len(CLAIMS)
    wrong = [
        f"{path.name}: {node.name} has {constant.value}"
        for path, node in found
        for constant in ast.walk(ast.Module(node.body, []))
        if isinstance(constant, ast.Constant)
        and isinstance(constant.value, float | int)
        and constant.value not in HARMLESS
        and constant.value not in MODES
    ]
    assert wrong == []


def test_every_statement_is_judged_by_its_claim():
    """Nothing but a claim makes statements, so that none is worded far from its predicate."""
    makers = ("_statement.py", "_scoreboard.py")
    found = [
        f"{path.name}: {call.lineno}"
        for path in SOURCES
        if path.name not in makers
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Statement"
    ]
    assert found == []


def test_every_number_of_the_table_is_used_and_has_a_source():
    texts = "".join(p.read_text(encoding="utf-8") for p in SOURCES if p.name != "_thresholds.py")
    assert [name for name in TABLE if name not in texts] == []
    for name, number in TABLE.items():
        assert number.source in (PAPER, STUDY, PUBLISHED, OURS), name
        assert number.meaning, name


def test_claims_are_there_once_and_in_order():
    load()
    assert [claim.id for claim in claims("B")] == [f"B{n}" for n in range(1, 7)]
    ids = [
        f"C{n}" for n in ("1", "2", "3", "4a", "4b", "5", "6", "7", "8", "9a", "9b", "3b", "4c", "5b")
    ]
    assert [claim.id for claim in claims("C")] == ids
    assert [len(claims(f"S{n}.")) for n in (1, 2, 3)] == [21, 17, 15]
    assert [claim.id for claim in claims("R4.")] == [f"R4.{n}" for n in range(1, 11)]


def test_a_claim_judges_by_its_predicate(monkeypatch):
    monkeypatch.setattr(_statement, "CLAIMS", {})

    @statement("B1", "It is large.")
    def is_large(value):
        if value is None:
            raise Untold("no value")
        return value > 10, f"value {value}"

    assert is_large("printed", 11) == Statement("B1", "It is large.", True, "value 11", "printed")
    assert is_large("printed", 9).holds is False
    assert is_large("printed", None).holds is None
    assert is_large("printed", None).measured == "cannot be told: no value"
    assert is_large("", 11).group == PAPERS
    assert is_large("", 11, found=True).group == FOUND
    with pytest.raises(ValueError, match=r"id = 'B1': it is taken by 'It is large\.'"):
        statement("B1", "It is small.")
    with pytest.raises(ValueError, match=r"id = 'Q1': it must begin with one of B, C, "):
        statement("Q1", "It is small.")


def test_our_own_claims_are_not_the_papers():
    for id in ("X1", "X2", "F1", "I1"):
        assert Statement(id, "", True, "").group == OWN
