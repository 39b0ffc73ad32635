"""Outputs of notebooks are kept with their code, and pages show nothing of the plumbing."""

import importlib
import re

import jupytext
import nbformat
import pytest

from tests.house._repository import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))
SCRIPT = """# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A page

# %%
import os, sys
print("quick", os.environ.get("NOTEBOOK_QUICK"))
print("progress", file=sys.stderr)
"""


@pytest.fixture
def execution(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "notebooks" / "_site")
    module = importlib.import_module("execution")
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    return module


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_readers_see_no_plumbing(path):
    for cell in jupytext.read(path, fmt="py:percent").cells:
        if "remove-cell" not in cell.metadata.get("tags", ()):
            assert re.findall(r"QUICK|\bassert\b|assert_allclose", cell.source) == []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_pages_show_what_the_code_says_at_full_size(path):
    """Where a cell was changed, `make notebooks` executes its notebook again."""
    kept = nbformat.read(path.with_suffix(".ipynb"), as_version=4)
    assert kept.metadata["execution"]["size"] == "full"
    now = jupytext.read(path, fmt="py:percent")
    sources = [
        [cell.source for cell in notebook.cells if cell.cell_type == "code"] for notebook in (kept, now)
    ]
    assert sources[0] == sources[1]


@pytest.mark.more
@pytest.mark.filterwarnings("ignore")  # of the kernel's sockets and loops
def test_outputs_are_kept_until_the_code_changes(execution, tmp_path, capsys):
    script = tmp_path / "page.py"
    script.write_text(SCRIPT, encoding="utf-8")
    for size, given in (("quick", "1"), ("full", "None")):
        if size == "full":
            execution.main()
        page = execution.read(script.read_text(encoding="utf-8"))
        assert [output.text for output in page.cells[1].outputs] == [f"quick {given}\n"]
        assert ("its quick size" in page.cells[-1].source) == (size == "quick")
        assert "library has changed" not in page.cells[-1].source
    execution.main()
    # Other words are shown at once, with the outputs there are.
    script.write_text(SCRIPT.replace("A page", "Other words"), encoding="utf-8")
    page = execution.read(script.read_text(encoding="utf-8"))
    assert page.cells[0].source == "# Other words"
    assert page.cells[1].outputs[0].text == "quick None\n"
    told = capsys.readouterr().out
    assert told.count("executing at quick size") == told.count("executing at full size") == 1
    assert told.count("page.py: kept") == 1
    script.write_text(SCRIPT.replace('"quick"', '"again"'), encoding="utf-8")
    assert execution.read(script.read_text(encoding="utf-8")).cells[1].outputs[0].text == "again 1\n"
