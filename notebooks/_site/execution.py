"""Notebooks, executed and kept beside their scripts: `make notebooks` does it, and pages show them."""

import datetime
import hashlib
import os
import subprocess
import sys
import time
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

from tests._compiler import xla_flags

FOLDER = Path(__file__).parents[1]
ROOT = FOLDER.parent
PACKAGES = ("stickslip", "corexy_jax", "experiments")
_QUICK = {"NOTEBOOK_QUICK": "1", "STICKSLIP_EXECUTOR": "portable"}
# Optimised, unlike the tests: a map of basins runs for twice as long as it compiles.
_CHEAP = {"XLA_FLAGS": " ".join(xla_flags())}


def read(text: str) -> nbformat.NotebookNode:
    """The notebook of a script with outputs: those kept of the same code, or of a quick execution."""
    script = next(p for p in FOLDER.glob("*.py") if p.read_text(encoding="utf-8") == text)
    notebook = jupytext.reads(text, fmt="py:percent")
    kept = _kept(script)
    if kept is None or _sources(kept) != _sources(notebook):
        kept = execute(script, quick=True)
    # Words may have changed since; outputs belong to the code alone.
    for cell, done in zip(_code_cells(notebook), _code_cells(kept), strict=True):
        cell.outputs = done.outputs
    notebook.cells.append(nbformat.v4.new_markdown_cell(_said_of(kept.metadata["execution"])))
    return notebook


def execute(script: Path, *, quick: bool) -> nbformat.NotebookNode:
    """Execute a script with cells, keep it as `.ipynb`, and say how long it took."""
    notebook = jupytext.read(script, fmt="py:percent")
    size = "quick" if quick else "full"
    print(f"{script.name}: executing at {size} size ...", flush=True)
    begin = time.monotonic()
    environment = {k: v for k, v in os.environ.items() if k not in _QUICK}
    environment |= {"PYTHONPATH": str(ROOT)} | (_QUICK | _CHEAP if quick else {})
    client = NotebookClient(notebook, timeout=None, resources={"metadata": {"path": str(FOLDER)}})
    # The kernel's own log; errors of the notebook are raised here.
    client.execute(env=environment, stderr=subprocess.DEVNULL)
    seconds = round(time.monotonic() - begin)
    for cell in _code_cells(notebook):
        hidden = any(tag.startswith("remove-") for tag in cell.metadata.get("tags", ()))
        shown = [output for output in cell.outputs if output.get("name") != "stderr"]
        cell.outputs = [] if hidden else shown
    today = datetime.date.today().isoformat()
    told = {"size": size, "seconds": seconds, "date": today, "library": library()}
    notebook.metadata["execution"] = told
    temporary = script.with_suffix(".part")
    nbformat.write(notebook, temporary)
    os.replace(temporary, script.with_suffix(".ipynb"))
    print(f"{script.name}: {seconds} s", flush=True)
    return notebook


def library() -> str:
    """A digest of all code that a notebook may import from the checkout."""
    digest = hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _kept(script: Path) -> nbformat.NotebookNode | None:
    path = script.with_suffix(".ipynb")
    kept = nbformat.read(path, as_version=4) if path.exists() else None
    # Others, written by Jupyter, do not say how they were made.
    return kept if kept is not None and "execution" in kept.metadata else None


def _code_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def _sources(notebook: nbformat.NotebookNode) -> list[str]:
    return [cell.source for cell in _code_cells(notebook)]


def _said_of(execution: dict) -> str:
    since = "" if execution["library"] == library() else " The library has changed since."
    size = (
        "as it stands here"
        if execution["size"] == "full"
        else "at its quick size, with fewer and shorter runs than the code says; `make notebooks` "
        "executes it as it stands"
    )
    return f"---\n*Executed on {execution['date']} in {execution['seconds']} s, {size}.{since}*"


def main() -> None:
    """Execute every notebook whose code, or whose library, is not that of the outputs kept."""
    for script in sorted(FOLDER.glob("*.py")):
        kept = _kept(script)
        now = ("full", library(), _sources(jupytext.read(script, fmt="py:percent")))
        if kept is not None and now == (*_size_and_library(kept), _sources(kept)):
            print(f"{script.name}: kept")
        else:
            execute(script, quick=False)


def _size_and_library(kept: nbformat.NotebookNode) -> tuple[str, str]:
    return kept.metadata["execution"]["size"], kept.metadata["execution"]["library"]


if __name__ == "__main__":
    sys.exit(main())
