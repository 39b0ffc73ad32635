"""Growth of small deviations: re-orthonormalisation, averages and their errors."""

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._show import amount, html_table, number
from .._types import Numeric, Whole
from .._validation import check_count, is_concrete, refusal
from ..hybrid.accuracy import ACCURACY as ENGINE

# Meanings of an exponent. New words go to the end.
EXPONENT_STATUS = ("ok", "lost", "at_rest", "failed", "neutral")


class LyapunovSpectrum(eqx.Module):
    r"""Lyapunov exponents, greatest first, and how sure they are. Batch axes come in front.

    - `exponents` [1/s] (per iteration for a map): mean growth rates. Rates that agree within their
      errors may stand either way: the order is that of the directions followed. `-inf` for a
      direction that is lost in finite time: where slip turns into stick the tangent map loses rank.
    - `error` [1/s]: the larger of two estimates: standard error of the mean from block means, which
      covers what fluctuates, and the change of the mean if only the second half counts, which covers
      what still drifts. NaN where the exponent is not finite.
    - `local` [1/s], `[segment, exponent]`: growth rates segment by segment.
    - `time` [s], `[segment]`: end of each segment, from the start of the average.
    - `lost`: in how many segments each direction was lost.
    - `t1`, `y1`, `mode1`: where the motion ended (`None` for the mode of a map).
    - `result`: worst result code of all segments (`None` for a map); where it is not a success the
      exponents are NaN. `flags`: as in `Solution`, of all segments together.
    - `status`, an exponent each, and `words` for it: 0 "ok"; 1 "lost", the exponent is `-inf`; 2
      "at_rest", the state stays where it is and no exponent is off zero by three errors, as in stick,
      where the motion does not say what becomes of a deviation that leaves the stick: NaN; 3
      "failed", the motion or its growth is not finite or ended early: NaN; 4 "neutral", of a shift of
      the state that changes nothing, as of a body which no spring holds: exactly 0 but for its error.
    """

    exponents: Float[Array, "*batch exponent"]
    error: Float[Array, "*batch exponent"]
    local: Float[Array, "*batch segment exponent"]
    time: Float[Array, "*batch segment"]
    lost: Int[Array, "*batch exponent"]
    t1: Numeric
    y1: PyTree
    mode1: Whole | None = None
    result: Any = None
    flags: Whole | None = None
    status: Whole | None = None

    def __str__(self) -> str:
        """Each exponent with its error; of a batch, how many there are and the greatest ones."""
        if not is_concrete(self):
            return f"LyapunovSpectrum(traced, of shape {self.exponents.shape})"
        values, errors = np.asarray(self.exponents), np.asarray(self.error)
        if values.ndim > 1:
            return f"LyapunovSpectrum: {_of_batch(values[..., 0])}, {values.shape[-1]} exponents each"
        head = f"LyapunovSpectrum of {amount(self.time.size, 'segment')}, to {number(self.time[-1])} s:"
        return "\n".join([head, *(f"  {a} {b}" for a, b in _exponents(self, values, errors))])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        if not is_concrete(self) or self.exponents.ndim > 1:
            return html_table(str(self), (), ())
        values, errors = np.asarray(self.exponents), np.asarray(self.error)
        head = str(self).partition(":")[0]
        return html_table(head, ("exponent", ""), _exponents(self, values, errors))

    @property
    def words(self) -> Any:
        """`status` in words, as a NumPy array of texts."""
        return np.asarray(EXPONENT_STATUS)[np.asarray(self.status)]

    @property
    def running(self) -> Float[Array, "*batch segment exponent"]:
        """Mean growth rates up to each `time` [1/s]: the exponent as it converges."""
        steps = jnp.arange(1, self.local.shape[-2] + 1, dtype=jnp.float64)
        return jnp.cumsum(self.local, axis=-2) / steps.reshape(-1, 1)

    @property
    def sum(self) -> Float[Array, "*batch"]:
        """Sum of the exponents [1/s]: of the full spectrum, the mean growth of volume."""
        return jnp.sum(self.exponents, axis=-1)

    @property
    def kaplan_yorke_dimension(self) -> Float[Array, "*batch"]:
        r"""$j + \sum_{i \le j}\lambda_i/|\lambda_{j+1}|$, $j$ the last with a sum not below zero.

        For the full spectrum, an estimate of the information dimension of the attractor (Kaplan &
        Yorke 1979). 0 where all exponents are negative, the dimension of the state where no partial
        sum is. An exponent that is zero counts with the error it has. NaN where an exponent is.
        """
        sums = jnp.cumsum(self.exponents, axis=-1)
        size = self.exponents.shape[-1]
        j = jnp.sum(jnp.cumprod((sums >= 0).astype(jnp.int32), axis=-1), axis=-1)
        before = jnp.take_along_axis(sums, jnp.maximum(j - 1, 0)[..., None], axis=-1)[..., 0]
        nearest = jnp.minimum(j, size - 1)[..., None]
        after = jnp.take_along_axis(self.exponents, nearest, axis=-1)[..., 0]
        inside = (j > 0) & (j < size)
        part = jnp.where(inside, before / jnp.where(inside, jnp.abs(after), 1.0), 0.0)
        unknown = jnp.any(jnp.isnan(self.exponents), axis=-1)
        return jnp.where(unknown, jnp.nan, j.astype(jnp.float64) + part)


def _exponents(spectrum: LyapunovSpectrum, values: Any, errors: Any) -> list[tuple[str, str]]:
    """Each exponent of a spectrum in text, and what it is where it is not a number."""
    words = ["ok"] * values.size if spectrum.status is None else spectrum.words
    return [
        (f"{value:+.6g} +- {error:.2g}", "1/s" + f" ({word})" * (word != "ok"))
        if np.isfinite(value)
        else (f"{value}", f"({word})")
        for value, error, word in zip(values, errors, words, strict=True)
    ]


def _of_batch(greatest: Any) -> str:
    finite = greatest[np.isfinite(greatest)]
    span = (
        f" from {number(finite.min())} to {number(finite.max())} 1/s" if finite.size else " not finite"
    )
    return f"{amount(greatest.size, 'spectrum', 'spectra')}, the greatest exponent{span}"


def first_frame(size: int, count: int) -> Float[Array, "size count"]:
    """Orthonormal columns in general position, the same on every call."""
    rows = jnp.arange(1.0, size + 1)[:, None]
    columns = jnp.arange(1.0, count + 1)[None, :]
    return jnp.linalg.qr(jnp.sin(rows * columns * columns + 0.7 * rows * rows))[0]


def orthonormal_columns(
    images: Float[Array, "size count"],
) -> tuple[Float[Array, "size count"], Float[Array, " count"]]:
    """Orthonormal columns that span the images one after the other, and the logarithms of growth.

    `-inf` for a column that lies in the span of those before it; another direction takes its place.
    NaN where an image is not finite.
    """
    q, r = jnp.linalg.qr(images)
    growth = jnp.abs(jnp.diagonal(r))
    longest = jnp.max(jnp.sqrt(jnp.sum(images * images, axis=0)))
    alive = growth > ENGINE.solved * longest
    growth = jnp.where(alive, jnp.log(jnp.where(alive, growth, 1.0)), -jnp.inf)
    # A comparison with NaN or infinity is false, which is not the same as lost.
    return q, jnp.where(jnp.all(jnp.isfinite(images)), growth, jnp.nan)


def mean_and_error(
    local: Float[Array, "segment exponent"], blocks: int
) -> tuple[Float[Array, " exponent"], Float[Array, " exponent"]]:
    """Mean over the segments and its error, see `LyapunovSpectrum.error`."""
    size = local.shape[0] // blocks
    used = local[local.shape[0] - size * blocks :]
    means = jnp.mean(used.reshape(blocks, size, -1), axis=1)
    mean = jnp.mean(local, axis=0)
    finite = jnp.isfinite(mean)[None, :]
    means = jnp.where(finite, means, 0.0)
    spread = jnp.std(means, axis=0, ddof=1) / blocks**0.5
    late = jnp.where(finite[0], jnp.mean(local[local.shape[0] // 2 :], axis=0), 0.0)
    drift = jnp.abs(late - jnp.where(finite[0], mean, 0.0))
    return mean, jnp.where(finite[0], jnp.maximum(spread, drift), jnp.nan)


# One program for every length of record, not fifty operations.
@functools.partial(jax.jit, static_argnums=2)
def spectrum_of_rates(
    local: Float[Array, "segment exponent"], rests: Any, blocks: int
) -> tuple[Float[Array, " exponent"], Float[Array, " exponent"], Int[Array, " exponent"]]:
    """Exponents, errors and `LyapunovSpectrum.status`; `rests`: whether the state never moved."""
    mean, error = mean_and_error(local, blocks)
    # Where the linear field decides, deviations of a rest grow or shrink for sure; those that a stick
    # takes away say nothing.
    still = rests & jnp.all((jnp.abs(mean) <= 3.0 * error) | jnp.isneginf(mean))
    mean, error = (jnp.where(still, jnp.nan, a) for a in (mean, error))
    status = jnp.zeros(mean.shape, jnp.int32)
    for word, applies in (
        ("lost", jnp.isneginf(mean)),
        ("failed", jnp.isnan(mean) | jnp.isposinf(mean)),
        ("at_rest", still),
    ):
        status = jnp.where(applies, EXPONENT_STATUS.index(word), status)
    return jnp.where(jnp.isposinf(mean), jnp.nan, mean), error, status


def with_neutral(
    mean: Float[Array, " exponent"],
    error: Float[Array, " exponent"],
    status: Int[Array, " exponent"],
    count: Int[Array, ""],
) -> Int[Array, " exponent"]:
    """The status with so many exponents "neutral": those nearest to zero, if they are zero."""
    away = jnp.where(status == 0, jnp.abs(mean), jnp.inf)
    nearest = jnp.argsort(jnp.argsort(away)).astype(count.dtype) < count
    named = nearest & (away <= 3.0 * error)
    return jnp.where(named, EXPONENT_STATUS.index("neutral"), status)


def check_exponents(exponents: Any, size: int) -> None:
    """Raise for a number of exponents that there cannot be."""
    check_count("exponents", exponents, 1)
    if exponents > size:
        raise refusal("exponents", exponents, f"at most {size}, the number of directions")


def accumulate(step, carry, frame, *, count, warm_up) -> tuple[Any, Float[Array, "segment exponent"]]:
    """Carry after `warm_up` and `count` segments, and the logarithms of growth over the latter.

    `step(carry, frame) -> (carry, images)` maps the columns of the frame through one segment.
    """

    def segment(state, _):
        carry, images = step(*state)
        frame, growth = orthonormal_columns(images)
        return (carry, frame), growth

    (carry, _), growth = jax.lax.scan(segment, (carry, frame), None, length=warm_up + count)
    return carry, growth[warm_up:]
