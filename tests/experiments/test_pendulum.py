"""The free pendulum: segments made by an independent integrator, the measured ones where they are."""

import os
import pathlib

import numpy as np
import pytest
import scipy.integrate
import scipy.io
import xarray as xr

from experiments import _data, _output
from experiments.__main__ import main
from experiments.pendulum import identify
from experiments.pendulum._pendulum import SIGMA, first_state, predicted, problem, rest_of, small_swing
from experiments.pendulum._record import NAME, STEP, Segment, load

LAW = "viscous, dry and quadratic"
TRUTH = {"gravity": 64.0, "viscous": 0.05, "dry": 0.15, "quadratic": 0.02, "zero": 1e-3}


def made(phi: float, v: float, seconds: float) -> Segment:
    """SciPy from one turn to the next, each half swing with friction in one sense."""
    times = STEP * np.arange(round(seconds / STEP))
    rows = np.empty((times.size, 2))
    t, y = 0.0, np.array([phi, v])
    while t < times[-1]:
        sense = np.sign(y[1]) or -np.sign(y[0])

        def slope(t, y, sense=sense):
            drag = TRUTH["viscous"] * y[1] + TRUTH["quadratic"] * abs(y[1]) * y[1]
            return [y[1], -TRUTH["gravity"] * np.sin(y[0]) - drag - TRUTH["dry"] * sense]

        def turn(t, y):
            return y[1]

        turn.terminal, turn.direction = True, -sense
        run = scipy.integrate.solve_ivp(
            slope, (t, times[-1]), y, events=turn, dense_output=True, rtol=1e-10, atol=1e-12
        )
        part = (times >= t) & (times <= run.t[-1])
        rows[part] = run.sol(times[part]).T
        t, y = run.t[-1], np.array([run.y[0, -1], 0.0])
        assert TRUTH["gravity"] * abs(np.sin(y[0])) > TRUTH["dry"]  # it does not come to rest here
    rows[:, 0] += TRUTH["zero"]
    return Segment(*rows.T)


@pytest.fixture(scope="module")
def segments():
    return [made(1.5, 0.0, 3.0), made(-0.6, 1.0, 3.0)]


@pytest.mark.slow
def test_terms_of_a_known_pendulum(segments):
    assert small_swing(segments) == pytest.approx(TRUTH["gravity"], rel=0.05)
    task = problem(LAW, segments, 10, hidden=0.3)
    fit = task.fit()
    assert bool(fit.successful)
    assert int(fit.steps) <= 20
    for name, value in TRUTH.items():
        assert float(fit.values[name]) == pytest.approx(value, rel=1e-4), name
    assert max(np.abs(row).max() for row in rest_of(task, fit, segments, 10)) < 1e-3 * SIGMA
    errors = predicted(TRUTH, segments[0], 10) - segments[0].phi[::10]
    assert np.abs(errors).max() < 0.02
    assert first_state(segments[0]) == pytest.approx((1.501, 0.0), abs=0.02)


def test_records_of_another_format(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv(_data.VARIABLE, raising=False)
    assert main(["identify-pendulum", "--out", str(tmp_path / "out")]) == 1
    assert f"{NAME} is needed: name its folder by --data FOLDER" in capsys.readouterr().err
    scipy.io.savemat(tmp_path / NAME, {"Y_id": np.zeros(3)})
    with pytest.raises(ValueError, match="it must have the variables Y_vad, dt"):
        load(tmp_path)
    cells = np.empty((1, 1), object)
    cells[0, 0] = np.zeros((3, 5))
    scipy.io.savemat(tmp_path / NAME, {"Y_id": cells, "Y_vad": cells, "dt": 1e-3})
    with pytest.raises(ValueError, match="every segment must be two rows"):
        load(tmp_path)
    scipy.io.savemat(tmp_path / NAME, {"Y_id": cells, "Y_vad": cells, "dt": 2e-3})
    with pytest.raises(ValueError, match=r"dt must be 0\.001 s"):
        load(tmp_path)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fit converged")  # no law explains all of the record
def test_statements_on_the_measured_record(tmp_path):
    try:
        load(None)
    except _data.MissingDataError as error:
        pytest.skip(str(error))
    folder = pathlib.Path(os.environ[_data.VARIABLE])
    _output.run(identify.EXPERIMENT, tmp_path, changes=["folds=false"], data=folder)
    with xr.open_dataset(tmp_path / "identify-pendulum.nc", engine="h5netcdf") as data:
        holds = {s.id: s.holds for s in identify.judge(data.load())}
    assert [holds[f"R2.{k}"] for k in range(1, 8)] == [True, True, True, False, None, True, True]
