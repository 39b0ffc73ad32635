"""The report on two belts in words, a plan as a table, and logs and plans that move."""

import types

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot as plt

import corexy_jax as cx
from experiments._experiment import Context, chosen
from experiments.corexy import animate, plan
from experiments.corexy._advice import advice
from experiments.corexy._log import gaps, machine_told
from experiments.corexy._recorded import RECORDED
from experiments.corexy._recorded import animate as film_of_log

NOISE = {"theta_1": 2.1e-3, "x": 3e-4}
RANGES = dict.fromkeys(NOISE, 30.0)


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def told(
    one, two, errors=(0.03, 0.04), correlation=0.0, chi_squared=1.0, profile=None, names=("P1", "P2")
):
    fit = types.SimpleNamespace(
        names=names, reduced_chi_squared=chi_squared,
        standard_errors=lambda: dict(zip(names, errors, strict=False)),
        covariance=lambda robust: ((3.0 if robust else 1.0) ** 2) * (
            np.outer(errors, errors) * (np.eye(2) + correlation * np.eye(2)[::-1])
        )[: len(names), : len(names)],
    )  # fmt: skip
    verdicts = None
    if profile is not None:
        verdicts = types.SimpleNamespace(verdicts=dict(zip(names, profile, strict=True)))
    return " ".join(advice(fit, verdicts, {"P1": one, "P2": two}, NOISE, RANGES))


def test_the_looser_belt_is_to_be_tightened():
    # By the law of errors 0.05 N of the difference, 1.96 of them.
    said = told(20.0, 30.0)
    assert "Belt 1 is looser, 20.000 N against 30.000 N, 33% less." in said
    assert "Tighten belt 1 by 10.000 N +- 0.098 N (95%) to match belt 2." in said
    assert "Tighten belt 2 by 10.00 N +- 0.14 N (95%) to match belt 1." in told(
        30.0, 20.0, correlation=-1.0
    )
    assert "equally tight" in told(20.0, 20.09)
    assert "Tighten" not in told(20.0, 20.09)
    one = told(20.0, 30.0, names=("P1",))
    assert "by 10.000 N +- 0.059 N" in one
    assert "The tension P2 = 30 N was taken as given." in one
    assert "nothing about them" in told(20.0, 30.0, names=())


def test_what_the_log_does_not_show_is_no_advice():
    for said in (
        told(20.0, 30.0, errors=(np.inf, 0.1)),
        told(20.0, 30.0, profile=("practically not identifiable", "identifiable")),
    ):
        assert "does not show P1: leave the belts as they are" in said
        assert "Tighten" not in said
    assert "Identifiable:" in told(20.0, 30.0, profile=("identifiable", "identifiable"))


def test_noise_that_was_said_wrong_is_named_with_its_option():
    option = "--set noise=theta_1=0.0021,x=0.0003"
    assert "the intervals stand" in told(20.0, 30.0)
    far = told(20.0, 30.0, chi_squared=4.0)
    assert "2 times the noise" in far
    assert "Tighten belt 1 by 10.00 N +- 0.29 N" in far  # of the residuals as they are, here thrice
    assert option in far
    for chi_squared in (25.0, 1e7, np.nan, np.inf):
        void = told(20.0, 30.0, chi_squared=chi_squared)
        assert void.startswith("VOID: ")
        assert option in void
        assert "ighten" not in void
    assert f"too wide. Say the noise by {option}" in told(20.0, 30.0, chi_squared=0.25)


def test_rows_missing_where_a_voltage_changes_are_named():
    """The dropped rows of a log within which a voltage jumps made the wrong belt the loose one."""
    times = np.delete(0.01 * np.arange(100), [40, 41, 70])
    volts = np.where(times < 0.405, 4.5, -4.5)
    said = gaps(times, {"v1": volts, "v2": 0.0 * volts})
    assert "1 times, first between 0.39 s and 0.42 s" in said
    assert gaps(times, {"v1": 0.0 * volts, "v2": 0.0 * volts}) == ""
    assert "Table 1" in machine_told("")
    assert "m.json" in machine_told("m.json")


def test_belts_are_called_as_their_motors_turn():
    """With motor 2 held the machine runs along x = y, as the report has it."""
    one, two = cx.virtual_pulleys(1.0, 1.0, 0.05)
    assert (float(one) > 0.0, float(two)) == (True, 0.0)


def run(experiment, *changes, data=None):
    return experiment.compute(chosen(experiment, False, list(changes)), Context(None, data=data))


@pytest.mark.more
def test_a_plan_is_a_table_that_gives_its_voltages_back(tmp_path, capsys):
    points = tmp_path / "points.csv"
    points.write_text("# mm\nx,y\n0,0\n200,0\n200,100\n")
    data = run(plan.EXPERIMENT, f"path={points}", "units=x=mm,y=mm", "rate=200")
    assert "both motors roll all the time" in capsys.readouterr().out
    path = tmp_path / "plan.csv"
    plan.table(data).to_csv(path, index=False)
    table = pd.read_csv(path)
    assert list(table) == ["time", "v1", "v2", "x", "y"]
    ends = table.iloc[[0, -1]]
    np.testing.assert_allclose(ends[["x", "y"]], [[0.0, 0.0], [0.2, 0.1]], atol=1e-12)
    wanted = cx.feedforward(
        cx.CoreXYParameters(**plan.MACHINE), [(0.0, 0.0), (0.2, 0.0), (0.2, 0.1)], volts=24.0
    )
    voltage, start = animate.read_plan(str(path))
    times = np.linspace(0.0, float(wanted.end), 997)
    here, there = (np.stack(jax.vmap(v)(jnp.asarray(times))) for v in (voltage, wanted.voltage))
    np.testing.assert_allclose(here, there, atol=1e-6)
    assert voltage.times.size < 30
    assert (start["x"][0], start["y"][0]) == (0.0, 0.0)
    with pytest.raises(ValueError, match=r"--set path=heart: it must be one of rectangle, triangle"):
        run(plan.EXPERIMENT, "path=heart")
    path.write_text("time,v1,v2\n1,0,0\n2,1,0\n")
    with pytest.raises(ValueError, match="its times must begin at 0"):
        animate.read_plan(str(path))


def test_rows_of_a_plan_are_kinks_jumps_or_nothing(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text("time,v1,v2\n0,0,4\n0.5,1,4\n1,2,4\n2,2,4\n2,-2,4\n3,0,4\n")
    voltage, start = animate.read_plan(str(path))
    # The row at 0.5 s lies on the line; that at 1 s is a kink, those at 2 s a jump; 0 V at the end.
    np.testing.assert_array_equal(voltage.times, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(voltage.v1, [0.0, 2.0, -2.0, 0.0])
    np.testing.assert_array_equal(voltage.slope_1, [2.0, 0.0, 2.0, 0.0])
    np.testing.assert_array_equal(voltage.v2, [4.0, 4.0, 4.0, 0.0])
    assert set(start) == {"time"}


def test_a_log_moves_as_its_encoders_say(tmp_path):
    time = np.linspace(0.0, 1.0, 51)
    x, y, r = 0.1 * time**2, 0.05 * time, 0.05
    log = pd.DataFrame({"time": time, "theta_1": (x + y) / r, "theta_2": (x - y) / r, "x": x, "y": y})
    path = tmp_path / "log.csv"
    for columns in (["theta_1", "theta_2"], ["x", "y"], ["theta_1", "theta_2", "x", "y"]):
        log[["time", *columns]].to_csv(path, index=False)
        data = run(RECORDED, data=path)
        for found, wanted in (
            (data.x, x),
            (data.y, y),
            (data.rims[:, 0], x + y),
            (data.belts[:, 1], x - y),
        ):
            np.testing.assert_allclose(found, wanted, atol=1e-12)
    machine = tmp_path / "machine.json"
    machine.write_text('{"r": 0.1}')
    log[["time", "theta_1", "theta_2"]].to_csv(path, index=False)
    twice = run(RECORDED, f"machine={machine}", data=path)
    np.testing.assert_allclose(twice.x, 2.0 * x, atol=1e-12)
    movie = film_of_log(data)
    assert movie.frames == 21
    movie.update(20)
    collar = next(p for p in movie.figure.axes[0].patches if hasattr(p, "get_x"))
    end = collar.get_x()
    movie.update(0)
    assert end - collar.get_x() == pytest.approx(0.1)
    assert movie.figure.axes[0].get_title() == "log.csv, t = 0.00 s"
    with pytest.raises(ValueError, match=r"--set speed=100.0: it must be such that 1 frames are 2 to"):
        run(RECORDED, "speed=100", data=path)
    log[["time", "x"]].to_csv(path, index=False)
    with pytest.raises(ValueError, match="it must have the columns x and y, or theta_1 and theta_2"):
        run(RECORDED, data=path)
