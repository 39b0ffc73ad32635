"""Judgement of the diagrams on diagrams made up so that the answer is known."""

import numpy as np
import pytest
import xarray as xr

from experiments._experiment import chosen, load
from experiments.block._diagram import MODELS, protocols
from experiments.block._judge import chaos, first_doubling, judge_models


def made_up(doubling, chaotic):
    """Two points from `doubling` on, a positive exponent in the interval `chaotic`, per model."""
    k3 = np.linspace(72.0, 97.0, 251)
    x = np.zeros((len(MODELS), 1, k3.size, 4))
    exponent = np.full((len(MODELS), k3.size), -0.1)
    for i in range(len(MODELS)):
        x[i, 0, :, ::2] = np.where(k3 >= doubling[i], 0.1, 0.0)[:, None]
        exponent[i, (k3 >= chaotic[i][0]) & (k3 <= chaotic[i][1])] = 0.3
    lanes = ("model", "protocol", "k3")
    return xr.Dataset(
        {
            "x": ((*lanes, "point"), x),
            "status": (lanes, np.zeros(x.shape[:-1], int)),
            "slow_transient": (lanes, np.zeros(x.shape[:-1], bool)),
            "exponent": (("model", "k3_exponent"), exponent),
            "spread": (("model", "k3_exponent"), np.zeros_like(exponent)),
        },
        {"model": list(MODELS), "protocol": ["paper"], "k3": k3, "k3_exponent": k3},
    )


def test_statements_of_a_known_diagram():
    data = made_up((80.0, 76.0, 84.0), ((90.0, 95.0), (85.0, 95.1), (93.0, 94.0)))
    assert first_doubling(data, MODELS[1]) == pytest.approx(76.0)
    assert chaos(data, MODELS[2])[1].sum() == 11
    holds = {s.id: s.holds for s in judge_models(data)}
    assert [holds[f"B{n} (printed sign)"] for n in (2, 3, 4, 6)] == [True, True, True, True]
    assert [holds[f"B{n} (consistent sign)"] for n in (2, 3, 4)] == [False, False, False]


def test_what_cannot_be_told_is_left_open():
    data = made_up((80.0, 72.0, 84.0), ((90.0, 95.0),) * 3)
    coarse = data.isel(k3_exponent=slice(None, None, 25))
    holds = {s.id: s.holds for s in judge_models(coarse)}
    assert holds["B2 (printed sign)"] is None
    assert holds["B3 (printed sign)"] is None


def test_protocols():
    parameters = chosen(load()["block-fig02"], False, [])
    assert [p[:2] for p in protocols(parameters)] == [("paper", 15.0), ("converged", 200.0)]
    assert len(list(protocols({**parameters, "converged_duration": 0.0}))) == 1
    assert parameters["k3_step"] == 0.001
