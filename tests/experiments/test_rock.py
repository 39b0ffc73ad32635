"""Rock on rock: a step made by a stiff solver of the age itself, the measured one where it is."""

import os
import pathlib

import jax
import numpy as np
import pytest
import scipy.integrate
import scipy.signal
import xarray as xr

from experiments import _data, _output
from experiments.__main__ import main
from experiments.rock import identify
from experiments.rock._record import HEADS, NAME, Step, load, step_of
from experiments.rock._slider import LAWS, SIGMA, SPEEDS, Sliding, problem, slider
from stickslip.identification import Signal

TRUTH = {"mu_0": 0.61, "a": 0.008, "b": 0.011, "d_c": 8e-6, "stiffness": 6e3, "trend": 2.0}
BEGIN = 4.0  # of the higher speed [s]


def made(law: str) -> Step:
    """SciPy's Radau with the age; the coefficient in the logarithmic form."""
    mu_0, a, b, d_c, stiffness, trend = TRUTH.values()
    slow = SPEEDS[0]

    def slope(t, y):
        f, theta, _ = y
        v = slow * np.exp((f - mu_0 - b * np.log(slow * theta / d_c)) / a)
        u = v * theta / d_c
        rate = 1.0 - u if law == "ageing" else -u * np.log(u)
        return [stiffness * ((SPEEDS[0] if t < BEGIN else SPEEDS[1]) - v), rate, v]

    times, rows, y = np.linspace(0.0, 10.0, 401), [], [mu_0, d_c / slow, 0.0]
    for part in (times[times < BEGIN], times[times >= BEGIN]):
        ends = (0.0, BEGIN) if not rows else (BEGIN, times[-1])
        run = scipy.integrate.solve_ivp(
            slope, ends, y, "Radau", np.union1d(part, ends[1]), rtol=1e-10, atol=1e-15,
            max_step=0.02,
        )  # fmt: skip
        rows.append(run.y[:, : part.size])
        y = run.y[:, -1]
    f, _, x = np.concatenate(rows, axis=1)
    pulled = SPEEDS[0] * np.minimum(times, BEGIN) + SPEEDS[1] * np.maximum(times - BEGIN, 0.0)
    return Step(times, pulled, f + trend * x)


@pytest.mark.more
@pytest.mark.parametrize("law", [LAWS[0], pytest.param(LAWS[1], marks=pytest.mark.slow)])
def test_terms_of_a_known_contact(law):
    step = made(law)
    begin, before, after = step_of(step)
    assert begin == pytest.approx(BEGIN, abs=1e-3)
    assert (before, after) == pytest.approx(SPEEDS, rel=1e-3)
    fit = problem(law, step, begin + 0.02).fit()
    assert bool(fit.successful)
    for name, value in TRUTH.items():
        assert float(fit.values[name]) == pytest.approx(value, rel=1e-4), name
    assert float(fit.values["late"]) == pytest.approx(-0.02, abs=2e-5)
    assert np.abs(fit.residual).max() * SIGMA < 2e-7


@pytest.mark.parametrize("law", LAWS)
def test_stability_of_steady_sliding(law):
    """Ruina's stiffness, at which a disturbance neither grows nor decays, and its frequency."""
    gap, v = TRUTH["b"] - TRUTH["a"], SPEEDS[0]
    critical = gap / TRUTH["d_c"]
    load_point = Signal([0.0, 1.0], [v, v])
    found = {}
    for factor in (0.8, 1.0, 1.25):
        values = TRUTH | {"stiffness": factor * critical, "late": 0.0}
        system = slider(law, values, load_point)
        square = jax.jacfwd(
            lambda y, s=system: np.array([1.0, 1e5]) * jax.numpy.stack(
                s.vector_field(0.5, Sliding(y[0], 1e-5 * y[1], 0.0), 0, None)[:2]
            )
        )(np.array([TRUTH["mu_0"], 0.0]))  # fmt: skip
        found[factor] = np.linalg.eigvals(square)
    assert np.abs(found[1.0].real).max() < 1e-9
    assert found[1.0].imag.max() == pytest.approx(
        v / TRUTH["d_c"] * np.sqrt(gap / TRUTH["a"]), rel=1e-9
    )
    assert found[0.8].real.min() > 1e-3
    assert found[1.25].real.max() < -1e-3


def test_records_of_another_format(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv(_data.VARIABLE, raising=False)
    assert main(["identify-rock", "--out", str(tmp_path / "out")]) == 1
    assert f"{NAME} is needed: name its folder by --data FOLDER" in capsys.readouterr().err
    heads = "\t".join(HEADS)
    for text, message in (
        ("t x mu\n0 1 2\n", r"its first line must be Time\(s\)"),
        (f"{heads}\n0 1 0.6 20\n1 x 0.6 20\n", "every line must be 4 numbers"),
        (f"{heads}\n0 1 0.6 20\n0 2 0.6 20\n", "the times must increase"),
    ):
        (tmp_path / NAME).write_text(text)
        with pytest.raises(ValueError, match=message):
            load(tmp_path)


def test_step_of_the_measured_record():
    try:
        step = load(None)
    except _data.MissingDataError as error:
        pytest.skip(str(error))
    begin, before, after = step_of(step)
    assert step.time.size == 5849
    assert begin == pytest.approx(68.67, abs=0.02)
    assert (before, after) == pytest.approx(SPEEDS, rel=0.02)


@pytest.mark.slow
def test_statements_on_the_measured_record(tmp_path):
    try:
        load(None)
    except _data.MissingDataError as error:
        pytest.skip(str(error))
    folder = pathlib.Path(os.environ[_data.VARIABLE])
    whole = ["starts=1", "profile=false"]
    _output.run(identify.EXPERIMENT, tmp_path, changes=whole, data=folder)
    with xr.open_dataset(tmp_path / "identify-rock.nc", engine="h5netcdf") as data:
        holds = {s.id: s.holds for s in identify.judge(data.load())}
    expected = {1: True, 2: True, 3: False, 4: None, 5: False, 6: True, 7: True, 8: False, 9: True}
    assert holds == {f"R3.{k}": value for k, value in expected.items()}
