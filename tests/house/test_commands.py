"""The commands a user is told to type exist and refuse clearly."""

import contextlib
import io
import re
import shutil
import subprocess
import tomllib

import pytest
from packaging.requirements import Requirement

from experiments.__main__ import PAGES, main
from tests.house._repository import ROOT, make_targets

DOCUMENTS = (
    "README.md",
    "CONTRIBUTING.md",
    *sorted(f"notebooks/{path.name}" for path in (ROOT / "notebooks").glob("*.md")),
)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def code_in(document: str) -> str:
    """Fenced blocks and inline code; prose about "make sure" is no command."""
    text = (ROOT / document).read_text(encoding="utf-8")
    fenced = re.findall(r"^```.*?^```", text, flags=re.MULTILINE | re.DOTALL)
    return "\n".join(fenced + re.findall(r"`[^`\n]+`", text))


def listed_experiments() -> set[str]:
    """Names that `--list` prints first on a line; here, because a process of its own loads for long."""
    listing = io.StringIO()
    with contextlib.redirect_stdout(listing):
        assert main(["--list"]) == 0
    return {line.split()[0] for line in listing.getvalue().splitlines() if line.strip()}


def locked() -> list[Requirement]:
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    return [Requirement(line) for line in lines if line and not line.lstrip().startswith("#")]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_make_target_named_exists(document):
    named = set(re.findall(r"\bmake(?: [A-Z]+=\S+)* ([a-z][a-z-]*)", code_in(document)))
    assert named <= make_targets()


@pytest.mark.parametrize("target", sorted(make_targets()))
def test_every_make_target_parses(target):
    done = subprocess.run(
        ["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_every_experiment_named_exists():
    text = "\n".join(map(code_in, DOCUMENTS))
    named = set(re.findall(r"python -m experiments ([a-z][\w.-]*)", text))
    assert named <= listed_experiments() | {"all", "statements", *PAGES}


def test_an_old_interpreter_is_refused(tmp_path):
    """A stand-in that answers the version check as Python 3.10 would."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in ("requirements.lock", "pyproject.toml"):
        (tmp_path / name).touch()
    stub = tmp_path / "python-old"
    stub.write_text("#!/bin/sh\nexit 1\n")
    stub.chmod(0o755)
    done = subprocess.run(
        ["make", "test", f"PYTHON={stub}"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "Python 3.11 or newer is needed" in done.stderr
    assert not (tmp_path / ".venv").exists()


def test_lock_fits_the_declared_ranges():
    extras = PROJECT["project"]["optional-dependencies"]
    declared = [
        Requirement(text)
        for text in (
            PROJECT["project"]["dependencies"]
            + extras["test"]
            + extras["notebooks"]
            + extras["lint"]
            + PROJECT["dependency-groups"]["build"]
        )
    ]
    wrong = []
    for python in ("3.11", "3.12", "3.13"):
        here = {"python_version": python, "python_full_version": f"{python}.0"}
        pins = [pin for pin in locked() if pin.marker is None or pin.marker.evaluate(here)]
        for requirement in declared:
            if requirement.name == PROJECT["project"]["name"]:
                continue
            if requirement.marker is not None and not requirement.marker.evaluate(here):
                continue
            versions = [next(iter(p.specifier)).version for p in pins if p.name == requirement.name]
            if not versions or not all(requirement.specifier.contains(v) for v in versions):
                wrong.append((python, str(requirement), versions))
    assert wrong == []


def test_lock_names_versions_and_nothing_else():
    """Every line a plain pin: no index, no address, no path."""
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    assert not re.search(r"https?:|file:|--|@", text)
    assert all(len(pin.specifier) == 1 and "==" in str(pin.specifier) for pin in locked())


def test_lock_covers_the_oldest_and_the_newest_jax():
    versions = {next(iter(pin.specifier)).version for pin in locked() if pin.name == "jax"}
    assert {tuple(map(int, version.split(".")[:2])) for version in versions} == {(0, 10), (0, 12)}


def test_benchmark_peers_are_those_of_the_extra():
    declared = {Requirement(t).name for t in PROJECT["project"]["optional-dependencies"]["bench"]}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert set(re.search(r"^PEERS := (.*)$", makefile, re.MULTILINE)[1].split()) == declared


def test_continuous_integration_runs_the_quick_suite():
    script = ROOT / ".ci" / "run"
    assert script.stat().st_mode & 0o111
    text = script.read_text(encoding="utf-8")
    assert re.search(r"^make .*\btest$", text, re.MULTILINE)
    assert len(re.findall(r'^ +make .*\btest-more SHARE="\$share"', text, re.MULTILINE)) == 2


def test_licence_is_the_declared_one():
    assert PROJECT["project"]["license"] == "Apache-2.0"
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").split()[:2] == ["Apache", "License"]
