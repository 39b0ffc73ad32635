"""A fit is traced once for a problem, whatever its start and its data."""

from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest

from stickslip import AbstractSmoothSystem, _compiled_once
from stickslip.identification import Observed, Problem, Record


class Place(NamedTuple):
    x: Any


class Decay(AbstractSmoothSystem):
    rate: Any

    units: ClassVar = {"x": "1"}

    def vector_field(self, t, y, mode, args):
        return Place(-self.rate * y.x)


TIMES = np.linspace(0.0, 2.0, 9)


def record(rate):
    return Record(TIMES, {"x": np.exp(-rate * TIMES)}, begin=0.0)


@pytest.mark.more
def test_a_further_fit_is_not_traced(monkeypatch):
    made = Problem(
        lambda p, inputs: Decay(p["rate"]), lambda p, inputs: Place(1.0), {"rate": 1.0},
        {"x": Observed(lambda t, y, system: y.x, 1e-3)}, record(0.8),
    )  # fmt: skip
    assert float(made.fit().values["rate"]) == pytest.approx(0.8, rel=1e-7)

    def no_more(*_):
        raise AssertionError("traced again")

    monkeypatch.setattr(_compiled_once, "closed_jaxpr", no_more)
    # Other data, another start: nothing of the first fit is left in the program.
    other = made.with_records(record(1.7))
    found = other.fit(start={"rate": 0.5})
    assert float(found.values["rate"]) == pytest.approx(1.7, rel=1e-7)
    np.testing.assert_allclose(found.residual, other.residual(found.values), atol=1e-9)
    assert int(found.steps) > 2
