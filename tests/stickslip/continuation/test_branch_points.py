"""Where branches of forced symmetric systems cross: located beside the singular point."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import Follow, continue_orbit, orbit_guess
from tests.stickslip.continuation._systems import Motion

pytestmark = pytest.mark.slow

W = 0.8


class Duffing(ss.AbstractSmoothSystem):
    r"""$\ddot x + 0.1\dot x + x + x^3 = A\cos\omega t$."""

    amplitude: Any

    def time_scale(self, args):
        return 1.0 / W

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.amplitude * jnp.cos(W * t) - 0.1 * y.v - y.x - y.x**3)


def forcing(system):
    return 2 * jnp.pi / W


def half(amplitude, y):
    """State and its derivative after half a period."""

    def rates(t, z):
        matrix = np.array([[0.0, 1.0], [-1.0 - 3.0 * z[0] ** 2, -0.1]]) @ z[2:].reshape(2, 2)
        return [z[1], amplitude * np.cos(W * t) - 0.1 * z[1] - z[0] - z[0] ** 3, *matrix.ravel()]

    end = solve_ivp(rates, (0.0, np.pi / W), [*y, 1.0, 0.0, 0.0, 1.0], "DOP853", rtol=1e-12, atol=1e-13)
    return end.y[:2, -1], end.y[2:, -1].reshape(2, 2)


def symmetric(amplitude, y):
    """The orbit that is its own mirror image half a period later: regular where the others part."""
    for _ in range(20):
        end, matrix = half(amplitude, y)
        move = np.linalg.solve(matrix + np.eye(2), end + y)
        y = y - move
        if np.max(np.abs(move)) < 1e-13:
            break
    return y, matrix


def crossings(low, high):
    found, before = [], None
    y = np.array([0.1, 0.0])
    for amplitude in np.arange(0.05, high, 0.04):
        y, matrix = symmetric(amplitude, y)
        value = np.linalg.det(np.eye(2) - matrix)
        if before is not None and before[1] * value < 0.0 and amplitude > low:
            start = before[2]
            root = brentq(
                lambda a, start=start: np.linalg.det(np.eye(2) - symmetric(a, start)[1]), before[0],
                amplitude, xtol=1e-13,
            )  # fmt: skip
            found.append(root)
        before = amplitude, value, y
    return found


def test_broken_symmetry_of_a_forced_oscillator():
    system, period = Duffing(1.2), 2 * np.pi / W
    guess = orbit_guess(
        system, Motion(0.0, 0.0), transient=100 * period, max_period=1.1 * period, forcing_period=period
    )
    known = crossings(1.0, 2.2)
    assert len(known) == 2
    for step in (0.01, 0.05):
        branch = continue_orbit(
            system, guess, "amplitude", (1.0, 2.2), forcing_period=forcing, follow=Follow(step=step)
        )
        assert [s.label for s in branch.specials] == ["EP", "BP", "BP", "EP"]
        np.testing.assert_allclose([point.value for point in branch["BP"]], known, atol=1e-9)
        for point in branch["BP"]:
            assert np.asarray(point.orbit.multipliers)[0] == pytest.approx(1.0, abs=1e-7)
    # The orbits that are not symmetric: they part at one of the points and come together at the other.
    other = continue_orbit(
        system,
        branch["BP"][0],
        "amplitude",
        (1.0, 2.2),
        forcing_period=forcing,
        follow=Follow(step=0.02),
    )
    highest, lowest = np.asarray(other.orbits.highest.x), np.asarray(other.orbits.lowest.x)
    assert np.max(np.abs(highest + lowest)) > 0.05
    assert not [s for s in other.specials if "?" in s.label]
