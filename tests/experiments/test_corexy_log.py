"""A log of a user's own CoreXY: units and columns, what is refused, and the template fitted."""

import json

import numpy as np
import pytest
import xarray as xr

from experiments.__main__ import main
from experiments.corexy._bench import problem_of
from experiments.corexy._log import read_log, read_machine


def written(path, **changes):
    t = np.arange(40) / 100.0
    rows = {
        "time": t, "v1": np.where(t > 0.1, 4.0, 0.0), "v2": np.where(t > 0.2, -1.0, 0.0),
        "theta_1": 1.0 + t**2, "x": 0.5 * t**2,
    } | changes  # fmt: skip
    lines = [",".join(rows), *(",".join(map(str, row)) for row in zip(*rows.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_units_and_columns(tmp_path):
    plain = read_log(written(tmp_path / "a.csv"), "", "", 0.0)
    t = np.arange(40) / 100.0
    other = written(
        tmp_path / "b.csv", time=1e3 * t, x=500.0 * t**2, theta_1=(1.0 + t**2) * 4000 / (2 * np.pi),
        u=np.where(t > 0.1, 4000.0, 0.0),
    )  # fmt: skip
    found = read_log(other, "v1=u", "time=ms,x=mm,theta_1=count,v1=mV", 4000.0)
    np.testing.assert_allclose(found.times, plain.times, rtol=1e-12)
    for name in ("x", "theta_1"):
        np.testing.assert_allclose(found.measured[name], plain.measured[name], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(plain.voltage.times, [0.0, 0.11, 0.21])
    np.testing.assert_allclose(found.voltage.v1, [0.0, 4.0, 4.0])
    np.testing.assert_allclose(plain.voltage.v2, [0.0, 0.0, -1.0])
    # Angles count from the mean of what was shown before the first voltage.
    assert abs(np.mean(plain.measured["theta_1"][:11])) < 1e-15
    task = problem_of(plain, read_machine(""), ("P1", "mu_s"), {"x": 1e-3}, 1e-8)
    assert sorted(task.unknowns) == ["P1", "mu_s"]
    assert float(task.observed["x"].sd) == 1e-3


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (dict(time=[0.0] * 40), "the time must increase over at least 10 rows; it does not at row 2"),
        (dict(x=["a"] * 40), "column x must hold numbers; row 1 holds 'a'"),
        (dict(v1=[0.0] * 40, v2=[0.0] * 40), "v1 and v2 are zero everywhere"),
    ],
)
def test_wrong_logs(tmp_path, changes, said):
    with pytest.raises(ValueError, match=said):
        read_log(written(tmp_path / "a.csv", **changes), "", "", 0.0)


def test_wrong_options(tmp_path, capsys):
    path, out = written(tmp_path / "a.csv"), str(tmp_path / "out")

    def told(*changes, data=path):
        words = [word for change in changes for word in ("--set", change)]
        code = main(["identify-corexy", "--data", str(data), "--out", out, *words])
        return code, capsys.readouterr().err

    for change, said in (
        ("units=x=inch", "--set units=x=inch: it must be one of m, mm, um."),
        ("units=theta_1=count", "it needs --set counts_per_turn=N"),
        ("columns=x=place", "it must have the columns place; it has time, v1, v2, theta_1, x"),
        ("columns=z=x", "it must be NAME=VALUE,... with names among time, v1, v2"),
        ("unknowns=P1,P1", "it must be different names among P1, P2"),
        ("noise=x=0", "--set noise=x=0.0: it must be positive"),
        ("machine=nowhere.json", "--set machine=nowhere.json: it must be a JSON file"),
    ):
        code, error = told(change)
        assert code == 1
        assert said in error
    (tmp_path / "m.json").write_text(json.dumps({"tension": 1.0}))
    assert "it must map names among m, M" in told(f"machine={tmp_path / 'm.json'}")[1]
    (tmp_path / "m.json").write_text(json.dumps({"P1": -1.0}))
    assert "P1 = -1.0" in told(f"machine={tmp_path / 'm.json'}")[1]
    assert main(["block-fig02", "--data", str(path), "--out", out]) == 2
    assert (
        "it must be a folder; files are taken by animate-corexy, identify-corexy"
        in capsys.readouterr().err
    )
    assert main(["block-fig02", "--template", str(tmp_path / "t.csv")]) == 2
    assert main(["identify-corexy", "--template", str(path)]) == 2
    assert "it exists, and is not written over" in capsys.readouterr().err


@pytest.mark.slow
def test_template_tells_the_tensions(tmp_path, capsys):
    """From 50% off, with an interval that holds them."""
    log, machine = tmp_path / "log.csv", tmp_path / "log-machine.json"
    assert main(["identify-corexy", "--template", str(log)]) == 0
    changes = (f"machine={machine}", "profile=true", "scored=log.csv")  # found beside the log
    words = [word for change in changes for word in ("--set", change)]
    assert main(["identify-corexy", "--data", str(log), "--out", str(tmp_path / "out"), *words]) == 0
    told = capsys.readouterr().out
    assert "identifiable" in told
    assert "\nfitted from rest\nscored from rest\n" in told
    scored = told.partition("log.csv, to which nothing was fitted, from rest\n")[2]
    chi = [float(line.split()[-1]) for line in scored.splitlines() if "chi squared" in line]
    assert len(chi) > 1
    assert all(0.7 < value < 1.3 for value in chi)
    with xr.open_dataset(tmp_path / "out" / "identify-corexy.nc", engine="h5netcdf") as data:
        data = data.load()
    assert list(data.start.values) == [30.0, 20.0]
    assert np.all(np.abs(data.estimate.values - [20.0, 30.0]) < 4.0 * data.standard_error.values)
    assert np.all(data.standard_error.values < 0.01)
    assert np.all(
        (data.lower.values < data.estimate.values) & (data.estimate.values < data.upper.values)
    )
    assert 0.8 < data.attrs["chi_squared"] < 1.25
