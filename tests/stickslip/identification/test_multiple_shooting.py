"""Multiple shooting along stick-slip records: the same optimum, from starts where single shooting ends
in another minimum."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.identification import (
    LevenbergMarquardt,
    MultipleShooting,
    Observed,
    Problem,
    Record,
)
from stickslip.identification._shooting import Shooting, residual_and_jacobian, segments_of
from stickslip.identification._unknowns import scalars
from stickslip.systems import CoulombOscillator, Motion

TRUTH = {"kinetic": 0.5, "static": 1.0, "stiffness": 1.0}
BELT = 0.2
PERIOD = 2 * 0.5 / BELT + 2 * (np.pi - np.arctan(0.5 / BELT))  # closed form, see CoulombOscillator
SIGMA = 0.01
# A run of a bad trial ends soon.
INTEGRATOR = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-8), max_steps=5000)
POLISH = LevenbergMarquardt(tolerance=1e-15)


def block(values, inputs):
    return CoulombOscillator(1.0, values["stiffness"], values["static"], values["kinetic"], BELT)


def start(values, inputs):
    return Motion(x=0.1, v=BELT)


def guess(t, values, slopes):
    return Motion(x=values["x"], v=slopes["x"])


def record(periods):
    """Noisy positions, 20 a period; a third of the stamps fall into stick."""
    times = np.arange(1, 20 * periods + 1) * PERIOD / 20
    found = ss.simulate(
        block(TRUTH, {}), 0.0, times[-1], start({}, {}), saveat=ss.SaveAt(ts=times, events=False)
    )
    noise = SIGMA * np.random.default_rng(0).normal(size=times.size)
    return Record(times, {"x": np.asarray(found.outputs.y.x) + noise}, begin=0.0)


def problem(periods):
    return Problem(
        block, start, TRUTH, {"x": Observed(lambda t, y, system: y.x, SIGMA, "m")}, record(periods),
        integrator=INTEGRATOR,
    )  # fmt: skip


def starts(count, names=tuple(TRUTH)):
    rng = np.random.default_rng(1)
    return {name: TRUTH[name] * rng.uniform(0.5, 1.5, count) for name in names}


def arrived(fits, reference):
    """Which fits are at the reference to 1e-8."""
    off = [np.abs(np.asarray(fits.values[n]) / float(reference.values[n]) - 1) for n in TRUTH]
    return np.max(off, axis=0) < 1e-8


@pytest.mark.slow
def test_same_optimum_from_starts_that_are_far():
    found = problem(6)
    reference = found.fit(method=POLISH)
    method = MultipleShooting(12, guess=guess, polish=POLISH)
    rows = {name: row[[0, 1, 9]] for name, row in starts(16).items()}
    fits = found.fits(rows, method=method, chunk_size=3)
    assert arrived(fits, reference).all()
    assert bool(jnp.all(fits.successful))
    # Single shooting from there ends in other minima: the starts are hard enough.
    assert not arrived(found.fits(rows, method=POLISH, chunk_size=3), reference).all()


@pytest.mark.slow
def test_twenty_periods_from_a_hundred_starts():
    found = problem(20)
    reference = found.fit(method=POLISH)
    method = MultipleShooting(40, guess=guess, polish=POLISH)
    rows = starts(100, ("static", "kinetic", "stiffness"))
    assert arrived(found.fits(rows, method=method, chunk_size=8), reference).sum() >= 90
    assert arrived(found.fits(rows, method=POLISH, chunk_size=8), reference).sum() < 50


@pytest.mark.more
def test_derivatives_of_segments():
    """Against central differences, at states off the motion, so that no knot is at a mode's border."""
    found = problem(3)
    space, values = scalars("start", {"kinetic": 0.45, "static": 1.1, "stiffness": 1.05})
    segments = segments_of(found._data, 5)
    rng = np.random.default_rng(3)
    states = rng.uniform([0.2, -0.4], [0.8, 0.1], (segments.inner.size, 2))
    shooting = Shooting(
        found._run, space, found._data, segments, jnp.array([1.0, 0.5]), jnp.asarray(0.1), None
    )
    unknown = jnp.concatenate([space.coordinates(values), jnp.asarray(states / [1.0, 0.5]).reshape(-1)])
    _, matrix = residual_and_jacobian(shooting, unknown)
    h = 1e-5
    for i in range(unknown.size):
        step = jnp.zeros(unknown.size).at[i].set(h)
        up, down = (residual_and_jacobian(shooting, unknown + s)[0] for s in (step, -step))
        slope = np.asarray(up - down) / (2 * h)
        np.testing.assert_allclose(matrix[:, i], slope, atol=2e-4 * max(1.0, np.max(np.abs(slope))))


@pytest.mark.more
def test_without_jumps_the_segments_are_the_run():
    """With the states of the run at the knots, some in stick, the residual is that of the run."""
    found = problem(3)
    one = {"kinetic": 0.45, "static": 1.1, "stiffness": 1.05}
    method = MultipleShooting(6)
    space, values = scalars("start", one)
    segments = segments_of(found._data, 6)
    states = method._states(found._run, found._data, segments, values)
    assert np.any(np.abs(states[:, 1] - BELT) < 1e-12)
    shooting = Shooting(found._run, space, found._data, segments, jnp.ones(2), jnp.asarray(1.0), None)
    unknown = jnp.concatenate([space.coordinates(values), jnp.asarray(states).reshape(-1)])
    row, _ = residual_and_jacobian(shooting, unknown)
    np.testing.assert_allclose(row[:60], found.residual(one), atol=1e-3)
    np.testing.assert_allclose(row[60:], 0.0, atol=1e-6)


def test_bad_multiple_shooting():
    with pytest.raises(ValueError, match=r"weights = \(0.1, 1.0\): it must be falling"):
        MultipleShooting(4, weights=(0.1, 1.0))
    with pytest.raises(ValueError, match="segments = 60: it must be below 60"):
        problem(3).fit(method=MultipleShooting(60))
    assert jax.tree.leaves(MultipleShooting(4).polish.loss) == []
