"""Nonsense is refused by name, value and what is allowed, within a second, never from inside JAX."""

import subprocess
import sys

import pytest

from tests.house._repository import ROOT


def nonsense(examples: int, *words: str) -> str:
    """What is wrong, a line for each function and argument."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.house._nonsense", str(examples), *words],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_nonsense_is_refused_properly():
    assert nonsense(12) == ""


@pytest.mark.slow
def test_much_nonsense_is_refused_properly():
    assert nonsense(200) == ""


@pytest.mark.slow
@pytest.mark.parametrize("what", ["analyses", "machine"])
def test_nonsense_for_the_analyses_and_the_machine_is_refused_properly(what):
    assert nonsense(12, what) == ""
