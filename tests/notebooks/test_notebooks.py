"""Every notebook runs at quick size; what it must show it asserts itself."""

import ast
import runpy

import matplotlib.pyplot as plt
import pytest

from tests.house._repository import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))
# Half a minute of compilation for functions whose numbers are tested one by one in the quick suite.
SLOW = {
    "blade",
    "block_on_belt",
    "bristles",
    "corexy",
    "hunting",
    "identification",
    "jointed_beam",
    "own_corexy",
    "own_law",
    "periodic_orbits",
    "own_mechanism",
    "squeal",
    "your_printer",
}


def marks(path):
    return [pytest.mark.slow] if path.stem in SLOW else []


def test_there_are_notebooks():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_first_cell_keeps_what_is_compiled(path):
    text = path.read_text(encoding="utf-8")
    cells = [cell for cell in text.split("\n# %%")[1:] if not cell.startswith(" [markdown]")]
    assert "\nss.enable_compilation_cache()" in cells[0]


def test_a_mechanism_of_ones_own_takes_25_lines():
    text = (ROOT / "notebooks" / "own_mechanism.py").read_text(encoding="utf-8")
    (declared,) = (node for node in ast.parse(text).body if isinstance(node, ast.ClassDef))
    assert declared.end_lineno is not None
    assert declared.end_lineno - declared.lineno + 1 <= 25


@pytest.mark.more
@pytest.mark.usefixtures("standard_dtype_promotion")  # as in a reader's session: some call optax
@pytest.mark.parametrize(
    "path", [pytest.param(path, id=path.stem, marks=marks(path)) for path in NOTEBOOKS]
)
def test_notebook(path, monkeypatch):
    monkeypatch.setenv("NOTEBOOK_QUICK", "1")
    monkeypatch.setenv("STICKSLIP_EXECUTOR", "portable")
    # A cell shows its picture when it is run in Jupyter; here the pictures are only made.
    try:
        done = runpy.run_path(str(path))
    finally:
        plt.close("all")
    assert done["QUICK"] is True
