"""Spectra of signals whose lines are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.analysis import amplitude_spectrum, spectral_peaks

DT, SIZE = 0.01, 4000
T = DT * np.arange(SIZE)


@pytest.mark.parametrize("window", ["hann", "rectangular"])
@pytest.mark.parametrize("frequency", [5.0, 5.007, 5.0125])  # bins are 0.025 Hz apart
def test_one_sine(window, frequency):
    """Frequency and amplitude of a sine on a bin, beside it and between two."""
    signal = 0.3 + 0.02 * np.sin(2 * np.pi * frequency * T + 0.4)
    spectrum = amplitude_spectrum(signal, DT, window=window)
    assert spectrum.resolution == pytest.approx(0.025)
    peak = spectral_peaks(spectrum, count=1)[0]
    assert peak.frequency == pytest.approx(frequency, abs=2e-4)
    assert peak.amplitude == pytest.approx(0.02, rel=2e-2 if window == "rectangular" else 1e-3)
    assert float(spectrum.amplitude[0]) == pytest.approx(0.3, rel=2e-3)


def test_whole_periods_are_exact():
    """Two lines on bins, mean and the last bin: Parseval with a rectangular window."""
    signal = 1.0 + 0.5 * np.cos(2 * np.pi * 3 * T) + 0.2 * np.cos(np.pi / DT * T)
    spectrum = amplitude_spectrum(signal, DT, window="rectangular")
    a = np.asarray(spectrum.amplitude)
    np.testing.assert_allclose(a[[0, 120, -1]], [1.0, 0.5, 0.2], rtol=1e-10)
    power = a[0] ** 2 + 0.5 * np.sum(a[1:-1] ** 2) + a[-1] ** 2
    np.testing.assert_allclose(power, np.mean(signal**2), rtol=1e-12)


def test_harmonics_are_named():
    """A saw tooth of period 0.54: amplitudes 2/(pi n); a line of another origin; one of none."""
    f_s, f_b = 1 / 0.54, np.pi / 2
    t = 0.02 * np.arange(16_000)
    saw = sum(2 / (np.pi * n) * np.sin(2 * np.pi * n * f_s * t) for n in range(1, 8))
    signal = saw + 0.3 * np.sin(2 * np.pi * f_b * t) + 0.15 * np.sin(2 * np.pi * 4.321 * t)
    peaks = spectral_peaks(amplitude_spectrum(signal, 0.02), count=9, bases={"f_s": f_s, "f_1": f_b})
    assert [p.name for p in peaks[:5]] == ["1 f_s", "2 f_s", "1 f_1", "3 f_s", "4 f_s"]
    by_name = {p.name: p for p in peaks}
    assert by_name[""].frequency == pytest.approx(4.321, abs=1e-3)
    for n in range(1, 8):
        assert by_name[f"{n} f_s"].amplitude == pytest.approx(2 / (np.pi * n), rel=2e-3)
    assert spectral_peaks(amplitude_spectrum(np.ones(64), 1.0)) == []


def test_batch_and_jit():
    signals = np.stack([np.sin(2 * np.pi * 2 * T), np.sin(2 * np.pi * 7 * T)])
    both = jax.jit(lambda s: amplitude_spectrum(s, DT).amplitude)(signals)
    assert both.shape == (2, SIZE // 2 + 1)
    np.testing.assert_allclose(both[1], amplitude_spectrum(signals[1], DT).amplitude, atol=1e-15)
    assert jnp.argmax(both[0]) == 80
    turned = amplitude_spectrum(signals.T, DT, axis=0)
    np.testing.assert_array_equal(turned.amplitude, amplitude_spectrum(signals, DT).amplitude)


def test_bad_input():
    spectrum = amplitude_spectrum(np.sin(T), DT)
    with pytest.raises(ValueError, match="window = 'hamming': it must be one of"):
        amplitude_spectrum(np.sin(T), DT, window="hamming")
    with pytest.raises(ValueError, match=r"dt = 0\.0"):
        amplitude_spectrum(np.sin(T), 0.0)
    with pytest.raises(ValueError, match="at least 8 samples"):
        amplitude_spectrum(np.ones(5), DT)
    with pytest.raises(ValueError, match="axis = 1: it must be from -1 to 0"):
        amplitude_spectrum(np.ones(9), DT, axis=1)
    with pytest.raises(ValueError, match="that of one signal"):
        spectral_peaks(amplitude_spectrum(np.ones((2, 64)), DT))
    with pytest.raises(ValueError, match="count = 0"):
        spectral_peaks(spectrum, count=0)
    with pytest.raises(ValueError, match=r"bases\['f'\] = -1.0"):
        spectral_peaks(spectrum, bases={"f": -1.0})
