"""A report says what is so: verdicts, hidden combinations, colour of the residuals, bounds, modes."""

import re

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
import xarray as xr
from IPython.core.formatters import DisplayFormatter

import stickslip as ss
from stickslip.identification import (
    LevenbergMarquardt,
    Unknown,
    WhitenessTest,
    compare,
    least_squares,
    profile,
    report,
)
from stickslip.systems import CoulombOscillator, Motion

T = np.linspace(0.0, 2.0, 200)
INPUT = np.sin(9.0 * T**2)
NOISE = np.random.default_rng(0).normal(size=200)


def residual(p, colour=0.0):
    """Height and gain are seen as a product only; `late` pushes against its bound."""
    model = p["height"] * p["gain"] * (1.0 - jnp.exp(-p["rate"] * T)) - p["late"]
    return model / 0.1 - (2.0 * (1.0 - np.exp(-3.0 * T)) / 0.1 + NOISE + colour * INPUT + 1.0)


START = {
    "height": Unknown(1.0, bounds=(0.0, None), unit="m"), "gain": 1.5,
    "rate": Unknown(2.0, unit="1/s"), "late": Unknown(0.5, bounds=(0.0, 1.0), unit="m"),
}  # fmt: skip


BY_INPUT = WhitenessTest(inputs={"u": INPUT})


def made(colour=0.0, *, profiled=True, **more):
    fit = least_squares(lambda p: residual(p, colour), START, LevenbergMarquardt(max_steps=300))
    found = profile(lambda p: residual(p, colour), fit) if profiled else None
    return report(fit, profile=found, whiteness=BY_INPUT, series={"x": fit.residual}, **more)


def run(stiffness):
    block = CoulombOscillator(1.0, stiffness, 1.0, 0.5, 0.2)
    return ss.simulate(
        block, 0.0, 9.0, Motion(x=0.0, v=0.2), "stick", saveat=ss.SaveAt(max_events=None)
    )


@pytest.mark.more
def test_text():
    runs = {"swing": run(1.0)}
    found = made(held_out={"fresh": [0.3, np.nan, 0.4]}, runs=runs, other_runs={"swing": run(30.0)})
    text = str(found)
    rows = {row[0]: row for row in found.rows()}
    assert rows["rate"][7] == "identifiable"
    assert rows["height"][7] == rows["gain"][7] == "structurally not identifiable"
    assert rows["late"][-1] == "at the lower"
    assert rows["height"][2] == "m"
    assert "What the data see: gain * height is seen, gain / height is not." in text
    assert "x: white as far as it shows" in text
    assert f"Held-out fresh: root mean square {np.sqrt(0.125):.6g}." in text
    assert f"Run swing: {int(runs['swing'].num_events)} events" in text
    assert "OTHER modes: no derivative connects the two" in text
    same = made(runs=runs, other_runs={"swing": run(1.0 + 1e-9)})
    assert "goes through the same modes" in str(same)


@pytest.mark.more
def test_a_missed_input_is_told():
    found = made(colour=1.5)
    assert "x: NOT white" in str(found)
    both = found.whiteness["x"].with_input["u"]
    # The residual is model less data, and lag 0 stands in the middle.
    assert float(both.values[20]) < -3 * float(both.band[20])
    assert float(made(profiled=False).whiteness["x"].with_input["u"].outside) < 0.2


@pytest.mark.more
def test_correlation_is_that_of_the_linear_problem():
    matrix = np.random.default_rng(1).normal(size=(40, 2)) @ np.array([[1.0, 0.9], [0.0, 0.3]])
    start = {"a": Unknown(1.0), "b": Unknown(-2.0)}
    fit = least_squares(lambda p: jnp.asarray(matrix) @ jnp.stack([p["a"], p["b"]]) - 1.0, start)
    covariance = np.linalg.inv(matrix.T @ matrix)
    expected = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert report(fit).correlation[0, 1] == pytest.approx(expected, rel=1e-9)
    assert abs(expected) > 0.9
    exact = np.linalg.lstsq(matrix, np.ones(40))[0]
    for i, name in enumerate("ab"):
        ends = scipy.stats.norm(exact[i], np.sqrt(covariance[i, i])).interval(0.8)
        np.testing.assert_allclose(fit.interval(0.8)[name], ends, rtol=1e-9)


@pytest.mark.more
def test_an_interval_ends_at_the_bounds():
    start = {
        "a": Unknown(0.5, bounds=(0.0, 1.0)),
        "b": Unknown(0.5, bounds=(None, 1.0)),
        "c": Unknown(0.5),
    }
    fit = least_squares(lambda p: jnp.stack([p["a"], p["b"], p["c"]]) - 0.9, start)
    low, high = 0.9 + scipy.stats.norm.ppf([0.025, 0.975])
    expected = {"a": (0.0, 1.0), "b": (low, 1.0), "c": (low, high)}
    for name, ends in expected.items():
        np.testing.assert_allclose(fit.interval()[name], ends, rtol=1e-6)


def test_what_the_data_do_not_see_has_no_interval_and_no_correlation():
    start = {"a": 1.0, "b": 2.0, "c": 1.0}

    def rows(p):
        return jnp.stack([p["a"] * p["b"] - 1.0, p["c"] - 3.0, p["c"] - 1.0])

    fit = least_squares(rows, start)
    assert fit.interval()["a"].tolist() == [0.0, np.inf]  # it is positive
    ends = scipy.stats.norm(2.0, np.sqrt(0.5)).interval(0.95)
    np.testing.assert_allclose(fit.interval()["c"], ends)
    correlation = np.asarray(fit.correlation())
    assert np.isnan(correlation[:2]).all()
    assert np.isnan(correlation[:, :2]).all()
    assert correlation[2, 2] == pytest.approx(1.0)
    with pytest.raises(ValueError, match=r"level = 1\.0: it must be above 0 and below 1"):
        fit.interval(1.0)


@pytest.mark.more
def test_files(tmp_path):
    fit = least_squares(residual, START)
    found = made(comparison=compare({"only": fit}), title="A <test> & more")
    dataset = found.to_dataset()
    assert dataset.verdict.sel(unknown="gain") == 2
    assert dataset.profile_rise.dims == ("unknown", "side", "point")
    dataset.to_netcdf(tmp_path / "report.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "report.nc", engine="h5netcdf") as again:
        assert float(again.estimate.sel(unknown="rate")) == float(found.fit.values["rate"])
    found.to_html(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "A &lt;test&gt; &amp; more" in text
    assert "structurally not identifiable" in text
    # Nothing is fetched from elsewhere: what is linked lies within the page.
    links = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert all(link.startswith(("#", "data:")) for link in links)
    assert text.count("<svg") == 1
    assert len(found.plot().axes) >= 8
    # Without pyplot, whose figures IPython knows.
    shown, _ = DisplayFormatter().format(found.plot())
    assert shown["image/png"].startswith(b"\x89PNG")


@pytest.mark.more
def test_bad_input(tmp_path):
    fit = least_squares(residual, START)
    other = least_squares(lambda p: jnp.stack([p["q"] - 1.0]), dict(q=2.0))
    with pytest.raises(ValueError, match=r"profile = .* of the unknowns gain, height"):
        report(fit, profile=profile(lambda p: jnp.stack([p["q"] - 1.0]), other))
    with pytest.raises(ValueError, match=r"inputs\['u'\] = .* of shape \(200,\), as series\['x'\]"):
        report(fit, series={"x": fit.residual}, whiteness=WhitenessTest(inputs={"u": INPUT[:5]}))
    with pytest.raises(ValueError, match=r"other_runs = .* named as runs"):
        report(fit, other_runs={"a": run(1.0)})
