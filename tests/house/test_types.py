"""What type checkers tell users: nothing of a right script, and what is wrong with a wrong one."""

import importlib.util
import json
import os
import subprocess
import sys

import pytest

from tests.house._repository import ROOT

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("pyright") is None, reason="pyright is not installed"
)

WRONG = """\
import stickslip as ss
from stickslip import analysis, friction
from stickslip.systems import CoulombOscillator, Motion

block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
ss.FixedStep()
ss.FixedStep("a")
ss.AdaptiveStep(1e-3, wrong=1)
ss.Integrator("rk5")
ss.Integrator(step=1e-3)
ss.SaveAt(step=True)
ss.simulate(block, 0.0, 1.0, Motion(x=0.0, v=1.0), saveas=1)
ss.simulate(1.0, 0.0, 1.0, Motion(x=0.0, v=1.0))
ss.simulate(block, 0.0, 1.0, Motion(x=0.0, v=1.0)).event
ss.simulate(block, 0.0, 1.0, Motion(x=0.0, v=1.0)).events.guards
friction.Coulomb(0.3, 0.2, 0.1)
CoulombOscillator(1.0)
analysis.Recording()
analysis.Maximum()
block.unit
"""
FIRST_WRONG = 6


def errors(*files) -> list[dict]:
    """What pyright says of files by its own rules, those a user has who has set none."""
    out = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "--outputjson", *files],
        cwd=ROOT, capture_output=True, text=True, timeout=300,
        env={**os.environ, "PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"},
    )  # fmt: skip
    return json.loads(out.stdout[out.stdout.index("{") :])["generalDiagnostics"]


@pytest.mark.slow
def test_a_users_script_is_clean_without_ignores(tmp_path):
    script = ROOT / "tests" / "house" / "users_script.py"
    assert "ignore" not in script.read_text()
    wrong = tmp_path / "wrong.py"
    wrong.write_text(WRONG)
    found = errors(str(script), str(wrong))
    assert [e for e in found if e["file"] == str(script)] == []
    # And not because everything is `Any`: each wrong line is reported.
    lines = {e["range"]["start"]["line"] + 1 for e in found if e["severity"] == "error"}
    assert lines == set(range(FIRST_WRONG, WRONG.count("\n") + 1))
