"""Records of a printer's accelerometer: how they are read, what is said, the example found again."""

import numpy as np
import pytest
import xarray as xr

from experiments.__main__ import main
from experiments.corexy._printer_log import read_columns, read_pluck


def write(path, text):
    path.write_text(text)
    return path


def test_files_of_the_firmware_are_read(tmp_path):
    log = write(tmp_path / "a.csv", "#time,accel_x,accel_y,accel_z\n1.0,2,3,4\n1.5,5,6,7\n")
    rows = read_columns("a", log)
    assert list(rows) == ["time", "accel_x", "accel_y", "accel_z"]
    np.testing.assert_array_equal(rows["accel_y"], [3.0, 6.0])
    plain = write(tmp_path / "b.csv", "time,sound\n0.0,0.1\n0.1,-9\n0.2,4\n0.3,1\n0.4,0\n0.5,0\n")
    times, row = read_pluck(str(plain), log)
    np.testing.assert_allclose(times, [0.0, 0.1, 0.2, 0.3, 0.4], atol=1e-15)
    assert row[0] == -9.0


@pytest.mark.parametrize(
    ("text", "changes", "said"),
    [
        ("time,accel_x\n0,1\n1,2\n", {}, "must have the columns time, accel_x, accel_y"),
        ("a,b\n0,1\n1,2\n", {}, "it must have the column time"),
        ("time,accel_x,accel_y\n0,1,1\n0,2,2\n", {}, "time increase"),
        ("time,accel_x,accel_y\n0,1,x\n1,2,2\n", {}, "a table of numbers"),
        ("time,accel_x,accel_y\n0,1,1\n1,2,2\n", {"along": "0,0"}, "--set along=0,0"),
        ("time,accel_x,accel_y\n0,1,1\n1,2,2\n", {"plucks": "one.csv"}, "two files, belt 1 and 2"),
        ("time,accel_x,accel_y\n0,1,1\n1,2,2\n", {"plucks": "a,b"}, "--set plucks=a"),
    ],
)
def test_wrong_records_are_named(tmp_path, capsys, text, changes, said):
    log = write(tmp_path / "log.csv", text)
    words = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    assert main(["identify-printer", "--data", str(log), "--out", str(tmp_path / "out"), *words]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_the_example_is_found_again(tmp_path, capsys):
    """Belts of 17 and 20 kN, 16 and 20 N; and a wrong axis is void."""
    out = tmp_path / "out"
    assert main(["identify-printer", "--quick", "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "\nGOOD: " in told
    assert "Belt 1 is looser, 16.0" in told
    with xr.open_dataset(out / "identify-printer.nc", engine="h5netcdf") as data:
        data = data.load()
    np.testing.assert_allclose(data.tension, [16.0, 20.0], rtol=2e-3)
    found = dict(zip(data.unknown.values, data.estimate.values, strict=True))
    assert found["EA_1"] == pytest.approx(1.7e4, rel=1e-3)
    assert found["EA_2"] == pytest.approx(2e4, rel=1e-3)
    assert found["mu"] == pytest.approx(0.015, rel=0.02)
    assert np.all(data.interval[:, 0] < data.estimate)
    log = out / "identify-printer-log.csv"
    words = ["--set", "f0=50", "--set", "f1=95", "--set", "rate=90", "--set", "along=1,0"]
    assert main(["identify-printer", "--data", str(log), "--out", str(tmp_path / "b"), *words]) == 0
    told = capsys.readouterr().out
    assert "\nVOID: " in told
    assert "Tensions were not measured" in told
