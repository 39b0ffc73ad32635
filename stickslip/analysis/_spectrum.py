"""Amplitude spectra of time histories, their peaks, and what these are harmonics of."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._show import amount, number
from .._types import Given, NamedNumbers, Numeric, Row
from .._validation import (
    check_count,
    check_finite,
    check_in,
    check_mapping,
    check_type,
    is_concrete,
    one_number,
    refusal,
    shape_refusal,
)

WINDOWS = ("hann", "rectangular")


class Spectrum(eqx.Module):
    """Amplitudes over frequencies; batch axes come in front.

    - `frequency` [Hz], `[bin]`; the spacing of the bins is one over the length of the signal.
    - `amplitude`, in the unit of the signal: of the sine at that frequency; bin 0 is the mean.
    """

    frequency: Float[Array, " bin"]
    amplitude: Float[Array, "*batch bin"]
    window: str = eqx.field(static=True)

    def __repr__(self) -> str:
        if not is_concrete(self):
            return f"Spectrum(traced, of shape {self.amplitude.shape})"
        amplitude, frequency = np.asarray(self.amplitude), np.asarray(self.frequency)
        many = f"{amount(amplitude[..., 0].size, 'signal')}, " if amplitude.ndim > 1 else ""
        text = f"Spectrum: {many}{frequency.size:,} frequencies from 0 to {number(frequency[-1])} Hz"
        if amplitude.ndim > 1 or frequency.size < 2:
            return text
        top = 1 + int(np.argmax(amplitude[1:]))
        where = f"{number(amplitude[top])} at {number(frequency[top])} Hz"
        return f"{text}, mean {number(amplitude[0])}, the greatest amplitude {where}"

    @property
    def resolution(self) -> Float[Array, ""]:
        """Spacing of the bins [Hz]."""
        return self.frequency[1]


class Peak(NamedTuple):
    """A line of a spectrum."""

    frequency: float  # [Hz], between the bins
    amplitude: float  # in the unit of the signal, of the sine at that frequency
    harmonic_of: str  # name of the base it is a harmonic of, "" if none
    number: int  # which harmonic, 0 if none

    @property
    def name(self) -> str:
        """Such as `"3 f_s"`; empty if it is not a harmonic of a named base."""
        return f"{self.number} {self.harmonic_of}" if self.number else ""


def amplitude_spectrum(
    signal: Row,
    dt: Numeric,
    *,
    window: Given[Literal["hann", "rectangular"]] = "hann",
    axis: Given[int] = -1,
) -> Spectrum:
    r"""Amplitude spectrum of an evenly sampled signal, in its own unit,

    $$A_k = \frac{c_k}{\sum_n h_n}\Bigl|\sum_n h_n (u_n - \bar u)\,e^{-2\pi i k n/M}\Bigr|,
      \qquad f_k = \frac{k}{M\,\Delta t},$$

    $c_k = 2$, and 1 at the last bin of an even $M$; $A_0$ is $|\bar u|$. A sine of amplitude $a$ at a
    bin gives $A_k = a$ there. The mean is taken off first, lest the window smear it.

    **Arguments:** `signal`, at least 8 samples along `axis`, by default the last one (of a recorded
    array `"x"` time is the first axis of a run: `axis=0`); `dt` [s] between samples; `window` $h$:
    `"hann"` (periodic; lines 3 bins wide, little leakage) or `"rectangular"` (for whole periods).
    **Returns** a `Spectrum`, its frequencies along the last axis. **Errors** `ValueError` for another
    window, an axis that the signal lacks, `dt <= 0`, too few samples. Works under `jit` and `vmap`.
    """
    check_in("window", window, WINDOWS)
    one_number("dt", dt, "positive")
    u = jnp.asarray(check_finite("signal", signal), jnp.float64)
    if not isinstance(axis, int) or isinstance(axis, bool):
        raise refusal("axis", axis, "the number of an axis of the signal", TypeError)
    if u.ndim and not -u.ndim <= axis < u.ndim:
        raise refusal("axis", axis, f"from {-u.ndim} to {u.ndim - 1}")
    if u.ndim == 0 or u.shape[axis] < 8:
        raise shape_refusal("signal", signal, "an array of at least 8 samples, along the axis")
    u = jnp.moveaxis(u, axis, -1)
    size = u.shape[-1]
    angle = 2 * np.pi * np.arange(size) / size
    h = jnp.asarray(0.5 - 0.5 * np.cos(angle) if window == "hann" else np.ones(size))
    mean = jnp.mean(u, axis=-1, keepdims=True)
    weighted = (u - mean) * h.reshape((1,) * (u.ndim - 1) + (-1,))
    amplitude = 2.0 / jnp.sum(h) * jnp.abs(jnp.fft.rfft(weighted, axis=-1))
    if size % 2 == 0:
        amplitude = amplitude.at[..., -1].mul(0.5)
    amplitude = amplitude.at[..., 0].set(jnp.abs(mean[..., 0]))
    frequency = jnp.arange(size // 2 + 1, dtype=jnp.float64) / (size * jnp.asarray(dt, jnp.float64))
    return Spectrum(frequency, amplitude, window)


def spectral_peaks(
    spectrum: Spectrum,
    *,
    count: Given[int] = 10,
    floor: Numeric = 1e-3,
    bases: NamedNumbers | None = None,
    tolerance: Given[float] = 1.0,
) -> list[Peak]:
    r"""Highest lines of a spectrum of one signal, greatest first.

    A peak is a bin above its neighbours (the mean is none). Its frequency and amplitude are those of
    the single sine that gives the two highest of its bins: with their ratio $r$ the offset in bins is
    $\delta = (2r - 1)/(r + 1)$ for the Hann and $r/(1 + r)$ for the rectangular window. A line less
    than two bins from another is not resolved.

    **Arguments**

    - `count`: at most so many; `floor`: none below this part of the highest.
    - `bases`: names and frequencies [Hz], e.g. `{"f_s": 1 / 0.54}`: each peak is named after the base
      of which it is the nearest harmonic, if it lies within `tolerance` bins of it. If several are
      equally near, to a tenth of a bin, the lowest number wins.

    **Errors** `ValueError` for a batch, a `count` below 1, or a base that is not positive.
    """
    check_type("spectrum", spectrum, Spectrum, "a Spectrum")
    amplitude, frequency = np.asarray(spectrum.amplitude), np.asarray(spectrum.frequency)
    if amplitude.ndim != 1:
        raise refusal("spectrum", spectrum, "that of one signal", but=f"of shape {amplitude.shape}")
    check_count("count", count, 1)
    one_number("floor", floor, "not negative")
    one_number("tolerance", tolerance, "positive")
    bases = check_mapping("bases", bases, "a mapping from names to frequencies")
    for name, base in bases.items():
        one_number(f"bases[{name!r}]", base, "positive")
    inner = np.arange(2, amplitude.size - 1)
    higher = (amplitude[inner] > amplitude[inner - 1]) & (amplitude[inner] >= amplitude[inner + 1])
    found = inner[higher]
    found = found[np.argsort(-amplitude[found], kind="stable")][:count]
    if found.size == 0 or amplitude[found[0]] == 0.0:
        return []
    top, width = amplitude[found[0]], frequency[1]
    peaks = []
    for k in (k for k in found if amplitude[k] >= floor * top):
        offset, gain = _between_bins(amplitude, int(k), spectrum.window)
        f = float((k + offset) * width)
        name, number = _harmonic(f, bases, width, tolerance)
        peaks.append(Peak(f, float(amplitude[k] * gain), name, number))
    return peaks


def _between_bins(amplitude: np.ndarray, k: int, window: str) -> tuple[float, float]:
    """Offset from bin `k` in bins, and amplitude of the sine over that of the bin."""
    side = 1.0 if amplitude[k + 1] >= amplitude[k - 1] else -1.0
    ratio = amplitude[k + int(side)] / amplitude[k]
    hann = window == "hann"
    delta = min(max((2 * ratio - 1) / (ratio + 1) if hann else ratio / (1 + ratio), 0.0), 0.5)
    gain = 1.0 / np.sinc(delta) * (1 - delta**2 if hann else 1.0)
    return side * delta, float(gain)


def _harmonic(f: float, bases: Mapping[str, float], width: float, tolerance: float) -> tuple[str, int]:
    near = []
    for name, base in bases.items():
        number = round(f / base)
        miss = abs(f - number * base) / width
        if number >= 1 and miss <= tolerance:
            near.append((round(miss, 1), number, name))
    if not near:
        return "", 0
    _, number, name = min(near)
    return name, number
