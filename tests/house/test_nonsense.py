"""Nonsense is refused by name, value and what is allowed, within a moment, never from inside JAX."""

import json
import os
import subprocess
import sys

import pytest

from tests.house._repository import ROOT

ENOUGH = 20  # kinds of nonsense for every argument


def run(*arguments: str) -> str:
    """What a fresh process of the walk prints."""
    # Hundreds of programs that run once: they need no optimisation.
    environment = {**os.environ, "JAX_DISABLE_MOST_OPTIMIZATIONS": "true"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", *arguments],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def walk(tmp_path, share: int) -> dict:
    """What was found and counted, one in `share` of the nonsense fed to each argument."""
    out = tmp_path / "found.json"
    run("-m", "tests.house._nonsense", str(share), str(out))
    return json.loads(out.read_text())


def test_the_walk_meets_every_public_argument():
    assert run("-c", "from tests.house._nonsense import missing; print(missing())") == "[]\n"


@pytest.mark.more
def test_nonsense_is_refused_properly(tmp_path):
    found = walk(tmp_path, 6)
    assert found["complaints"] == []
    assert found["counts"]["calls"] > 8 * found["counts"]["arguments"]


@pytest.mark.slow
def test_all_nonsense_is_refused_properly(tmp_path):
    found = walk(tmp_path, 1)
    assert found["complaints"] == []
    assert found["counts"]["calls"] >= ENOUGH * found["counts"]["arguments"]
