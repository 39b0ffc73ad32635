r"""Whether residuals are noise: correlation in time, with the input, and the test of Ljung and Box."""

import functools
import statistics
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._argument_checks import check_arguments, count
from .._types import Rows
from .._validation import (
    as_parameter,
    check_known,
    check_that,
    is_concrete,
    numbers,
    refusal,
    shape_refusal,
)
from ._accuracy import ACCURACY

# Quantile of the normal distribution at which the band of a correlation ends.
WIDTH = statistics.NormalDist().inv_cdf(0.5 + 0.5 * ACCURACY.band)


class Correlation(eqx.Module):
    """Correlation at `lags` [samples]; `band` holds that of noise with the probability 95%, each lag by
    itself."""

    lags: Int[Array, " lag"]
    values: Float[Array, " lag"]
    band: Float[Array, " lag"]

    @property
    def outside(self) -> Float[Array, ""]:
        """Part of the lags that are outside of the band; lag 0 of a series with itself has none."""
        own = jnp.isfinite(self.band)
        out = jnp.where(own, jnp.abs(self.values) > self.band, False)
        return _count(out) / _count(own)


class LjungBox(eqx.Module):
    r"""Test that a series is white: `statistic` $Q$, its `degrees` of freedom, `p_value`."""

    statistic: Float[Array, ""]
    degrees: int = eqx.field(static=True)
    p_value: Float[Array, ""]


@check_arguments(lags=count(1))
def autocorrelation(series: Rows, lags: int = 20) -> Correlation:
    r"""Correlation of a series with itself, $r_k = \sum_t x_t x_{t+k} / \sum_t x_t^2$.

    **Missing rows** are NaN and stay in their place: $x$ is the series without its mean and zero where
    it is missing. **Lags count samples**: a record with irregular times is taken in its order, and one
    with gaps must have NaN in them, see `in_even_steps`. **Several records** are rows, shorter ones
    filled up with NaN; each loses its own mean, and no product reaches from one into the next.

    **Arguments:** `series`, one row or several; `lags`, up to the shortest. The band is
    $\pm z \sqrt{n_k}/n$ of white noise, $n_k$ products at lag $k$ of $n$ samples. **Raises**
    `TypeError`, `ValueError` for anything else. Works under `jit`, `vmap` and `grad`.
    """
    return _autocorrelation(_rows_of("series", series, lags), lags)


@check_arguments(lags=count(1))
def cross_correlation(series: Rows, other: Rows, lags: int = 20) -> Correlation:
    r"""Correlation of residuals with an input, $\sum_t u_t e_{t+k}/\sqrt{\sum u^2 \sum e^2}$.

    At positive lags the residual follows the input: values outside of the band show a dependence that
    the model has missed. At negative lags the input follows the residual, as it does in a closed loop.

    **Arguments:** `series` $e$ and `other` $u$ of the same shape, with missing rows and several records
    as in `autocorrelation`; `lags` to both sides. The band is $\pm z\sqrt{n_k}/n$, which holds
    if the residual is white. **Raises** as `autocorrelation`.
    """
    given: Any = series
    rows, inputs = _rows_of("series", series, lags), _rows_of("other", other, lags)
    if rows.shape != inputs.shape:
        raise shape_refusal("other", other, f"of the shape of series, {np.shape(given)}")
    return _cross_correlation(rows, inputs, lags)


@check_arguments(lags=count(1), unknowns=count(0))
def ljung_box(series: Rows, lags: int = 20, *, unknowns: int = 0) -> LjungBox:
    r"""The test of Ljung and Box, $Q = n(n+2)\sum_{k=1}^{m} r_k^2/n_k$, with $n_k = n - k$ products.

    Where rows are missing, $n$ counts those present and $n_k$ the pairs present. A small `p_value` says
    that the series is not white.

    $Q$ is $\chi^2$ with $m - p$ degrees of freedom if the `unknowns` $p$ were fitted to predict each
    sample **from those before it**. The residuals of a simulation under a given input keep all $m$: its
    sensitivities hold no noise. There `unknowns=0` is right; reduced, the test rejects too often.

    **Arguments:** `series` as for `autocorrelation`, `lags` $m$, more than `unknowns`. **Raises**
    `TypeError`, `ValueError` for anything else. Source: Ljung & Box, Biometrika 65 (1978).
    """
    rows = _rows_of("series", series, lags)
    if unknowns >= lags:
        raise refusal("unknowns", unknowns, f"less than lags = {lags}")
    degrees = lags - unknowns
    return _ljung_box(rows, lags, degrees)


def in_even_steps(times: Rows, series: Rows) -> Float[np.ndarray, " sample"]:
    """A series with gaps on the even grid of its times [s], NaN in the gaps.

    **Raises** `ValueError` where a time is off the grid of the median step by more than 5% of a step:
    such a record has no lags in seconds; in its own order it has lags in samples. `TypeError`,
    `ValueError` for anything but rows. It reads numbers and does not work under `jit`.
    """
    rows = []
    for name, given in (("times", times), ("series", series)):
        check_known(name, given)
        rows.append(numbers(name, given))
        if rows[-1].ndim != 1 or rows[-1].size < 2:
            raise shape_refusal(name, given, "one row of at least 2")
    grid, values = (row.astype(np.float64) for row in rows)
    if grid.shape != values.shape:
        raise shape_refusal("series", series, f"as long as times, {grid.size}")
    check_that("times", grid, np.isfinite, "finite")
    steps = np.diff(grid)
    if (steps <= 0).any():
        raise refusal("times", times, "increasing")
    # The step is refined over the whole record: one of 1e5 samples has no digits to lose.
    step = float(np.median(steps))
    for _ in range(3):
        places = np.rint((grid - grid[0]) / step)
        step = float((grid[-1] - grid[0]) / places[-1])
    off = np.abs((grid - grid[0]) / step - places)
    if off.max() > 0.05:
        at = int(off.argmax())
        raise refusal(
            f"times[{at}]", float(grid[at]), f"on an even grid with gaps, of step {step:.6g} s"
        )
    if places[-1] > 100 * grid.size:
        raise refusal("times", times, "without gaps a hundred times as long as the record")
    filled = np.full(int(places[-1]) + 1, np.nan)
    filled[places.astype(int)] = values
    return filled


def _rows_of(name: str, series: Any, lags: Any) -> Array:
    """The series as rows."""
    if is_concrete(series):
        array = numbers(name, series)
        if np.isinf(array).any():
            raise refusal(name, series, "finite, or NaN where it is missing")
    shape = np.shape(series)
    if len(shape) not in (1, 2) or shape[-1] <= lags + 1:
        raise shape_refusal(name, series, f"a row, or rows, of more than lags + 1 = {lags + 1}")
    if is_concrete(series) and not (np.count_nonzero(~np.isnan(np.asarray(series)), axis=-1) > 1).all():
        raise refusal(name, series, "rows with at least two samples that are not missing")
    return as_parameter(series).reshape(-1, shape[-1])


# One program each: the operations one by one would be two hundred, compiled for every length.
@functools.partial(jax.jit, static_argnums=1)
def _autocorrelation(given: Array, lags: int) -> Correlation:
    rows, here = _without_means(given)
    sums, counts = _products(rows, here, rows, here, jnp.arange(lags + 1))
    band = WIDTH * jnp.sqrt(counts) / _count(here)
    band = jnp.where(jnp.arange(lags + 1) == 0, jnp.inf, band)
    return Correlation(jnp.arange(lags + 1), sums / sums[0], band)


@functools.partial(jax.jit, static_argnums=2)
def _cross_correlation(given: Array, other: Array, lags: int) -> Correlation:
    (rows, here), (inputs, there) = _without_means(given), _without_means(other)
    shifts = jnp.arange(lags + 1)
    after, counts_after = _products(inputs, there, rows, here, shifts)
    before, counts_before = _products(rows, here, inputs, there, shifts)
    sums = jnp.concatenate([before[:0:-1], after])
    counts = jnp.concatenate([counts_before[:0:-1], counts_after])
    size = jnp.sqrt(jnp.sum(rows**2) * jnp.sum(inputs**2))
    band = WIDTH * jnp.sqrt(counts) / _count(here & there)
    return Correlation(jnp.arange(-lags, lags + 1), sums / size, band)


@functools.partial(jax.jit, static_argnums=(1, 2))
def _ljung_box(given: Array, lags: int, degrees: int) -> LjungBox:
    rows, here = _without_means(given)
    sums, counts = _products(rows, here, rows, here, jnp.arange(lags + 1))
    number = _count(here)
    ratio = (sums[1:] / sums[0]) ** 2 / jnp.maximum(counts[1:], 1.0)
    statistic = number * (number + 2.0) * jnp.sum(ratio)
    p_value = jax.scipy.special.gammaincc(0.5 * degrees, 0.5 * statistic)
    return LjungBox(statistic, degrees, p_value)


def _without_means(given: Array) -> tuple[Array, Array]:
    """Rows without their means, zero where they are missing, and where they are not."""
    here = ~jnp.isnan(given)
    filled = jnp.where(here, given, 0.0)
    counts = jnp.maximum(_count(here, axis=1), 1.0)[:, None]
    mean = jnp.sum(filled, axis=1, keepdims=True) / counts
    return jnp.where(here, filled - mean, 0.0), here


def _count(true: Any, axis: int | None = None) -> Array:
    return jnp.sum(true.astype(jnp.float64), axis=axis)


def _products(first, present, second, there, lags) -> tuple[Array, Array]:
    """Sum over `first[t] * second[t + k]` and number of pairs present, for each lag k."""
    # By the fast transform: every lag by itself would read a long record as often as there are lags.
    length = 2 * first.shape[-1]
    sums = _sums_over_lags(first, second, length)[lags]
    counts = _sums_over_lags(present.astype(jnp.float64), there.astype(jnp.float64), length)[lags]
    return sums, jnp.round(counts)


def _sums_over_lags(first, second, length: int) -> Array:
    a, b = jnp.fft.rfft(first, length), jnp.fft.rfft(second, length)
    return jnp.sum(jnp.fft.irfft(jnp.conj(a) * b, length), axis=0)
