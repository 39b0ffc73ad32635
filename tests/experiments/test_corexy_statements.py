"""The predicates of the statements on runs made up so that the answer is known."""

import numpy as np
import pytest
import xarray as xr

from experiments._experiment import Context, load
from experiments._statement import claims
from experiments.corexy._figure import judge_scenario
from experiments.corexy._view import READ, View

ALL = {claim.id: claim for claim in claims("S")}
T = np.linspace(0.0, 6.0, 6001)


def made_up(**changes) -> View:
    """A view of `run`."""
    return View(run(**changes))


def run(**changes) -> xr.Dataset:
    """A machine that rests while motors of 1 N m static friction see nothing, but for `changes`."""
    zero, pair = np.zeros(T.size), np.zeros((T.size, 2))
    data = {name: ("time", zero) for name in ("x", "y", "vx", "vy", "ax", "ay", "tau_x")}
    data |= {"dmn": ("time", np.ones(T.size, int)), "dead_x": ("time", zero + 3.0)}
    data |= {name: (("time", "motor"), pair) for name in ("omega", "omega_v", "tau_motor", "tau_belt")}
    data |= {"v": (("time", "motor"), pair), "dead_motor": (("time", "motor"), pair + 1.0)}
    data |= {"v_high": (("time", "motor"), pair + 0.45), "v_low": (("time", "motor"), pair - 0.45)}
    data["kinetic_belt"] = ("motor", np.array([0.4, 0.4]))
    for name, values in changes.items():
        data[name] = (data[name][0], values)
    return xr.Dataset(data, {"time": T})


def says(name: str, view: View) -> bool | None:
    return ALL[name]("made up", view).holds


def both(one, two):
    return np.stack(np.broadcast_arrays(one + 0 * T, two + 0 * T), axis=1)


def test_there_are_53_with_claims_and_measures():
    assert len(ALL) == 53
    for name, claim in ALL.items():
        assert name[:2] in ("S1", "S2", "S3")
        assert len(claim.text) > 10
        found = claim("made up", made_up())
        assert found.holds in (True, False)
        assert isinstance(found.measured, str)


def test_modes():
    late = np.where(T < 2.0, 1, 4)
    view = made_up(dmn=late)
    assert says("S1.01", view)
    assert not says("S1.02", view)
    assert says("S3.02", view)
    assert says("S3.03", view)
    assert says("S3.04", view)
    assert says("S3.14", view)
    assert not says("S2.01", view)
    assert not says("S1.21", view)
    slipping = made_up(dmn=np.full(T.size, 4))
    assert says("S2.01", slipping)
    assert says("S2.15", slipping)
    assert not says("S3.01", slipping)
    assert says("S1.18", slipping)
    assert not says("S1.19", slipping)
    assert says("S1.19", made_up(dmn=np.where(np.arange(T.size) % 2, 3, 4)))


def test_motion():
    moving = np.where((T > 0.1) & (T < 2.2), 1.0, 0.0)
    view = made_up(vx=moving, vy=moving, x=np.cumsum(moving) * 1e-3)
    assert says("S3.08", view)
    assert says("S3.06", view)
    assert not says("S3.08", made_up())
    assert says("S2.04", made_up())
    assert not says("S2.04", view)
    rests = np.where((T % 1.0) < 0.5, 0.0, 1.0)
    assert says("S1.09", made_up(vx=rests))
    assert not says("S1.09", made_up(vx=np.where(T > 0.1, 1.0, 0.0)))


def test_voltages():
    sine, cosine = np.sin(np.pi * T), np.cos(np.pi * T)
    view = made_up(v=both(10 * sine, 5 * cosine))
    assert says("S1.11", view)
    assert not says("S3.15", view)
    assert says("S1.14", view)
    square = made_up(v=both(20 * np.where(sine >= 0, 1.0, -1.0), 10 * np.where(cosine >= 0, 1.0, -1.0)))
    assert says("S3.15", square)
    assert says("S3.09", square)
    assert not says("S1.11", square)
    assert not says("S3.15", made_up(v=both(20.0, 10.0)))


def test_torques():
    slipping = np.full(T.size, 4)
    view = made_up(dmn=slipping, tau_belt=both(0.4, -0.4))
    assert says("S2.14", view)
    assert says("S1.16", view)
    assert not says("S2.14", made_up(dmn=slipping, tau_belt=both(0.4, 0.3)))
    half = np.where(T < 2.0, 1, 4)
    transferred = np.where(T < 2.0, 10.0, 0.4)
    view = made_up(dmn=half, tau_belt=both(transferred, transferred))
    assert says("S1.17", view)
    assert says("S3.11", view)
    assert not says("S1.17", made_up(dmn=half, tau_belt=both(1.0, 1.0)))


def judged(data: xr.Dataset) -> dict[str, bool | None]:
    found = [
        s for number in (1, 2, 3) for s in judge_scenario(number, data.expand_dims(way=["made up"]))
    ]
    assert all(isinstance(s.measured, str) and s.measured for s in found)
    return {s.id: s.holds for s in found}


@pytest.mark.parametrize("name", READ)
def test_a_run_that_is_not_finite_tells_nothing(name):
    """One NaN in anything that the statements read, at the end, as of a run that broke down."""
    data = run()
    if data[name].dtype.kind != "f":
        return
    values = np.array(data[name])
    values[-1] = np.nan
    assert set(judged(run(**{name: values})).values()) == {None}


def test_a_run_that_is_empty_or_short_tells_nothing_of_what_it_lacks():
    for rows in (0, 1, 9):
        assert set(judged(run().isel(time=slice(rows))).values()) == {None}
    # After one second nothing that the paper says of 2 s and later can hold or fail.
    early = judged(run(dmn=np.full(T.size, 4)).sel(time=slice(0.0, 1.0)))
    late = ("S1.13", *(f"S3.{n:02d}" for n in (3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 15)))
    assert [early[name] for name in late] == [None] * len(late)
    assert early["S2.01"] is True
    assert early["S3.01"] is False


def test_rows_too_far_apart_do_not_show_a_millisecond():
    coarse = judged(run().isel(time=slice(None, None, 5)))
    named = ("S1.02", "S1.09", "S1.12", "S2.09", "S2.10", "S2.11")
    assert [coarse[name] for name in named] == [None] * len(named)
    assert coarse["S3.08"] is False


# Truth values of an independent fixed-step study, which the runs must meet, and where they do not
# because they resolve more finely; see the statements' measures.
CONSISTENT = {
    "S1": "xx..x.xxxxxxxx.xxx.x.",
    "S2": "xxxx....xxxxxxxx.",
    "S3": ".......xx.....x",
}


@pytest.mark.slow
@pytest.mark.parametrize(("figure", "scenario"), [("04", "S1"), ("07", "S2"), ("10", "S3")])
def test_consistent_runs_agree_with_an_independent_study(figure, scenario, tmp_path):
    experiment = load()[f"corexy-fig{figure}"]
    data = experiment.compute(dict(experiment.parameters), Context(tmp_path))
    found = {s.id: s.holds for s in experiment.judge(data) if s.reading == "consistent"}
    word = "".join("x" if found[name] else "." for name in sorted(found))
    assert word == CONSISTENT[scenario]
