"""The excitation of the firmware, and tones of spans: closed forms, noise."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from corexy_jax.elastic import pluck_tone, resonance_sweep, span_frequency, span_tension

PER_HZ = 0.06


def test_a_sweep_rests_after_each_half_period_and_turns():
    path = resonance_sweep([3.0, 4.0], 20.0, 60.0, 30.0, PER_HZ, x=0.1, y=-0.05, begin=2.0)
    # By the sums of the definition, one half period after the other.
    f, t, place, sign, frequencies = 20.0, 2.0, 0.0, 1.0, []
    speeds = jax.jit(jax.vmap(lambda t: jnp.stack([*path(t, None)[0], *path(t, None)[1]])))
    asked, expected = [], []
    while f <= 60.0:
        half = 0.5 / f
        asked += [t, t + 0.5 * half, t + half]
        top, way = PER_HZ / 4.0, PER_HZ * f * (0.25 / f) ** 2
        expected += [(place, 0.0), (place + 0.5 * sign * way, sign * top), (place + sign * way, 0.0)]
        t, place, sign = t + half, place + sign * way, -sign
        frequencies.append(f)
        f += half * 30.0
    found = np.asarray(speeds(jnp.asarray(asked)))
    unit = np.array([0.6, 0.8])
    reached, speed = np.array(expected).T
    np.testing.assert_allclose(found[:, :2], [0.1, -0.05] + reached[:, None] * unit, atol=1e-14)
    np.testing.assert_allclose(found[:, 2:], speed[:, None] * unit, atol=1e-12)
    assert float(path.duration) == pytest.approx(t - 2.0, rel=1e-12)
    sizes = np.hypot(*np.asarray(path.accelerations).T)
    np.testing.assert_allclose(sizes, np.repeat(PER_HZ * np.array(frequencies), 2), rtol=1e-12)
    # Two halves take it back but for what the frequency has grown meanwhile.
    assert np.max(np.abs(reached)) <= PER_HZ / (16.0 * 20.0) * (1.0 + 1e-12)


def test_one_frequency_is_one_half_period():
    path = resonance_sweep((0.0, -2.0), 50.0, 50.0, 1.0, PER_HZ)
    np.testing.assert_allclose(path.times, [0.0, 0.005, 0.01], rtol=1e-14)
    np.testing.assert_allclose(path.accelerations, [[0.0, -3.0], [0.0, 3.0]], atol=1e-15)


def test_wrong_sweeps_are_named():
    for given, words in (
        (((0.0, 0.0), 20.0, 60.0, 1.0, PER_HZ), "direction = "),
        (((1.0, 0.0, 0.0), 20.0, 60.0, 1.0, PER_HZ), "direction = "),
        (((1.0, 0.0), 20.0, 10.0, 1.0, PER_HZ), "f1 = 10.0"),
        (((1.0, 0.0), 20.0, 1e6, 1.0, PER_HZ), "a million pieces"),
        (((1.0, 0.0), 20.0, 60.0, 0.0, PER_HZ), "rate = 0.0"),
    ):
        with pytest.raises(ValueError, match=words):
            resonance_sweep(*given)


def test_a_string_sounds_as_its_wave_travels():
    """Twice its length in a period, at the speed of waves."""
    T, rho, L = 20.0, 0.0084, np.array([0.1, 0.15])
    f = span_frequency(T, rho, L)
    np.testing.assert_allclose(2.0 * L * np.asarray(f), np.sqrt(T / rho), rtol=1e-14)
    np.testing.assert_allclose(span_tension(f, rho, L), T, rtol=1e-14)


def tone(seed, samples, rate, noise):
    """Tension, record, and the bound of Cramér and Rao of the frequency, by numbers of their own."""
    rng = np.random.default_rng(seed)
    T, L, decay, phase = rng.uniform((8.0, 0.12, 3.0, 0.0), (40.0, 0.3, 12.0, 6.0))
    f, t = float(span_frequency(T, 0.0084, L)), np.arange(samples) / rate

    def wave(p):
        return p[0] * np.exp(-p[1] * t) * np.cos(2.0 * np.pi * p[2] * t + p[3]) + p[4]

    p = np.array([1.0, decay, f, phase, 0.3])
    slopes = np.stack([(wave(p + h) - wave(p - h)) / 2e-6 for h in 1e-6 * np.eye(5)], axis=1)
    bound = noise * np.sqrt(np.linalg.inv(slopes.T @ slopes)[2, 2])
    return T, L, f, t, wave(p) + noise * rng.normal(size=samples), bound


@pytest.mark.more
def test_a_pluck_tells_the_tension():
    z = []
    for seed in range(3):
        T, L, f, t, record, bound = tone(seed, 1600, 800.0, 0.2)
        found = pluck_tone(1.5 + t, record, 20.0, 390.0)
        assert found.error == pytest.approx(bound, rel=0.25)
        assert float(span_tension(found.frequency, 0.0084, L)) == pytest.approx(T, rel=0.02)
        z.append((found.frequency - f) / bound)
        share = 1.0 - 0.2**2 / np.var(record)
        assert found.explained == pytest.approx(share, abs=0.05)
    assert np.max(np.abs(z)) < 3.0


@pytest.mark.slow
def test_intervals_of_plucks_hold():
    inside, off = 0, []
    for seed in range(200):
        T, L, f, t, record, _ = tone(seed, 1600, 800.0, 0.2)
        found = pluck_tone(t, record, 20.0, 390.0)
        inside += abs(found.frequency - f) < 1.96 * found.error
        off.append(abs(float(span_tension(found.frequency, 0.0084, L)) / T - 1.0))
    assert max(off) < 0.02
    assert 186 <= inside <= 194


def test_wrong_plucks_are_named():
    t = np.arange(100) / 100.0
    for given, words in (
        ((t, np.sin(t)[:-1], 1.0, 40.0), "record"),
        ((t, 0.0 * t, 1.0, 40.0), "record"),
        ((t, np.sin(t), 1.0, 60.0), "highest = 60.0"),
        ((t, np.sin(t), 10.0, 5.0), "highest = 5.0"),
        ((t[::-1], np.sin(t), 1.0, 40.0), r"times\[1\]"),
    ):
        with pytest.raises(ValueError, match=words):
            pluck_tone(*given)
