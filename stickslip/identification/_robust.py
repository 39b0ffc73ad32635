"""Standard errors that hold where residuals are larger than their noise, or hang together in time."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


@functools.partial(jax.jit, static_argnames=("priors", "grid"))
def robust_covariance(
    bread: Any, matrix: Any, residual: Any, priors: int, instants: Any, grid: tuple[int, int]
) -> Float[Array, "unknown unknown"]:
    r"""Covariance of the coordinates without trust in the stated noise, of one fit.

    The sandwich $B (\Omega + P) B$ of the covariance $B$ by the stated noise (`bread`), of $\Omega$,
    the long-run covariance of the scores $S_i^T r_i$, and of what the rows of priors, the last, add.
    $\Omega$ is not less than for residuals that are white and as large as they are, never smaller than
    stated: of the two the one with the larger variance counts, unknown by unknown.

    `instants`: number of the time in the `grid` (records, times) of each datum. Residuals of one
    time are summed, so that channels may hang together, and with them what else there is of a datum.
    """
    rows, data = residual.shape[0] - priors, instants.shape[0]
    slopes, r = matrix[:rows], residual[:rows]
    times = jnp.tile(instants, rows // data)
    scores = jnp.zeros((grid[0] * grid[1], slopes.shape[1])).at[times].add(slopes * r[:, None])
    free = max(data + priors - slopes.shape[1], 1)
    extra = jnp.maximum(jnp.sum(r[:data] ** 2) / free, 1.0)
    stated = matrix[rows:].T @ matrix[rows:]
    by_size = bread @ (extra * slopes.T @ slopes + stated) @ bread
    long_run = long_run_covariance(scores.reshape(*grid, -1)) * (data / free)
    by_time = bread @ (long_run + stated) @ bread
    larger = jnp.maximum(jnp.diagonal(by_size), jnp.diagonal(by_time))
    size = jnp.sqrt(jnp.diagonal(by_time))
    # The correlations are those over time.
    ratio = jnp.where(size > 0.0, jnp.sqrt(larger) / jnp.where(size > 0.0, size, 1.0), 1.0)
    return by_time * ratio[:, None] * ratio[None] + jnp.diag(jnp.where(size > 0.0, 0.0, larger))


def long_run_covariance(scores: Float[Array, "record time unknown"]) -> Any:
    r"""$\sum_k w_k \sum_t g_t g_{t+k}^T$ by the kernel of Bartlett, of series whitened by a lag of one.

    W. K. Newey, K. D. West, Econometrica 55 (1987); width by D. W. K. Andrews, Econometrica 59 (1991),
    for first-order series; whitening by Andrews and J. C. Monahan, Econometrica 60 (1992), whose limit
    of 0.97 of the correlation is kept.
    """
    own = _first_correlation(scores)
    rest = scores[:, 1:] - own[None, None] * scores[:, :-1]
    there = jnp.sum(jnp.any(rest != 0.0, axis=-1).astype(jnp.float64))
    rho = _first_correlation(rest)
    bend = jnp.sum(4.0 * rho**2 / ((1.0 - rho) ** 6 * (1.0 + rho) ** 2))
    width = 1.1447 * jnp.cbrt(bend / jnp.sum(1.0 / (1.0 - rho) ** 4) * there)
    width = jnp.floor(jnp.minimum(width, 0.5 * there)) + 1.0
    # All lags at once, in the frequencies: the transform of the kernel is nowhere negative.
    length = 2 * rest.shape[1]
    lags = jnp.arange(float(length))
    lags = jnp.minimum(lags, length - lags)
    kernel = jnp.fft.rfft(jnp.maximum(1.0 - lags / width, 0.0)).real
    twice = jnp.full(kernel.shape, 2.0).at[0].set(1.0).at[-1].set(1.0)
    weight = jnp.sqrt(jnp.maximum(twice * kernel / length, 0.0))[None, :, None]
    spectrum = jnp.fft.rfft(rest, length, axis=1)
    parts = [(part * weight).reshape(-1, own.size) for part in (spectrum.real, spectrum.imag)]
    found = sum(part.T @ part for part in parts)
    back = 1.0 / (1.0 - own)
    return back[:, None] * found * back[None]


def _first_correlation(scores: Any) -> Any:
    after = jnp.sum(scores[:, 1:] * scores[:, :-1], axis=(0, 1))
    size = jnp.sum(scores[:, :-1] ** 2, axis=(0, 1))
    return jnp.clip(after / jnp.where(size > 0.0, size, 1.0), -0.97, 0.97)
