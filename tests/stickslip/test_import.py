"""What `import stickslip` costs: only JAX and what JAX's differential equations need."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.integrate

import stickslip.sweep
from stickslip.hybrid._tableau import DOP853

HEAVY = ("xarray", "zarr", "pandas", "scipy", "matplotlib", "optax", "h5netcdf", "h5py")


def loaded_by(statement: str) -> set[str]:
    code = f"{statement}; import sys; print(*sys.modules)"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
               .stdout.split())  # fmt: skip


def test_heavy_modules_come_when_they_are_used():
    loaded = loaded_by("import stickslip")
    assert "stickslip.hybrid" in loaded
    assert loaded.isdisjoint(HEAVY)


@pytest.mark.more
def test_a_sweep_is_there_although_it_comes_later():
    loaded = loaded_by("import stickslip; stickslip.sweep.run_sweep")
    assert "xarray" in loaded
    for name in stickslip.sweep.__all__:
        assert getattr(stickslip.sweep, name).__doc__
        assert name in dir(stickslip.sweep)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        stickslip.sweep.nothing  # noqa: B018


def test_dop853_has_the_published_numbers():
    """Against SciPy's, to the last digit; and the conditions of order that any misprint would break."""
    published = scipy.integrate.DOP853
    n = published.n_stages
    a = np.zeros((n, n))
    for i, row in enumerate(DOP853.a):
        a[i, : len(row)] = row
    np.testing.assert_array_equal(a, published.A[:n, :n])
    np.testing.assert_array_equal(DOP853.b, published.B)
    np.testing.assert_array_equal(DOP853.c, published.C[:n])
    np.testing.assert_array_equal(DOP853.error_weights, [published.E5, published.E3])
    b, c = np.asarray(DOP853.b), np.asarray(DOP853.c)
    for power in range(8):
        assert b @ c**power == pytest.approx(1 / (power + 1), abs=1e-14)
    np.testing.assert_allclose(a.sum(axis=1), c, atol=1e-14)
