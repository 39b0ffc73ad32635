"""Branches against points that are known: closed forms, and numbers computed independently."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from stickslip.continuation import Follow, continue_orbit, orbit_guess, periodic_orbit
from tests.stickslip.continuation._systems import (
    CocoStickSlip,
    Motion,
    Sliding,
    Stopped,
    closed_branch,
    half_turn,
    of_frequency,
    whole_turn,
)


@pytest.mark.slow
def test_grazing_of_coco_and_beyond():
    system, period = CocoStickSlip(0.5), np.pi / 0.92
    guess = orbit_guess(
        system, Sliding(0.0, 0.0, 0.0), transient=100 * period, max_period=2.5 * period,
        forcing_period=period,
    )  # fmt: skip
    branch = continue_orbit(
        system,
        periodic_orbit(system, guess, forced=True),
        "voltage",
        (0.4, 0.7),
        forcing_period=half_turn,
        follow=Follow(step=0.02),
    )
    (graze,) = branch["GR"]
    assert graze.value == pytest.approx(0.5875162504, abs=1e-9)
    # Without stick the place is free: its multiplier is the one between.
    found = np.asarray(graze.orbit.multipliers)
    np.testing.assert_allclose(found, [1.42922317, 1.0, 0.61035041], atol=3e-8)
    assert len(branch["LP"]) == 1
    assert (np.asarray(branch.orbits.events.count)[graze.index + 1 :] == 2).all()
    # Every orbit, unstable ones too.
    product = np.asarray(branch.orbits.determinant_by_events)
    np.testing.assert_allclose(np.asarray(branch.orbits.determinant), product, atol=1e-10)


@pytest.mark.slow
def test_flip_of_the_forced_block_on_a_closed_branch():
    branch = closed_branch()
    (flip,) = branch["PD"]
    assert flip.value == pytest.approx(1.7129810362, abs=1e-9)
    assert branch.specials[-1].words.startswith("closed")

    doubled = continue_orbit(
        branch.system,
        flip,
        "frequency",
        (1.5, 2.0),
        forcing_period=of_frequency,
        follow=Follow(step=0.02, max_points=20),
    )
    first = float(doubled.orbits.period[0]) * doubled.values[0] / (8 * np.pi)
    assert first == pytest.approx(1.0, abs=1e-9)
    assert np.asarray(doubled.orbits.repeats).tolist() == [1] * len(doubled)
    # Both are known from SciPy alone, see test_forced_block.py. The branch comes to the first of them
    # from either side, and from that of the stick it ends some 7e-9 early.
    assert max(p.value for p in branch["GR"]) == pytest.approx(1.667690998106, abs=1e-8)
    assert doubled["GR"][0].value == pytest.approx(1.707799714886, abs=1e-9)
    assert abs(doubled.values[0] - flip.value) < 2e-3  # at an amplitude of a hundredth


@pytest.mark.slow
def test_grazing_of_the_impact_oscillator():
    """Closed form: the amplitude of the response is the distance of the stop at A = 0.1."""
    system, period = Stopped(0.08), 2 * np.pi
    guess = orbit_guess(
        system, Motion(0.0, 0.0), transient=60 * period, max_period=1.5 * period, forcing_period=period
    )
    branch = continue_orbit(
        system,
        periodic_orbit(system, guess, forced=True),
        "amplitude",
        (0.05, 0.2),
        forcing_period=whole_turn,
        follow=Follow(step=0.02),
    )
    (graze,) = branch["GR"]
    assert graze.value == pytest.approx(0.1, abs=1e-10)

    # With an impact a period the motion between is linear: A by the speed of the impact, closed form.
    # The orbits that begin at the grazing are unstable and turn at the least A.
    turn = expm(2 * np.pi * np.array([[0.0, 1.0], [-1.0, -0.1]]))

    def amplitude(speed):
        leaves, arrives = np.array([1.0, -0.8 * speed]), np.array([1.0, speed])
        return 0.1 * np.linalg.norm(np.linalg.solve(np.eye(2) - turn, arrives - turn @ leaves))

    least = minimize_scalar(amplitude, bounds=(0.0, 0.5), method="bounded", options={"xatol": 1e-9})
    (fold,) = branch["LP"]
    assert fold.value == pytest.approx(least.fun, abs=1e-10)
    impacts = np.asarray(branch.orbits.events.count) == 1
    speeds = np.asarray(branch.orbits.events.y_before.v)[impacts, 0]
    known = [amplitude(speed) for speed in speeds]
    np.testing.assert_allclose(branch.values[impacts], known, atol=1e-9)
