"""Draws from the posterior: the normal distribution of a linear model, a truncated one, refusals."""

import sys

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from stickslip.identification import LevenbergMarquardt, Normal, Unknown, least_squares, posterior

RNG = np.random.default_rng(3)
MATRIX = RNG.normal(size=(40, 2)) @ np.array([[1.0, 0.9], [0.0, 0.5]])
DATA = MATRIX @ np.array([2.0, -3.0]) + 0.1 * RNG.normal(size=40)


def line(p):
    return (MATRIX @ jnp.stack([p["a"], p["b"]]) - DATA) / 0.1


def two(**words):
    return dict(a=Unknown(1.0, unit="N", scale=1.0), b=Unknown(-1.0, scale=1.0, **words))


def sampled(residual, unknowns, **words):
    pytest.importorskip("blackjax", reason="blackjax is an extra: stickslip[posterior]")
    fit = least_squares(residual, unknowns)
    return fit, posterior(residual, fit, **({"draws": 1500, "warmup": 300} | words))


@pytest.mark.more
def test_linear_model_has_the_normal_distribution():
    fit, found = sampled(line, two())
    errors = {name: float(error) for name, error in fit.standard_errors().items()}
    for name in ("a", "b"):
        assert float(found.mean[name]) == pytest.approx(float(fit.values[name]), abs=0.1 * errors[name])
        assert float(found.standard_deviation[name]) == pytest.approx(errors[name], rel=0.05)
        assert abs(float(found.r_hat[name]) - 1.0) < 0.01
        assert float(found.effective_draws[name]) > 1000
    assert not np.any(found.divergent)
    rows = np.stack([np.asarray(found.values[name]).ravel() for name in ("a", "b")])
    np.testing.assert_allclose(
        np.corrcoef(rows)[0, 1], fit.sensitivity.covariance()[0, 1] / (errors["a"] * errors["b"]),
        atol=0.05,
    )  # fmt: skip
    assert found.to_dataset()["a"].attrs["units"] == "N"
    assert "4 chains of 1500 draws, 0 divergent" in str(found)


@pytest.mark.slow
def test_prior_and_bound():
    """Flat in the value, not in the coordinate: a normal distribution that its bound cuts off."""

    def one(p):
        return jnp.stack([(p["a"] - 0.5) / 1.0])

    _, found = sampled(one, dict(a=Unknown(1.0, bounds=(0.0, None))), draws=4000)
    known = scipy.stats.truncnorm(-0.5, np.inf, loc=0.5)
    assert float(found.mean["a"]) == pytest.approx(known.mean(), abs=0.05)
    assert float(found.standard_deviation["a"]) == pytest.approx(known.std(), rel=0.05)
    _, found = sampled(one, dict(a=Unknown(1.0, scale=1.0, prior=Normal(2.5, 1.0))))
    assert float(found.mean["a"]) == pytest.approx(1.5, abs=0.06)
    assert float(found.standard_deviation["a"]) == pytest.approx(np.sqrt(0.5), rel=0.06)


@pytest.mark.more
def test_refusals(monkeypatch):
    fit = least_squares(line, two())

    def product(p):
        return jnp.stack([p["a"] * p["b"] - 2.0, p["a"] * p["b"] - 2.1])

    blind = least_squares(product, dict(a=1.0, b=1.5))
    with pytest.raises(ValueError, match=r"does not see a: it must be one whose data see every"):
        posterior(product, blind)
    short = least_squares(line, two(), LevenbergMarquardt(max_steps=1))
    with pytest.raises(ValueError, match="it must be a fit that converged"):
        posterior(line, short)
    monkeypatch.setitem(sys.modules, "blackjax", None)
    with pytest.raises(
        ImportError, match=r"posterior needs blackjax: pip install 'stickslip\[posterior\]'"
    ):
        posterior(line, fit)
