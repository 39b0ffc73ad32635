"""Extremes of orbits are those of the motion, however few instants of it are kept."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import stickslip as ss
from stickslip.continuation import OrbitGuess, orbit_guess, periodic_orbit
from tests.stickslip.continuation._systems import Motion


class Relaxation(ss.AbstractSmoothSystem):
    r"""Van der Pol, $\ddot x = \mu(1 - x^2)\dot x - x$."""

    mu: Any

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.mu * (1.0 - y.x**2) * y.v - y.x)


# SciPy, DOP853 at 1e-12, with events where a component's rate is zero.
@pytest.mark.more
@pytest.mark.parametrize(
    ("mu", "place", "speed"),
    [
        (6.0, 2.0198302138912, 8.937926581938),
        pytest.param(100.0, 2.0013186811772, 133.8016914556, marks=pytest.mark.slow),
    ],
)
def test_a_component_that_moves_within_a_small_part_of_the_period(mu, place, speed):
    """At 100 a period takes 13,000 steps, more than are kept at a time."""
    system = Relaxation(mu)
    guess = orbit_guess(system, Motion(2.0, 0.0), transient=10.0 + 3.0 * mu, max_period=4.0 * mu + 20.0)
    orbit = periodic_orbit(system, guess)
    for high, low, right in zip(orbit.highest, orbit.lowest, (place, speed), strict=True):
        assert float(high) == pytest.approx(right, rel=2e-11)
        assert float(low) == pytest.approx(-right, rel=2e-11)


class Bank(NamedTuple):
    x: Any
    v: Any
    still: Any


RATES, DAMPING = np.array([1.3, 6.8, 53.0]), 0.02


class Driven(ss.AbstractSmoothSystem):
    r"""$\ddot x_k + c\dot x_k + w_k^2 x_k = \cos t + a\cos 7t + \cos 50t$, and what does not move."""

    strength: Any

    def time_scale(self, args):
        return 0.02

    def vector_field(self, t, y, mode, args):
        load = jnp.cos(t) + self.strength * jnp.cos(7.0 * t) + jnp.cos(50.0 * t)
        return Bank(y.v, load - DAMPING * y.v - RATES**2 * y.x, 0.0 * y.still)


def response(t, strength, k):
    """Place and speed of one oscillator, of the sum of its harmonics."""
    w = np.array([1.0, 7.0, 50.0])
    size = np.array([1.0, strength, 1.0]) / (RATES[k] ** 2 - w**2 + 1j * DAMPING * w)
    wave = size * np.exp(1j * w * np.asarray(t)[..., None])
    return np.stack([np.real(wave).sum(-1), np.real(1j * w * wave).sum(-1)])


def greatest(value):
    """Of a function of the time that is periodic with a turn: its greatest maximum."""
    grid = np.linspace(1.0, 1.0 + 2 * np.pi, 20_001)
    there = value(grid)
    tops = 1 + np.flatnonzero((there[1:-1] >= there[:-2]) & (there[1:-1] >= there[2:]))
    step, best = grid[1] - grid[0], -np.inf
    for k in tops[np.argsort(there[tops])[-4:]]:
        limits = (grid[k] - step, grid[k] + step)
        found = minimize_scalar(lambda t: -value(t), bounds=limits, method="bounded",
                                options={"xatol": 1e-12})  # fmt: skip
        best = max(best, -found.fun)
    return best


def test_arrays_of_many_extremes():
    """Closed form: sums of harmonics, with nearly equal maxima that no few instants tell apart."""
    start = Bank(jnp.zeros(3), jnp.zeros(3), jnp.ones(2))
    orbit = periodic_orbit(Driven(4.0), OrbitGuess(start, 2 * jnp.pi), forced=True)
    np.testing.assert_array_equal(orbit.highest.still, 1.0)
    np.testing.assert_array_equal(orbit.lowest.still, 1.0)
    for part, name in enumerate(("x", "v")):
        high, low = getattr(orbit.highest, name), getattr(orbit.lowest, name)
        for k in range(3):
            for sign, found in ((1.0, high[k]), (-1.0, -low[k])):
                right = greatest(lambda t, s=sign, p=part, k=k: s * response(t, 4.0, k)[p])
                assert float(found) == pytest.approx(right, rel=1e-9)
