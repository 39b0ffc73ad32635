"""The block's map over k3 and the belt speed: lanes, places beside curves, judgement, picture."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

from experiments import __main__ as command
from experiments._experiment import Context, chosen, load
from experiments.block import _map
from experiments.block._draw_map import KINDS, draw_map, kinds_of
from experiments.block._judge_map import judge_map
from experiments.block._map import (
    FAILED,
    IRREGULAR,
    RESTS,
    UNTOLD,
    alternation_changes,
    motion_of,
    seconds_of,
    settled_motions,
)
from experiments.block._map_branches import intervals, side_of, trusted
from experiments.block._map_curves import as_table, followed
from experiments.block._map_plane import beside, bounds_of, cell_of
from stickslip.analysis import STATUS

T = 0.8  # s


def test_lanes_lie_beside_a_curve_on_the_side_that_its_direction_says():
    cell = np.array([2.0, 0.1])
    line = np.array([[0.0, 0.0], [10.0, 0.5], [20.0, 1.0]])  # in cells from (0, 0) to (10, 10)
    lanes = np.array([[0.0, 1.0], [20.0, 0.0], [10.0, 0.5], [22.0, 1.2], [-2.0, -0.1], [20.0, 0.9]])
    found = beside(line, lanes, cell)
    root = np.sqrt(2.0)
    np.testing.assert_allclose(
        found.distance, [10 / root, 10 / root, 0, np.hypot(1, 2), root, 1 / root]
    )
    np.testing.assert_array_equal(found.side[[0, 1, 2, 5]], [1, -1, 0, -1])
    np.testing.assert_array_equal(found.beyond, [False, False, False, True, True, False])
    assert found.segment[5] == 1
    turned = beside(line[::-1], lanes, cell)
    np.testing.assert_array_equal(turned.side, -found.side)
    # A closed curve has no end to be beyond of.
    angle = np.linspace(0.0, 2.0 * np.pi, 65)
    circle = np.stack([20.0 * np.cos(angle), np.sin(angle)], axis=1)
    inside = beside(circle, np.array([[0.5, 0.0], [22.0, 0.0], [22.0, 0.05], [19.0, -0.01]]), cell)
    np.testing.assert_array_equal(inside.side, [1, -1, -1, 1])
    assert not inside.beyond.any()
    assert not beside(line[:1], lanes, cell).side.any()  # a point has no sides
    np.testing.assert_array_equal(cell_of(np.array([70.0, 72.0, 74.0]), np.array([0.1])), [2.0, 0.0])


def made_up(at=80.0, side=1, *, lanes_at=80.0, paper=((80.0, 80.0),)):
    """A straight curve at a k3; lanes of one period up to `lanes_at`, of two from there on."""
    k3, speed = np.linspace(60.0, 100.0, 41), np.linspace(0.05, 0.15, 11)
    two = np.broadcast_to((k3 > lanes_at)[:, None], (41, 11))
    motion = np.where(two, 2, 1).astype(np.int32)
    along = [(0, at, v, T, 1.0) for v in np.linspace(0.0, 0.2, 9)]
    curves = [("PD", 0, at, 0.1, side)]
    tips = [(0, at, 0.0, "bounds of V_b"), (0, at, 0.2, "R2: a second multiplier is -1")]
    table = xr.Dataset({
        f"{axis}_{key}": (axis, [row[i] for row in rows])
        for axis, keys, rows in (
            ("along", ("curve", "k3", "V_b", "period", "largest"), along),
            ("curve", ("label", "level", "k3", "V_b", "side"), curves),
            ("tip", ("curve", "k3", "V_b", "words"), tips),
            ("paper", ("by_branch", "by_curve"), paper),
        )
        for i, key in enumerate(keys)
    })  # fmt: skip
    lanes = {
        "motion": (("k3", "V_b"), motion),
        "seconds": (("k3", "V_b"), np.where(two, 2 * T, T)),
    }
    return table.assign(lanes).assign_coords(k3=k3, V_b=speed).assign_attrs(caption="", curves="1")


def verdicts(data):
    return {s.id: s.holds for s in judge_map(data)}


def test_lanes_are_judged_by_the_side_of_the_curve():
    assert verdicts(made_up()) == {"X3": True, "X4": True, "X5": True}
    # A curve three cells off, the wrong side, another family of orbits.
    assert verdicts(made_up(at=77.0)) == {"X3": False, "X4": False, "X5": True}
    assert verdicts(made_up(at=83.0)) == {"X3": True, "X4": False, "X5": True}
    assert verdicts(made_up(side=-1))["X3"] is False
    other = made_up(lanes_at=200.0)
    other["seconds"][:] = 1.4 * T
    assert verdicts(other)["X3"] is True


def test_lanes_near_the_curve_and_slow_ones_are_counted_apart():
    data = made_up(at=80.4)  # 80 and 81 are nearer than a cell
    data["motion"].loc[{"k3": [80.0, 81.0]}] = 1
    data["motion"].loc[{"k3": 85.0}] = UNTOLD
    assert verdicts(data)["X3"] is True
    words = judge_map(data)[0].measured
    assert "22 lanes nearer than a cell, 11 not settled" in words
    data["motion"][22, 5] = 1
    data["seconds"][22, 5] = T
    assert verdicts(data)["X3"] is False


def test_doublings_at_the_paper_speed_must_agree():
    assert verdicts(made_up(paper=((81.0, 81.0 + 9e-6),)))["X5"] is True
    assert verdicts(made_up(paper=((81.0, 81.0 + 2e-5),)))["X5"] is False
    assert verdicts(made_up(paper=((81.0, 81.0), (114.0, np.nan))))["X5"] is False
    none = made_up().isel(paper=slice(0))
    assert verdicts(none)["X5"] is None


def without_curves(reason="none: no lane leads to a branch"):
    data = made_up()
    return data[["motion", "seconds"]].merge(as_table([], [], 0.1)).assign_attrs(
        caption="lanes", curves=reason
    )  # fmt: skip


def test_without_curves_nothing_is_claimed_and_the_lanes_are_drawn():
    data = without_curves()
    assert verdicts(data) == {"X3": None, "X4": None, "X5": None}
    assert "no lane leads to a branch" in judge_map(data)[0].measured
    assert verdicts(made_up(side=0))["X3"] is None
    plt.close(draw_map(data))


def test_the_picture_marks_named_ends_alone():
    figure = draw_map(made_up())
    texts = [text.get_text() for text in figure.axes[0].texts]
    plt.close(figure)
    assert texts == ["R2"]
    motions = np.array([FAILED, UNTOLD, RESTS, IRREGULAR, 1, 2, 3, 4, 5, 7, 8, 9, 16])
    words = [list(KINDS)[k] for k in kinds_of(motions)]
    assert words == [
        "failed", "not told", "rests", "irregular", "1", "2", "3", "4", "5 to 7", "5 to 7", "8",
        "9 to 16", "9 to 16",
    ]  # fmt: skip


def lanes(**columns):
    """Lanes of an orbit diagram over five k3 at one belt speed."""
    size = len(columns["status"])
    given = {
        "end_vx": [0.1] * size,
        "end_vy": [0.0] * size,
        "slow_transient": [False] * size,
        "count": [0] * size,
        **columns,
    }
    codes = [STATUS.index(word) for word in given.pop("status")]
    belt = given.pop("belt", 0.1)
    data: dict[str, Any] = {
        key: (("k3", "V_b"), np.array(values)[:, None]) for key, values in given.items()
    }
    data["status"] = (("k3", "V_b"), np.array(codes)[:, None])
    data["x"] = (("k3", "V_b", "point"), np.full((size, 1, 4), np.nan))
    return xr.Dataset(data, {"V_b": [belt], "k3": np.arange(float(size))})


def test_each_lane_has_a_code():
    words = ["ok", "buffer_full", "not_settled", "nonfinite", "no_crossing", "max_steps_reached", "ok"]
    found = motion_of(lanes(status=words, period=[2, 0, 1, -1, -1, 3, -1], slow_transient=[False] * 2
                            + [True] + [False] * 4))  # fmt: skip
    assert found[:, 0].tolist() == [2, IRREGULAR, UNTOLD, FAILED, UNTOLD, FAILED, UNTOLD]
    # At rest: without a crossing, or with points that say that it has a period.
    still = {"end_vx": [1e-5, 1e-5, 1e-5, 2e-4], "period": [1, -1, 1, 1]}
    words = ["ok", "no_crossing", "nonfinite", "ok"]
    assert motion_of(lanes(status=words, **still))[:, 0].tolist() == [RESTS, RESTS, FAILED, 1]
    # A belt that stands drives nothing; one that hardly moves may carry the block along.
    standing = {"end_vx": [1e-9], "period": [-1], "status": ["no_crossing"]}
    assert motion_of(lanes(**standing, belt=0.0))[0, 0] == RESTS
    assert motion_of(lanes(**standing, belt=1e-9))[0, 0] == UNTOLD


def test_an_alternation_that_decays_is_not_a_period_of_two():
    """As beside a doubling, where points of one period come together slowly."""
    n = np.arange(60)
    swing = 0.01 * (-1.0) ** n
    x = np.stack([swing, swing * 0.999**n, swing * 1.001**n, swing * (n % 4 < 2), 0.0 * n, swing])
    data = lanes(status=["ok"] * 6, period=[2, 2, 2, 4, 1, 2], count=[60] * 5 + [40])
    x[5, 40:] = np.nan
    data["x"] = (("k3", "V_b", "point"), 0.03 + x[:, None, :])
    changes = 1.0 - 0.999**57
    np.testing.assert_allclose(
        alternation_changes(data)[:, 0], [0, changes, 1 - 1.001**-57, 0, 0, 0], atol=2e-3
    )
    assert motion_of(data)[:, 0].tolist() == [2, UNTOLD, UNTOLD, 4, 1, 2]


def test_the_period_is_the_time_of_the_last_points():
    data = lanes(status=["ok"] * 4, period=[1, 2, 0, -1], count=[4, 3, 4, 0])
    times = np.array([[1.0, 2.0, 3.0, 4.5], [1.0, 2.0, 4.0, np.nan], [1, 2, 3, 4], [np.nan] * 4])
    data["t"] = (("k3", "V_b", "point"), times[:, None, :])
    np.testing.assert_array_equal(seconds_of(data)[:, 0], [1.5, 3.0, np.nan, np.nan])


class Followed(SimpleNamespace):
    """What is asked of a branch."""

    def __len__(self):
        return self.values.size


def test_points_beyond_a_leap_to_another_branch_are_not_trusted():
    def point(index, period, label="PD"):
        orbit = SimpleNamespace(period=period)
        return SimpleNamespace(label=label, index=index, orbit=orbit, value=float(index))

    orbits = SimpleNamespace(
        period=np.array([1.6, 1.59, 1.58, 0.79, 0.78]),
        stable=np.array([True, True, False, False, True]),
    )
    specials: list[Any] = [point(0, 1.6), point(1, 1.585), point(2, 0.8, "EP"), point(3, 0.785)]
    values = np.array([70.0, 71.0, 72.0, 73.0, 72.5])
    branch: Any = Followed(orbits=orbits, specials=specials, values=values)
    assert [p.index for p in trusted(branch)] == [0, 1]
    assert [side_of(branch, p) for p in specials] == [0, 1, 0, 1]


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (["columns=1"], "--set columns=1: it must be from 2 to"),
        (["rows=1"], "--set rows=1: it must be from 2 to"),
        (["k3_min=120", "k3_max=60"], "--set k3_max=60: it must be above k3_min"),
        (["speed_max=0.02"], "--set speed_max=0.02: it must be above speed_min"),
        (["speed_min=-0.1"], "--set speed_min=-0.1: it must be 0 or more"),
        (["curve_speed=0.3"], "--set curve_speed=0.3: it must be below speed_max"),
        (["friction=rough"], "--set friction=rough: it must be one of smooth, set-valued"),
    ],
)
def test_maps_that_cannot_be_are_refused(changes, text, capsys):
    given = [word for change in changes for word in ("--set", change)]
    assert command.main(["block-map", "--quick", *given]) == 2
    assert capsys.readouterr().err.startswith(text)


def test_curves_are_followed_a_little_beyond_the_map():
    parameters = chosen(load()["block-map"], False, ["speed_min=0"])
    (low, high), (slow, fast) = bounds_of(parameters)
    assert (low, high) == pytest.approx((54.0, 126.0))
    assert (slow, fast) == pytest.approx((0.0, 0.198))


def test_intervals_of_lanes():
    assert intervals(np.array([True, False, True, True, False, True])) == [(0, 0), (2, 3), (5, 5)]
    assert intervals(np.zeros(3, bool)) == []
    assert intervals(np.ones(2, bool)) == [(0, 1)]


def test_where_no_lane_is_periodic_there_are_no_curves():
    parameters = chosen(load()["block-map"], True, [])
    data = lanes(status=["ok"] * 3, period=[0, 0, 0])
    data["motion"] = data.period
    data["seconds"] = data.period * np.nan
    found = followed(data, parameters)
    assert found.sizes == {"along": 0, "curve": 0, "tip": 0, "paper": 0}
    assert found.attrs["curves"] == (
        "none: no lane near the belt speed 0.1 m/s leads to a branch of orbits"
    )


@pytest.mark.slow
def test_a_standing_belt_a_failed_lane_and_the_rest(monkeypatch, tmp_path):
    """Lanes that fail, with a stiffness that is no number, leave their neighbours alone."""
    given = _map.system_at

    def broken(word, k3, V_b):
        # In the lanes alone: a number that is none is refused where it is seen.
        seen = not isinstance(k3, jax.core.Tracer)
        return given(word, k3 if seen else jnp.where(k3 > 76.0, jnp.nan, k3), V_b)

    monkeypatch.setattr(_map, "system_at", broken)
    changes = ["k3_min=70", "k3_max=80", "columns=3", "speed_min=0", "speed_max=0.12", "rows=3"]
    parameters = chosen(load()["block-map"], True, changes)
    found = settled_motions(parameters, Context(tmp_path))
    assert found.motion.dims == ("k3", "V_b")
    assert found.motion[:, 0].values.tolist() == [RESTS, RESTS, FAILED]
    assert found.motion[:, 2].values.tolist() == [1, 1, FAILED]
    assert found.seconds[0, 2] == pytest.approx(0.79986, abs=1e-4)  # the branch at 70 N/m
    assert np.isnan(found.seconds[:, 0]).all()


@pytest.mark.slow
def test_a_map_without_a_doubling_claims_nothing(tmp_path):
    changes = ["k3_min=62", "k3_max=68", "speed_min=0.14", "speed_max=0.18", "curve_speed=0.16",
               "columns=3", "rows=3", "doublings=1"]  # fmt: skip
    experiment = load()["block-map"]
    data = experiment.compute(chosen(experiment, True, changes), Context(tmp_path))
    assert (data.motion == 1).all()
    assert data.sizes["curve"] == data.sizes["paper"] == 0
    assert data.attrs["curves"].startswith("0 followed")
    assert verdicts(data) == {"X3": None, "X4": None, "X5": None}
    plt.close(experiment.draw(data))
