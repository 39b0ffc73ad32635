"""Nonsense is refused by name, value and what is allowed, within a second, never from inside JAX."""

import re
import subprocess
import sys

import pytest

from tests.house._repository import ROOT

# Arguments whose nonsense is refused, if at all, by an error that does not say what is wrong.
KNOWN = {
    "Integrator(step", "Section(direction", "map_lanes(inputs", "map_lanes(workers",
    "orbit_diagram(domain", "orbit_diagram(labels", "orbit_diagram(mode0", "orbit_diagram(settings",
    "orbit_diagram(y0", "simulate(integrator", "simulate(mode0", "simulate(saveat",
    "simulate(sections", "simulate(t0", "simulate(t1", "simulate(y0",
}  # fmt: skip


def nonsense(examples: int, *words: str) -> dict[str, str]:
    """What is wrong, by function and argument."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.house._nonsense", str(examples), *words],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(re.findall(r"^([\w-]+\(\w+)=\.\.\.\): (.*)$", done.stdout, flags=re.MULTILINE))


def test_nonsense_is_refused_properly():
    found = nonsense(12)
    assert {where: words for where, words in found.items() if where not in KNOWN} == {}


@pytest.mark.slow
def test_nonsense_for_the_analyses_is_refused_properly():
    assert nonsense(12, "analyses") == {}
