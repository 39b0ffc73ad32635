"""A notebook shows how far a long call is, below the cell that makes it, and nothing of a short one."""

import jupytext
import nbclient
import pytest

SOURCE = """# %%
import time

import numpy as np

import stickslip as ss


def slow(k):
    time.sleep(2.0)  # while it is traced
    return k


grid, compute = {"k": np.linspace(0.0, 1.0, 10)}, ss.sweep.Compute("portable")

# %%
found = ss.sweep.run_sweep(slow, grid, compute=compute)

# %%
found = ss.sweep.run_sweep(lambda k: k, grid, compute=compute)
"""


@pytest.mark.more
def test_a_notebook_shows_progress(monkeypatch):
    monkeypatch.setenv("STICKSLIP_PROGRESS", "on")
    notebook = jupytext.reads(SOURCE, fmt="py:percent")
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    first, second, third = (cell.outputs for cell in notebook.cells)
    assert not first
    assert not third
    assert {output.name for output in second} == {"stderr"}
    lines = "".join(output.text for output in second).replace("\n", "\r").split("\r")
    said = [line.strip() for line in lines if line]
    assert any(line.startswith("sweep: compiling ..., 0:0") for line in said)
    assert said[-1].startswith("sweep: 10 of 10 lanes (100%), ")
