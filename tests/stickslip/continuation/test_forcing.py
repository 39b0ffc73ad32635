"""What acts on a system recurs with its orbits; where it jumps there are derivatives all the same."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, orbit_guess, periodic_orbit
from tests.stickslip.continuation._systems import Motion, of_frequency


class Driven(ss.AbstractSmoothSystem):
    r"""$\ddot x + 0.2\dot x + x = \cos\omega t$."""

    frequency: Any

    def time_scale(self, args):
        return 1.0 / self.frequency

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, jnp.cos(self.frequency * t) - 0.2 * y.v - y.x)


class Switched(ss.AbstractSmoothSystem):
    r"""The same with $\mathrm{sgn}\sin\omega t$."""

    frequency: Any

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, jnp.sign(jnp.sin(self.frequency * t)) - 0.2 * y.v - y.x)


W = 1.3
START = Motion(1.0, 0.0)


def breaks(system):
    return jnp.pi / system.frequency * jnp.arange(2.0)


def of_inner_frequency(system):
    return of_frequency(system.system)


def at_the_break(w):
    """State of the periodic motion where the square wave rises, minus that where it falls."""
    half = expm(np.array([[0.0, 1.0, 0.0], [-1.0, -0.2, 1.0], [0.0, 0.0, 0.0]]) * np.pi / w)
    return np.linalg.solve(half[:2, :2] + np.eye(2), -half[:2, 2])


@pytest.mark.more
def test_a_state_that_returns_at_another_phase_of_the_forcing_is_no_orbit():
    """It returns after any time for some state; a motion from it goes elsewhere in the next period."""
    for part, result in (
        (1.0, "successful"), (2.0, "successful"), (0.5, "period_differs"), (1.5, "period_differs"),
        (1.0 + 1e-6, "period_differs"),
    ):  # fmt: skip
        found = periodic_orbit(Driven(W), OrbitGuess(START, part * 2 * np.pi / W), forced=True)
        assert float(found.closing_error) < 1e-9
        assert str(found.result) == result
    for t0 in (3e5, 1e6, 3e6):  # where the rounding of the time is more than the tolerance
        late = OrbitGuess(START, 2 * np.pi / W, t0=t0)
        assert bool(periodic_orbit(Driven(W), late, forced=True).successful)


def test_a_guess_without_a_return_is_refused_with_the_reason():
    guess = orbit_guess(Driven(W), START, transient=0.0, max_period=20.0)
    with pytest.raises(ValueError, match=r"guess.period = nan: it must be positive: of orbit_guess"):
        periodic_orbit(Driven(W), eqx.tree_at(lambda g: g.period, guess, np.nan), forced=True)


@pytest.mark.slow
def test_a_branch_ends_where_its_forcing_has_another_period():
    orbit = periodic_orbit(Driven(W), OrbitGuess(START, 2 * np.pi / W), forced=True)
    branch = continue_orbit(
        Driven(W), orbit, "frequency", (1.0, 2.0), forcing_period=lambda s: 2 * np.pi / W
    )
    assert [end.words for end in branch["EP"]] == ["period_differs"] * 2
    assert np.ptp(branch.values) < 1e-5


@pytest.mark.more
def test_jumps_that_nobody_declared_are_named():
    orbit = periodic_orbit(Switched(W), OrbitGuess(START, 2 * np.pi / W), forced=True)
    assert "derivative flags: discontinuous" in str(orbit)
    with pytest.raises(ValueError, match="WithPeriodicBreaks"):
        continue_orbit(Switched(W), orbit, "frequency", (1.0, 2.0), forcing_period=of_frequency)


@pytest.mark.more
@pytest.mark.parametrize("t0", [0.0, 0.3, 5 * np.pi / W, -3.0, 1e4])
def test_an_orbit_under_a_square_wave(t0):
    """In closed form, wherever it begins: at a break the middle of the piece behind it is taken."""
    system = ss.WithPeriodicBreaks(Switched(W), breaks, of_frequency)
    orbit = periodic_orbit(system, OrbitGuess(START, 2 * np.pi / W, t0=t0), forced=True)
    assert bool(orbit.successful)
    assert int(orbit.flags) == 0
    assert int(orbit.events.count) == 2
    rises = np.asarray(orbit.events.mode_after[:2]) == 1
    np.testing.assert_allclose(orbit.events.y_before.x[:2][rises], at_the_break(W)[0], atol=1e-9)
    size = np.exp(-0.2 * np.pi / W)
    np.testing.assert_allclose(np.abs(orbit.multipliers), size, rtol=1e-9)
    assert float(orbit.determinant_by_events) == pytest.approx(size**2, abs=1e-10)


@pytest.mark.slow
def test_a_branch_under_a_square_wave_moves_its_breaks():
    system = ss.WithPeriodicBreaks(Switched(W), breaks, of_frequency)
    guess = orbit_guess(system, START, transient=60.0, max_period=10.0, forcing_period=2 * np.pi / W)
    branch = continue_orbit(
        system,
        guess,
        "system__frequency",
        (0.8, 2.0),
        forcing_period=of_inner_frequency,
        follow=Follow(step=0.05),
    )
    assert [end.words for end in branch["EP"]] == ["bounds"] * 2
    assert len(branch) < 80
    for w, x, mode in zip(
        branch.values,
        np.asarray(branch.orbits.events.y_before.x),
        np.asarray(branch.orbits.events.mode_after),
        strict=True,
    ):
        (rise,) = x[:2][mode[:2] == 1]
        assert rise == pytest.approx(at_the_break(w)[0], abs=1e-9)
