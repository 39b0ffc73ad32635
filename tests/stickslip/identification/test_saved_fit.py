"""Fits as files: every number, unit, bound and prior comes back, and nothing else is taken for one."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from stickslip.identification import Normal, Unknown, least_squares, load_fit, many_starts

UNKNOWNS = {
    "a": 2.0,
    "b": Unknown(-1.0, unit="N", prior=Normal(-1.0, 0.5)),
    "c": Unknown(0.3, bounds=(0.1, 0.9), unit="m"),
    "d": Unknown(5.0, bounds=(4.0, None), unit="kg"),
}


def residual(p):
    x = jnp.linspace(0.0, 1.0, 9)
    data = jnp.sin(3.0 * x)
    return (p["a"] * x + p["b"] * x**2 + p["c"] + (p["d"] - 5.0) * x**3 - data) / 0.01


def same(one, other):
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)
        assert np.asarray(a).dtype == np.asarray(b).dtype


def test_a_fit_comes_back_to_the_last_digit(tmp_path):
    fit = least_squares(residual, UNKNOWNS)
    path = fit.save(tmp_path / "fit.nc")
    back = load_fit(str(path))
    same(fit, back)
    assert str(back) == str(fit)
    for name, ends in fit.interval().items():
        np.testing.assert_array_equal(back.interval()[name], ends)
    assert [p.name for p in tmp_path.iterdir()] == ["fit.nc"]


def test_a_batch_comes_back(tmp_path):
    rows = {"a": jnp.array([1.0, 2.0, 3.0]), "b": jnp.array([1.0, 1.5, 0.5])}
    fits = many_starts(lambda p: residual({**p, "c": 0.3, "d": 5.0}), rows)
    same(fits, load_fit(fits.save(tmp_path / "fits.nc")))


@pytest.mark.more
def test_the_file_is_read_by_a_process_that_knows_no_problem(tmp_path):
    fit = least_squares(residual, UNKNOWNS)
    path = fit.save(tmp_path / "fit.nc")
    code = (
        "from stickslip.identification import load_fit; import sys;"
        "fit = load_fit(sys.argv[1]); print(float(fit.values['c']).hex(), fit.units['d'])"
    )
    said = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, check=True, text=True, cwd=tmp_path
    ).stdout.split()
    assert said == [float(fit.values["c"]).hex(), "kg"]
    with xr.open_dataset(path) as data:
        assert data["value of b"].attrs["units"] == "N"


def test_what_is_no_file_of_a_fit_is_named(tmp_path):
    fit = least_squares(residual, UNKNOWNS)
    path = fit.save(tmp_path / "fit.nc")
    with pytest.raises(ValueError, match=r"path = '.*none.nc', no file: it must be a file of Fit.save"):
        load_fit(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("a fit", encoding="utf-8")
    with pytest.raises(ValueError, match=r"text.nc': it must be a file of Fit.save\."):
        load_fit(tmp_path / "text.nc")
    data = xr.load_dataset(path)
    for damaged, said in (
        (data.drop_vars("matrix"), "damaged"),
        (data.assign(code=7), "damaged"),
        (data.assign_attrs(priors="[null"), "damaged"),
        (data.assign_attrs(stickslip="stickslip fit 9"), "of the format 'stickslip fit 9'"),
    ):
        damaged.to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
        with pytest.raises(ValueError, match=said):
            load_fit(tmp_path / "other.nc")
    with pytest.raises(TypeError, match="path = 3"):
        load_fit(3)
    with pytest.raises(TypeError, match="path = 3"):
        fit.save(3)


def test_a_write_that_fails_leaves_the_old_file(tmp_path):
    fit = least_squares(residual, UNKNOWNS)
    path = fit.save(tmp_path / "fit.nc")
    before = path.read_bytes()
    path.with_name("fit.nc.part").mkdir()
    with pytest.raises(OSError, match="directory"):
        fit.save(path)
    assert path.read_bytes() == before
