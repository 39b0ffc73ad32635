"""Correlations and the test of Ljung and Box: by hand, against SciPy, and their size by simulation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
import scipy.stats

from stickslip.identification import autocorrelation, cross_correlation, in_even_steps, ljung_box

RUNS = 4000


def ar1(rng, shape, phi):
    """AR(1) series in their stationary state."""
    noise = rng.normal(size=shape)
    noise[..., 0] /= np.sqrt(1 - phi**2)
    return scipy.signal.lfilter([1.0], [1.0, -phi], noise, axis=-1)


def binomial_error(p=0.05):
    return 3.0 * np.sqrt(p * (1 - p) / RUNS)


def by_hand(x, lags):
    """Statistic from its definition, term by term."""
    x = x - x.mean()
    n, total = len(x), np.sum(x * x)
    r = [np.sum(x[k:] * x[:-k]) / total for k in range(1, lags + 1)]
    return n * (n + 2) * sum(c**2 / (n - k) for k, c in enumerate(r, 1)), r


@pytest.mark.parametrize("unknowns", [0, 3])
def test_statistic_by_its_definition(unknowns):
    x = ar1(np.random.default_rng(0), 150, 0.2) + 5.0
    found = ljung_box(x, 12, unknowns=unknowns)
    statistic, r = by_hand(x, 12)
    assert float(found.statistic) == pytest.approx(statistic, rel=1e-10)
    assert float(found.p_value) == pytest.approx(
        scipy.stats.chi2.sf(statistic, 12 - unknowns), rel=1e-9
    )
    correlation = autocorrelation(x, 12)
    np.testing.assert_allclose(correlation.values[1:], r, atol=1e-12)
    assert float(correlation.values[0]) == 1.0
    k = np.arange(1, 13)
    np.testing.assert_allclose(
        correlation.band[1:], scipy.stats.norm.ppf(0.975) * np.sqrt(150 - k) / 150, rtol=1e-9
    )


def rejected(series, lags, unknowns=0):
    p = jax.jit(jax.vmap(lambda x: ljung_box(x, lags, unknowns=unknowns).p_value))(series)
    return float(np.mean(np.asarray(p) < 0.05))


def test_size_and_power():
    rng = np.random.default_rng(1)
    assert abs(rejected(rng.normal(size=(RUNS, 1000)), 20) - 0.05) < binomial_error()
    assert rejected(ar1(rng, (RUNS, 1000), 0.3), 20) > 0.99


def test_size_where_past_samples_predict():
    """Residuals of an AR(1) model that was fitted: the degrees of freedom fall by one, not by none."""
    x = ar1(np.random.default_rng(2), (RUNS, 1000), 0.5)
    phi = np.sum(x[:, 1:] * x[:, :-1], axis=1) / np.sum(x[:, :-1] ** 2, axis=1)
    left = x[:, 1:] - phi[:, None] * x[:, :-1]
    assert abs(rejected(left, 5, 1) - 0.05) < binomial_error()
    assert rejected(left, 5) < 0.05 - binomial_error()


def test_size_where_a_given_input_predicts():
    """Residuals of a fit to functions of time alone keep all degrees of freedom."""
    t = np.arange(1000) / 1000.0
    columns = np.stack([np.cos(2 * np.pi * k * t) for k in range(4)], axis=1)
    noise = np.random.default_rng(3).normal(size=(RUNS, 1000))
    left = noise - noise @ columns @ np.linalg.inv(columns.T @ columns) @ columns.T
    assert abs(rejected(left, 20) - 0.05) < binomial_error()
    assert rejected(left, 20, 4) > 0.1


def test_size_with_missing_rows_and_several_records():
    rng = np.random.default_rng(4)
    series = rng.normal(size=(RUNS, 2, 600))
    series[rng.random(series.shape) < 0.3] = np.nan
    series[:, 1, 400:] = np.nan
    assert abs(rejected(series, 20) - 0.05) < binomial_error()


def test_missing_rows_stay_in_their_place():
    x = ar1(np.random.default_rng(5), 200, 0.6)
    x[[3, 50, 51, 120]] = np.nan
    found = autocorrelation(x, 5)
    centred = x - np.nanmean(x)
    total = np.nansum(centred**2)
    expected = [np.nansum(centred[k:] * centred[: 200 - k]) / total for k in range(6)]
    np.testing.assert_allclose(found.values, expected, atol=1e-12)
    pairs = np.sum(~np.isnan(x[2:] * x[:-2]))
    assert float(found.band[2]) == pytest.approx(1.959963985 * np.sqrt(pairs) / 196)


def test_correlation_of_a_known_series():
    x = ar1(np.random.default_rng(6), 200_000, 0.7)
    found = autocorrelation(x, 10)
    np.testing.assert_allclose(found.values, 0.7 ** np.arange(11), atol=0.02)
    assert float(found.outside) == 1.0


def test_bands_hold_their_level():
    rng = np.random.default_rng(7)
    e, u = rng.normal(size=(RUNS, 400)), ar1(rng, (RUNS, 400), 0.9)
    own = jax.jit(jax.vmap(lambda e: autocorrelation(e, 10).outside))(e)
    with_input = jax.jit(jax.vmap(lambda e, u: cross_correlation(e, u, 10).outside))(e, u)
    # Lags of a smooth input share their fate: the mean is over runs, not over runs times lags.
    assert abs(float(jnp.mean(own)) - 0.05) < 0.005
    assert abs(float(jnp.mean(with_input)) - 0.05) < 0.01


def test_the_residual_follows_the_input():
    rng = np.random.default_rng(8)
    u, e = rng.normal(size=2000), rng.normal(size=2000)
    e[3:] += 0.3 * u[:-3]
    found = cross_correlation(e, u, 6)
    np.testing.assert_array_equal(found.lags, np.arange(-6, 7))
    outside = np.asarray(found.lags)[np.abs(found.values) > 2 * found.band]
    np.testing.assert_array_equal(outside, [3])
    a, b = u - u.mean(), e - e.mean()
    size = np.sqrt(np.sum(a**2) * np.sum(b**2))
    assert float(found.values[9]) == pytest.approx(np.sum(a[:-3] * b[3:]) / size)
    assert float(found.values[4]) == pytest.approx(np.sum(a[2:] * b[:-2]) / size)


def test_gaps_are_filled_with_missing_rows():
    t = np.array([0.1, 0.2, 0.3, 0.6, 0.7])
    np.testing.assert_array_equal(
        in_even_steps(t, [1.0, 2.0, 3.0, 4.0, 5.0]), [1, 2, 3, np.nan, np.nan, 4, 5]
    )
    with pytest.raises(ValueError, match=r"times\[\d\] = .* on an even grid"):
        in_even_steps([0.0, 0.1, 0.23, 0.3], np.ones(4))
    with pytest.raises(ValueError, match=r"times = .*: it must be increasing"):
        in_even_steps([0.0, 0.2, 0.1], np.ones(3))


def test_bad_input():
    with pytest.raises(ValueError, match=r"series = .*, of shape .* more than lags"):
        autocorrelation(np.ones(5), 20)
    with pytest.raises(ValueError, match=r"unknowns = 20: it must be less than lags = 20"):
        ljung_box(np.arange(99.0), unknowns=20)
    with pytest.raises(ValueError, match=r"other = .* of the shape of series"):
        cross_correlation(np.arange(99.0), np.arange(98.0))
    with pytest.raises(ValueError, match=r"finite, or NaN where it is missing"):
        ljung_box(np.r_[np.inf, np.arange(99.0)])
