"""Tension of a belt from the tone of a free span."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from stickslip.checks import (
    Given,
    Numeric,
    Row,
    check_increasing,
    check_known,
    check_positive,
    one_concrete,
    one_row,
    refusal,
    shape_refusal,
)
from stickslip.identification import Fit, Unknown, least_squares

SMALL = 1e-6  # stated noise, of the deviation of a record: errors are then by the residuals as they are


def span_frequency(tension: Numeric, mass_per_length: Numeric, length: Numeric) -> Any:
    r"""Lowest frequency [Hz] of a string, $f = \frac{1}{2L}\sqrt{T/\rho}$.

    Bending stiffness, which a belt has too, makes short spans sound higher.

    **Arguments:** `tension` $T$ [N], `mass_per_length` $\rho$ [kg/m], `length` $L$ [m] of the free span
    between two pulleys, or pulley and clamp; positive. **Raises** `TypeError`, `ValueError` naming the
    argument.
    """
    T, rho, L = _positive(tension=tension, mass_per_length=mass_per_length, length=length)
    return jnp.sqrt(T / rho) / (2.0 * L)


def span_tension(frequency: Numeric, mass_per_length: Numeric, length: Numeric) -> Any:
    r"""Tension [N] of a span that sounds with this lowest frequency, $T = \rho(2Lf)^2$.

    It grows with the square of both: 1% of the length is 2% of the tension.

    **Arguments:** `frequency` $f$ [Hz]; the others as of `span_frequency`. **Raises** `TypeError`,
    `ValueError` naming the argument.
    """
    f, rho, L = _positive(frequency=frequency, mass_per_length=mass_per_length, length=length)
    return rho * (2.0 * L * f) ** 2


def _positive(**values: Any) -> list[Any]:
    return [jnp.asarray(check_positive(name, value), jnp.float64) for name, value in values.items()]


class Pluck(NamedTuple):
    """What a decaying tone shows.

    - `frequency` [Hz], its standard `error` [Hz]; `decay` [1/s].
    - `explained`: part of the variance of the record that the tone is, from 0 to 1. Where it is small,
      there are other tones, and this one need not be the lowest of the span.
    """

    frequency: float
    error: float
    decay: float
    explained: float


def pluck_tone(times: Given[Row], record: Given[Row], lowest: Numeric, highest: Numeric) -> Pluck:
    r"""Frequency of a plucked span from an acceleration or a sound, by least squares.

    $$e^{-\gamma t}(a\cos\omega t + b\sin\omega t) + c, \qquad \gamma > 0$$

    is fitted from the highest point of the spectrum between two frequencies on. The error is that of
    the linearised problem with the size of the residuals, as they are, and with their correlation in
    time (`Fit.standard_errors(robust=True)`): of white noise, the bound of Cramér and Rao.

    **Arguments:** `times` [s], increasing, and the `record` in any unit, rows of 16 samples or more
    that begin after the pluck; `lowest`, `highest` [Hz]: where to look, positive, below half the rate
    of the samples. **Returns** a `Pluck`. **Raises** `TypeError`, `ValueError` naming the argument. It
    reads numbers and does not work under `jit`.
    """
    t, s = (
        np.asarray(one_row(name, check_known(name, row), least=16), np.float64)
        for name, row in (("times", times), ("record", record))
    )
    check_increasing("times", t)
    if s.shape != t.shape:
        raise shape_refusal("record", record, f"as long as times, {t.size}")
    if np.ptp(s) == 0.0:
        raise refusal("record", record, "a row that changes")
    low, high = (
        float(one_concrete(name, value, "positive"))
        for name, value in (("lowest", lowest), ("highest", highest))
    )
    most = 0.5 * (t.size - 1) / (t[-1] - t[0])
    if not low < high <= most:
        allowed = f"above lowest = {low:g}, and not above half the rate of the samples, {most:g}"
        raise refusal("highest", highest, allowed)
    t, s = t - t[0], (s - np.mean(s)) / np.std(s)
    even = np.interp(np.linspace(0.0, t[-1], t.size), t, s)
    spectrum = np.fft.rfft(even, 8 * t.size)
    frequencies = np.arange(spectrum.size) * (t.size - 1) / (8 * t.size * t[-1])
    inside = (frequencies >= low) & (frequencies <= high)
    if not np.any(inside):
        raise refusal("highest", highest, f"at least {1.0 / t[-1]:g} above lowest = {low:g}")
    first = frequencies[np.argmax(np.where(inside, np.abs(spectrum), -1.0))]
    fit = _decaying(t, s, float(first))
    rest = np.asarray(fit.residual) * SMALL
    error = fit.standard_errors(robust=True)["frequency"]
    explained = max(1.0 - float(np.mean(rest**2)), 0.0)
    return Pluck(float(fit.values["frequency"]), float(error), float(fit.values["decay"]), explained)


def _decaying(t: np.ndarray, s: np.ndarray, frequency: float) -> Fit:
    """A decaying tone fitted to a row without mean and of deviation 1."""
    turn = 2.0 * np.pi * frequency * t
    starts = []
    for decay in np.geomspace(0.1, 100.0, 7) / t[-1]:
        fade = np.exp(-decay * t)
        columns = np.stack([fade * np.cos(turn), fade * np.sin(turn), np.ones(t.size)], axis=1)
        found = np.linalg.lstsq(columns, s, rcond=None)[0]
        starts.append((float(np.sum((columns @ found - s) ** 2)), decay, *found))
    _, decay, *found = min(starts)
    unknowns = {"frequency": frequency, "decay": float(decay)}
    free = zip(("cos", "sin", "offset"), found, strict=True)
    unknowns |= {name: Unknown(float(value), scale=1.0) for name, value in free}
    times, row = jnp.asarray(t), jnp.asarray(s)

    def residual(p):
        turn = 2.0 * jnp.pi * p["frequency"] * times
        wave = p["cos"] * jnp.cos(turn) + p["sin"] * jnp.sin(turn)
        return (jnp.exp(-p["decay"] * times) * wave + p["offset"] - row) / SMALL

    return least_squares(residual, unknowns)
