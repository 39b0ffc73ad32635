"""Orbits of angles that go round, against shooting on a section with SciPy and closed forms."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, periodic_orbit
from tests.stickslip.continuation._systems import Motion


class Round(ss.AbstractSmoothSystem):
    r"""Pendulum under a torque, $\ddot x = \tau - \dot x/10 - \sin x$, $x$ an angle."""

    torque: Any
    periods: ClassVar = {"x": 2 * np.pi}

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.torque - 0.1 * y.v - jnp.sin(y.x))


def turn(torque):
    """Period of the orbit and its speed at the angle 0, by shooting; for a negative torque too."""
    sense = np.sign(torque)

    def end(speed):
        def round_once(t, z):
            return sense * z[0] - 2 * np.pi

        round_once.terminal = True
        run = solve_ivp(
            lambda t, z: [z[1], torque - 0.1 * z[1] - np.sin(z[0])], (0, 50), [0.0, speed], "DOP853",
            rtol=1e-12, atol=1e-13, events=round_once,
        )  # fmt: skip
        return run.t[-1], run.y[1, -1]

    near, far = 0.9 * torque / 0.1, 1.5 * torque / 0.1
    speed = brentq(lambda speed: end(speed)[1] - speed, near, far, xtol=1e-13)
    return end(speed)[0], speed


@pytest.fixture(scope="module")
def truth():
    return turn(0.9)


@pytest.mark.more
@pytest.mark.parametrize(("faster", "longer"), [(0.9, 1.1), (1.1, 1.0)])
def test_newton_from_a_tenth_off(truth, faster, longer):
    """The place on the orbit is that of the angle: the speed, 40 times its ripple, may change."""
    period, speed = truth
    guess = OrbitGuess(Motion(0.3, faster * speed), longer * period)
    found = periodic_orbit(Round(0.9), guess)
    assert bool(found.successful)
    assert float(found.period) == pytest.approx(period, abs=1e-10)
    assert int(found.steps) <= 7


@pytest.mark.slow
@pytest.mark.parametrize(("step", "most"), [(0.03, 150), (0.3, 25)])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_one_orbit_for_each_torque(step, most, sense):
    """The speed moves by 17, its ripple is from 0.1 to 0.7."""
    period, speed = turn(sense * 0.9)
    start = OrbitGuess(Motion(0.0, speed), period)
    ends = sorted((sense * 0.3, sense * 2.0))
    branch = continue_orbit(Round(sense * 0.9), start, "torque", tuple(ends), follow=Follow(step=step))
    assert len(branch) <= most
    assert sorted(point.value for point in branch["EP"]) == pytest.approx(ends, abs=1e-8)
    assert [point.words for point in branch.specials] == ["bounds", "bounds"]
    assert np.all(np.diff(branch.values) > 0)
    for point in branch["EP"]:
        assert float(point.orbit.period) == pytest.approx(turn(point.value)[0], abs=1e-9)
