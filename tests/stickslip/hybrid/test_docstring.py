"""The examples in the docstrings of the classes to derive from run as they stand and are right."""

import contextlib
import doctest
import importlib
import inspect
import io
import re

import pytest

import stickslip as ss
from tests.stickslip.hybrid._systems import stick_slip_motion


def test_writing_ones_own_system():
    text = inspect.getdoc(ss.AbstractHybridSystem)
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) < 45
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(code, "docstring", "exec"), {"__name__": "example"})
    x, times = stick_slip_motion(50.0, 0.2)
    number, events = re.fullmatch(r"x\(50\) = (\S+) after (\d+) events\n", printed.getvalue()).groups()
    assert abs(float(number) - x) < 1e-9
    assert int(events) == len(times)


@pytest.mark.more
@pytest.mark.parametrize("module", ["_smooth", "_wrapper"])
def test_examples(module):
    failed, tried = doctest.testmod(importlib.import_module(f"stickslip.hybrid.{module}"))
    assert failed == 0
    assert tried > 5
