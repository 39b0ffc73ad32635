"""The branch of the smooth block: the same doubling by shooting with SciPy, and by AUTO if present."""

import math

import numpy as np
import pytest

from experiments.benchmarks import _orbits_auto, orbits
from experiments.benchmarks._diagram_job import plain_field, set_a
from experiments.benchmarks._harness import absent


def test_the_equations_in_words_are_those_of_the_field():
    """What is written down for AUTO, computed again."""
    lines = _orbits_auto.model(set_a(), 80.0).splitlines()
    rates = [line.partition("'=")[2] for line in lines if "'=" in line]
    state, k3 = (0.05, -0.01, 0.3, -0.2), 81.0
    values = dict(zip("xyuv", state, strict=True), k3=k3)
    functions = {"abs": abs, "tanh": math.tanh, "cosh": math.cosh}
    found = [eval(rate, {"__builtins__": {}}, {**functions, **values}) for rate in rates]
    np.testing.assert_allclose(found, plain_field(set_a())(0.0, state, k3), rtol=1e-13)


@pytest.mark.slow
def test_all_ways_lead_to_one_doubling():
    rows = orbits.compare(with_auto=not absent("xpplab"))
    assert len(rows) >= 2
    for row in rows:
        assert row["flip"] == pytest.approx(81.1341060, abs=1e-6)
        assert abs(row["off"]) < 1e-6
        assert row["period"] < 1e-6
        assert row["orbits"] > 10
