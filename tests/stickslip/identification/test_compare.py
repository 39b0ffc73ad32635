"""Criteria by their formulas, and what they choose among polynomials of known degree."""

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.identification import Unknown, compare, least_squares

X = np.linspace(-1.0, 1.0, 60)
SIGMA = 0.1
DATA = 1.0 - 2.0 * X + 1.5 * X**2 + SIGMA * np.random.default_rng(1).normal(size=60)
FRESH = 1.0 - 2.0 * X + 1.5 * X**2 + SIGMA * np.random.default_rng(2).normal(size=60)


def error(p, data):
    return sum(p[f"c{k}"] * X**k for k in range(len(p))) - data


def polynomial(degree):
    start = {f"c{k}": Unknown(0.0) for k in range(degree + 1)}
    return least_squares(lambda p: jnp.asarray(error(p, DATA) / SIGMA), start)


@pytest.fixture(scope="module")
def fits():
    return {f"degree {k}": polynomial(k) for k in (1, 2, 5)}


@pytest.fixture(scope="module")
def held_out(fits):
    return {name: error(fit.values, FRESH) for name, fit in fits.items()}


@pytest.mark.parametrize("known", [True, False])
def test_formulas(known, fits, held_out):
    found = compare(fits, held_out=held_out, sigma=SIGMA, noise_known=known)
    rest = np.polynomial.polynomial.polyfit(X, DATA, 2)
    chi = np.sum((np.polynomial.polynomial.polyval(X, rest) - DATA) ** 2) / SIGMA**2
    k = 3 if known else 4
    misfit = chi if known else 60 * np.log(chi / 60)
    row = {name: float(column[1]) for name, column in found.table.items()}
    assert row["unknowns"] == 3
    assert row["chi_squared"] == pytest.approx(chi, rel=1e-9)
    assert row["aic"] == pytest.approx(misfit + 2 * k)
    assert row["aicc"] == pytest.approx(misfit + 2 * k + 2 * k * (k + 1) / (60 - k - 1))
    assert row["bic"] == pytest.approx(misfit + k * np.log(60))
    score = np.sqrt(np.mean((np.polynomial.polynomial.polyval(X, rest) - FRESH) ** 2))
    assert row["held_out"] == pytest.approx(score, rel=1e-6)
    assert row["held_out_weighted"] == pytest.approx(score / SIGMA, rel=1e-6)


def test_the_true_degree_is_chosen(fits, held_out):
    for known in (True, False):
        found = compare(fits, held_out=held_out, sigma=SIGMA, noise_known=known)
        for by in ("aicc", "bic", "held_out"):
            assert found.best(by) == "degree 2"
        assert found.best("chi_squared") == "degree 5"
    assert found.to_dataset().bic.sizes == {"fit": 3}
    assert "degree 5" in str(found)


def test_bad_input(fits):
    short = least_squares(lambda p: jnp.stack([p["a"] - 1.0]), dict(a=2.0))
    with pytest.raises(ValueError, match=r"fits to the same data"):
        compare({**fits, "other": short})
    with pytest.raises(TypeError, match=r"held_out = .* among degree 1"):
        compare(fits, held_out={"degree 9": X})
    with pytest.raises(ValueError, match=r"by = 'rmse'"):
        compare(fits).best("rmse")
