"""The commands that the pages tell a user to type are run as they stand there, at quick size."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from experiments._experiment import load
from tests.house._repository import ROOT

FAMILIES = ("animate", "block", "corexy", "identify", "beam", "mechanism")
RESULTS = (ROOT / "experiments" / "RESULTS.md").read_text(encoding="utf-8")


def run(arguments, out):
    """In a process of its own, compiled as for a user; programs are kept beside the results."""
    environment = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"}
    environment["JAX_COMPILATION_CACHE_DIR"] = str(out / "compiled")
    done = subprocess.run(
        [sys.executable, "-m", "experiments", *arguments, "--out", str(out)],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def check_files(name, out):
    """Picture, data with numbers in them, and the record."""
    for kind in ("png", "svg"):
        assert (out / f"{name}.{kind}").stat().st_size > 1000
    with xr.open_dataset(out / f"{name}.nc", engine="h5netcdf") as data:
        numbers = [v.values for v in data.values() if v.dtype.kind == "f"]
        assert any(np.isfinite(v).any() for v in numbers)
    assert json.loads((out / f"{name}.json").read_text())["name"] == name


def test_every_experiment_belongs_to_a_family_and_is_on_the_page_of_results():
    _, _, missing = RESULTS.partition("Not run for this page: ")
    named = set(re.findall(r"`([\w.-]+)`", missing.splitlines()[0])) if missing else set()
    named |= set(re.findall(r"`python -m experiments ([a-z][\w.-]*)[^`]*`", RESULTS))
    assert set(load()) <= named
    assert all(name.split("-")[0] in FAMILIES for name in load())


@pytest.mark.more
def test_demo(tmp_path):
    """What `make demo` runs, on eleven values of k3."""
    dry = subprocess.run(
        ["make", "--dry-run", "demo"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert any(line.endswith("-m experiments demo") for line in dry.splitlines())
    told = run(["demo", "--set", "k3_step=2.5"], tmp_path)
    assert "wrote" in told
    check_files("demo", tmp_path)
    with xr.open_dataset(tmp_path / "demo.nc", engine="h5netcdf") as data:
        np.testing.assert_allclose(data.k3, np.linspace(72.0, 97.0, 11))
        assert (data["count"] > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_every_figure_at_quick_size(family, tmp_path):
    names = [name for name in load() if name.startswith(f"{family}-")]
    assert names
    for name in names:
        if load()[name].brought and not os.environ.get("STICKSLIP_DATA"):
            continue  # its own tests say so by a skip
        run([name, "--quick"], tmp_path)
        check_files(name, tmp_path)
    if family == "animate":
        assert len(list(tmp_path.glob("*.gif"))) == len(names)
    elif family != "identify":
        assert "holds" in run(["statements"], tmp_path)
