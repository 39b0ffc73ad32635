"""What is shipped: the two libraries, their marks of types, nothing else in site-packages."""

import re
import subprocess
import sys
import tarfile
import zipfile

import pytest

import stickslip
from tests.house._repository import ROOT

# What makes an archive in a process of its own, as an installer does.
BUILD = "import sys, hatchling.build as b; print(getattr(b, sys.argv[1])(sys.argv[2]))"


def built(kind, folder):
    done = subprocess.run(
        [sys.executable, "-c", BUILD, f"build_{kind}", str(folder)],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return folder / done.stdout.strip().splitlines()[-1]


def test_the_wheel_holds_the_two_libraries_only(tmp_path):
    pytest.importorskip("hatchling", reason="the build backend is there after `make setup`")
    with zipfile.ZipFile(built("wheel", tmp_path)) as wheel:
        names = wheel.namelist()
    tops = {name.split("/")[0] for name in names}
    information = {top for top in tops if top.endswith(".dist-info")}
    assert tops - information == {"stickslip", "corexy_jax"}
    assert len(information) == 1
    assert {"stickslip/py.typed", "corexy_jax/py.typed", "stickslip/__main__.py"} <= set(names)
    assert not any("test" in name or name.endswith((".ipynb", ".nc")) for name in names)


def test_the_source_archive_can_be_built_from(tmp_path):
    pytest.importorskip("hatchling", reason="the build backend is there after `make setup`")
    with tarfile.open(built("sdist", tmp_path)) as source:
        names = {name.split("/", 1)[1] for name in source.getnames() if "/" in name}
    wanted = {"pyproject.toml", "README.md", "LICENSE", "CITATION.cff", "Makefile"}
    assert wanted <= names
    assert "tests/house/test_packaging.py" in names
    assert not any(name.startswith((".venv", "results", "shared")) for name in names)


def test_one_version():
    text = (ROOT / "CITATION.cff").read_text()
    assert re.search(r"^version: (.*)$", text, re.M)[1] == stickslip.__version__
