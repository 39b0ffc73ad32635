"""Judgement of the diagrams on diagrams made up so that the answer is known."""

import numpy as np
import xarray as xr

from experiments._experiment import chosen, load
from experiments._thresholds import Block
from experiments.block._diagram import MODELS, protocols
from experiments.block._judge import (
    branches,
    chaos,
    is_chaos,
    judge_change,
    judge_models,
    judge_special,
)
from stickslip.analysis._orbit_lane import STATUS


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


def named(statements):
    return {f"{s.id} ({s.reading})": s.holds for s in statements}


def test_statements_of_a_known_diagram():
    data = made_up((80.0, 76.0, 84.0), ((90.0, 95.0), (85.0, 95.1), (93.0, 94.0)))
    assert chaos(data, MODELS[2])[1].sum() == 11
    holds = named(judge_models(data))
    assert [holds[f"B{n} (printed sign)"] for n in (3, 4, 6)] == [True, True, True]
    assert [holds[f"B{n} (consistent sign)"] for n in (3, 4)] == [False, False]


def test_what_cannot_be_told_is_left_open():
    data = made_up((80.0, 72.0, 84.0), ((90.0, 95.0),) * 3)
    coarse = data.isel(k3_exponent=slice(None, None, 25))
    holds = named(judge_models(coarse))
    assert holds["B3 (printed sign)"] is None


KNOWN = ((80.0, 76.0, 84.0), ((90.0, 95.0), (85.0, 95.1), (93.0, 94.0)))


def verdicts(data):
    found = judge_models(data)
    assert all(s.measured for s in found)
    return named(found)


def test_lanes_that_do_not_tell_leave_the_statements_open():
    data = made_up(*KNOWN)
    empty = data.assign(x=data.x * np.nan)
    failed = data.assign(status=data.status + STATUS.index("nonfinite"))
    slow = data.assign(slow_transient=~data.slow_transient)
    for nothing in (empty, failed, slow):
        found = verdicts(nothing)
        ids = [i for i in found if i[:2] == "B1"]
        assert len(ids) == 3
        assert {found[i] for i in ids} == {None}
    few = verdicts(data.isel(k3=slice(5)))
    assert {few[i] for i in few if i[:2] == "B1"} == {None}
    # Two kinds of lanes, and 60% told: there may be a third.
    part = data.status.where(data.k3 < 87.0, STATUS.index("left_domain")).astype(int)
    assert {s.holds for s in judge_change(data.assign(status=part))} == {None}
    assert {s.holds for s in judge_change(data)} == {False}


def test_exponents_that_do_not_tell_leave_the_statements_open():
    data = made_up(*KNOWN)
    lost = verdicts(data.assign(exponent=data.exponent * np.nan))
    vague = verdicts(data.assign(spread=data.spread + 1.0, exponent=data.exponent + 0.2))
    for name in ("B3", "B4", "B6"):
        for sign in ("printed", "consistent"):
            assert lost[f"{name} ({sign} sign)"] is None
            assert vague[f"{name} ({sign} sign)"] is None
    # Two untold exponents do not turn what differs by 5 N/m, nor do they move an end that is seen.
    two = data.exponent.where((data.k3_exponent < 80.0) | (data.k3_exponent > 80.15))
    found = verdicts(data.assign(exponent=two))
    assert [found[f"B{n} (printed sign)"] for n in (3, 4, 6)] == [True, True, True]
    # But beyond the last chaos they might: is 96.5 chaos too?
    beyond = data.exponent.where(abs(data.k3_exponent - 96.5) > 0.05)
    found = verdicts(data.assign(exponent=beyond))
    assert found["B4 (printed sign)"] is None
    assert found["B3 (printed sign)"] is True
    assert verdicts(data.isel(k3_exponent=[0]))["B3 (printed sign)"] is None
    wild, told = is_chaos(np.array([0.3, 0.1, 0.01, np.nan]), np.array([0.1, 0.2, 5.0, 0.0]))
    assert wild.tolist() == [True, False, False, False]
    assert told.tolist() == [True, False, True, False]


def test_branches_are_two_percent_of_the_span_apart():
    data = made_up(*KNOWN)
    x = np.array(data.x)
    x[0, 0, :, 1] = x[0, 0, :, 0] + 0.1 * (Block.APART + 1e-3)
    assert Block.APART == 0.02
    assert branches(data.assign(x=(data.x.dims, x)), MODELS[0]).max() == 3
    x[0, 0, :, 1] -= 0.1 * 2e-3
    assert branches(data.assign(x=(data.x.dims, x)), MODELS[0]).max() == 2


def test_phase_planes_at_the_special_stiffness():
    def judged(exponents, spread=0.0):
        data = xr.Dataset(
            {"exponent": ("model", exponents), "spread": ("model", np.full(3, spread))},
            {"model": list(MODELS)},
        )
        return [s.holds for s in judge_special(data)]

    assert judged([0.0, 0.3, 0.0]) == [True, False]
    assert judged([0.3, 0.3, 0.0]) == [False, False]
    assert judged([np.nan, 0.3, 0.0]) == [None, False]
    assert judged([0.0, np.nan, 0.3]) == [None, True]
    assert judged([0.0, 0.3, 0.01], spread=0.2) == [None, False]


def test_protocols():
    parameters = chosen(load()["block-fig02"], False, [])
    assert [p[:2] for p in protocols(parameters)] == [("paper", 15.0), ("converged", 200.0)]
    assert len(list(protocols({**parameters, "converged_duration": 0.0}))) == 1
    assert parameters["k3_step"] == 0.001
