"""Orbits of a branch by derivatives of their neighbours: at what cost, and that they are their own."""

import numpy as np
import pytest

from stickslip.continuation import (
    Follow,
    Forcing,
    OrbitGuess,
    _corrector,
    continue_orbit,
    forced_response,
    periodic_orbit,
)
from tests.stickslip.continuation._forced import Duffing
from tests.stickslip.continuation._systems import Motion

SPAN = (0.8, 1.6)


@pytest.fixture(scope="module")
def branch():
    """A branch of a Duffing oscillator, and how often equations were asked for on the way."""
    counts = {"with derivative": 0, "alone": 0}
    names = {"equations_at": "with derivative", "residual_at": "alone"}

    def counted(function, name):
        def count(*arguments):
            counts[name] += 1
            return function(*arguments)

        return count

    with pytest.MonkeyPatch.context() as patch:
        for function, name in names.items():
            patch.setattr(_corrector, function, counted(getattr(_corrector, function), name))
        first = forced_response(Duffing(SPAN[0]), Motion(0.0, 0.0))
        guess = OrbitGuess(first.y0, 2.0 * np.pi / SPAN[0], int(first.mode0), float(first.t0))
        found = continue_orbit(
            Duffing(SPAN[0]), guess, "frequency", SPAN, forcing_period=Forcing().rule,
            follow=Follow(step=0.1, both=False),
        )  # fmt: skip
    return found, counts


def test_a_point_costs_few_derivatives(branch):
    """All in all, with the first orbit, both ends and special points; Newton's method alone takes 5."""
    found, counts = branch
    assert counts["with derivative"] <= 3 * len(found)
    assert counts["alone"] <= 20 * len(found)


def test_multipliers_are_those_of_the_orbit_itself(branch):
    """Solved again from each point with derivatives of its own, to the tolerance of both."""
    found, _ = branch
    for i in range(0, len(found), max(1, len(found) // 6)):
        system = Duffing(float(found.values[i]))
        start = Motion(float(found.orbits.y0.x[i]), float(found.orbits.y0.v[i]))
        guess = OrbitGuess(start, float(found.orbits.period[i]), 0, float(found.orbits.t0[i]))
        known = periodic_orbit(system, guess, forced=True)
        one, other = (np.asarray(o.multipliers) for o in (known, found.orbits))
        np.testing.assert_allclose(other[i], one, rtol=1e-7)
        decay = np.exp(-0.1 * float(known.period))
        assert np.prod(other[i]).real == pytest.approx(decay, rel=1e-7)
        np.testing.assert_allclose(found.orbits.y0.x[i], float(known.y0.x), atol=1e-8)
