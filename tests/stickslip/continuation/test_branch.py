"""Branches against points that are known: closed forms, and numbers computed independently."""

import numpy as np
import pytest

from stickslip.continuation import OrbitGuess, continue_orbit, orbit_guess, periodic_orbit
from tests.stickslip.continuation._systems import (
    Bouncing,
    CocoStickSlip,
    CoulombForced,
    ForcedBlock,
    Motion,
    Sliding,
    Stopped,
    WeakeningBlock,
    half_turn,
    of_frequency,
    whole_turn,
)


def labels(branch):
    return [(special.label, special.value) for special in branch.specials]


@pytest.mark.slow
def test_discontinuous_fold():
    """Stick-slip orbit and slip cycle end in one point; the latter also in its Hopf point."""
    system = WeakeningBlock(belt_speed=0.6, damping=0.5)
    guess = orbit_guess(system, Motion(1.0, 0.1), transient=50.0, max_period=12.0)
    branch = continue_orbit(
        system, periodic_orbit(system, guess), "belt_speed", (0.4, 0.8), step=0.04, both=False,
        max_points=60,
    )  # fmt: skip
    (fold,), (end,) = branch["GR"], branch["EP"]
    assert fold.value == pytest.approx(0.6721494669, abs=1e-9)
    assert float(fold.orbit.period) == pytest.approx(6.4622679113, abs=1e-8)
    assert branch.values.max() <= fold.value
    after = branch.orbits.multipliers[fold.index + 1]
    assert complex(after[0]) == pytest.approx(7.3010363, abs=5e-3)  # 3e-5 beyond the fold
    hopf = (np.sqrt(3 / 0.5) - 1) / 3
    assert end.words.startswith("at_rest")
    assert end.value == pytest.approx(hopf, abs=1e-7)
    stable = np.asarray(branch.orbits.stable)
    assert stable[: fold.index + 1].all()
    assert not stable[fold.index + 1 :].any()
    data = branch.to_dataset()
    assert data.sizes["point"] == len(branch)
    assert data["label"].values.tolist() == ["GR", "EP"]
    assert data["start_x"].attrs["units"] == "m"


@pytest.mark.slow
def test_grazing_of_coco_and_beyond():
    system, period = CocoStickSlip(0.5), np.pi / 0.92
    guess = orbit_guess(
        system, Sliding(0.0, 0.0, 0.0), transient=100 * period, max_period=2.5 * period,
        forcing_period=period,
    )  # fmt: skip
    branch = continue_orbit(
        system, periodic_orbit(system, guess, forced=True), "voltage", (0.4, 0.7), step=0.02,
        forcing_period=half_turn,
    )  # fmt: skip
    (graze,) = branch["GR"]
    assert graze.value == pytest.approx(0.5875162504, abs=1e-9)
    found = np.asarray(graze.orbit.multipliers)
    np.testing.assert_allclose(found[:2], [1.42922317, 0.61035041], atol=3e-8)
    assert len(branch["LP"]) == 1
    assert (np.asarray(branch.orbits.events.count)[graze.index + 1 :] == 2).all()
    # Every orbit, unstable ones too.
    product = np.asarray(branch.orbits.determinant_by_events)
    np.testing.assert_allclose(np.asarray(branch.orbits.determinant), product, atol=1e-10)


@pytest.mark.slow
def test_flip_of_the_forced_block_on_a_closed_branch():
    w = 1.75
    orbit = periodic_orbit(
        ForcedBlock(0.1, w), OrbitGuess(Motion(1.0, 0.0), 4 * np.pi / w), forced=True
    )
    branch = continue_orbit(
        ForcedBlock(0.1, w), orbit, "frequency", (1.5, 2.0), step=0.02,
        forcing_period=of_frequency,
    )  # fmt: skip
    (flip,) = branch["PD"]
    assert flip.value == pytest.approx(1.7129810362, abs=1e-9)
    assert branch.specials[-1].words.startswith("closed")

    doubled = continue_orbit(
        ForcedBlock(0.1, w), flip, "frequency", (1.5, 2.0), step=0.02,
        forcing_period=of_frequency, max_points=20,
    )  # fmt: skip
    first = float(doubled.orbits.period[0]) * doubled.values[0] / (8 * np.pi)
    assert first == pytest.approx(1.0, abs=1e-9)
    assert np.asarray(doubled.orbits.repeats).tolist() == [1] * len(doubled)
    # Both are known from SciPy alone, see test_forced_block.py. The branch comes to the first of them
    # from either side, and from that of the stick it ends some 7e-9 early.
    assert max(p.value for p in branch["GR"]) == pytest.approx(1.667690998106, abs=1e-8)
    assert doubled["GR"][0].value == pytest.approx(1.707799714886, abs=1e-9)
    assert abs(doubled.values[0] - flip.value) < 2e-3  # at an amplitude of a hundredth


@pytest.mark.slow
def test_loss_of_pure_slip():
    system, period = CoulombForced(2.0, 1.0), 2 * np.pi
    guess = orbit_guess(
        system, Motion(1.0, 0.0), transient=60 * period, max_period=2.5 * period, forcing_period=period
    )
    branch = continue_orbit(
        system, periodic_orbit(system, guess, forced=True), "amplitude", (1.1, 2.5), step=0.02,
        forcing_period=of_frequency,
    )  # fmt: skip
    (border,) = branch["GR"]
    assert border.value == pytest.approx(1.3770178175, abs=1e-9)


@pytest.mark.slow
def test_fold_and_flip_of_the_ball():
    e, strength = 0.5, 1.3
    fold = np.pi * (1 - e) / (1 + e)
    phase = -np.arcsin(fold / strength)
    start = Motion(strength * np.cos(phase) + np.pi**2 / 2, 0.0)
    system = Bouncing(strength, e)
    orbit = periodic_orbit(system, OrbitGuess(start, 2 * np.pi, 0, phase + np.pi), forced=True)
    branch = continue_orbit(system, orbit, "strength", (0.9, 1.7), step=0.02, forcing_period=whole_turn)
    flip = np.hypot(fold, 2 * (1 + e * e) / (1 + e) ** 2)
    assert branch["LP"][0].value == pytest.approx(fold, abs=1e-9)
    assert branch["PD"][0].value == pytest.approx(flip, abs=1e-9)
    assert np.asarray(branch.orbits.determinant) == pytest.approx(e * e, abs=1e-9)
    # In order along the branch, from both halves of it; the fold is the least value.
    assert branch.values.min() >= fold - 1e-9
    assert int(np.argmin(branch.values)) - branch["LP"][0].index in (0, 1)
    at = branch["PD"][0].index
    assert sorted([*branch.values[at : at + 2], flip])[1] == flip


@pytest.mark.slow
def test_grazing_of_the_impact_oscillator():
    """Closed form: the amplitude of the response is the distance of the stop at A = 0.1."""
    system, period = Stopped(0.08), 2 * np.pi
    guess = orbit_guess(
        system, Motion(0.0, 0.0), transient=60 * period, max_period=1.5 * period, forcing_period=period
    )
    branch = continue_orbit(
        system, periodic_orbit(system, guess, forced=True), "amplitude", (0.05, 0.2), step=0.02,
        forcing_period=whole_turn,
    )  # fmt: skip
    (graze,) = branch["GR"]
    assert graze.value == pytest.approx(0.1, abs=1e-10)
