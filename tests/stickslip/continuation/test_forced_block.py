"""The forced block's tori and grazing orbits against shooting with SciPy alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from stickslip.continuation import OrbitGuess, continue_orbit, periodic_orbit
from tests.stickslip.continuation._systems import ForcedBlock, Motion, of_frequency

pytestmark = pytest.mark.slow


def slip(t, y, force, w):
    """Slower than the belt; the third number is the integral of the divergence."""
    u = 1.0 - y[1]
    rate = -y[0] + 1.5 - 1.5 * u + 0.45 * u**3 + force * np.cos(w * t)
    return y[1], rate, 1.5 - 1.35 * u**2


def end(state, force, w, turns, **options):
    start = [*state, 0.0]
    return solve_ivp(
        slip, (0.0, 2 * np.pi * turns / w), start, "DOP853", args=(force, w), rtol=1e-12, atol=1e-13,
        **options,
    )  # fmt: skip


@pytest.mark.parametrize(("w", "force"), [(3.0, 1.2720514849), (3.5, 1.5279422492)])
def test_torus_of_the_pure_slip_orbit(w, force):
    """A conjugate pair is on the unit circle where the integral of the divergence is zero."""
    start = OrbitGuess(Motion(0.45 + 0.8 / (1.0 - w * w), 0.0), 2 * np.pi / w, 0)
    branch = continue_orbit(
        ForcedBlock(0.8, w), start, "amplitude", (0.7, 2.0), step=0.05, forcing_period=of_frequency
    )
    (torus,) = branch["NS"]
    assert np.abs(torus.orbit.multipliers) == pytest.approx(1.0, abs=1e-9)
    assert int(torus.orbit.events.count) == 0

    def wrong(z):
        last = end(z[:2], z[2], w, 1).y[:, -1]
        return last - [z[0], z[1], 0.0]

    known = fsolve(wrong, [0.45 + force / (1.0 - w * w), 0.0, force], xtol=1e-13)
    assert known[2] == pytest.approx(force, abs=1e-9)
    assert torus.value == pytest.approx(known[2], abs=1e-9)


def touch(turns, phase, w):
    """Phase and frequency at which an orbit touches the speed of the belt, and its multipliers.

    It does with v = 1 and no acceleration: x is then known too, and the motion from there closes.
    """
    force = 0.1

    def state(z):
        return [1.5 + force * np.cos(z[1] * z[0]), 1.0]

    def slip_and_deviations(t, y, w):
        rate = 1.5 - 1.35 * (1.0 - y[1]) ** 2
        return *slip(t, y, force, w)[:2], y[3], rate * y[3] - y[2], y[5], rate * y[5] - y[4]

    def last(z):
        start = [*state(z), 1.0, 0.0, 0.0, 1.0]
        span = z[0], z[0] + 2 * np.pi * turns / z[1]
        options = {"rtol": 1e-12, "atol": 1e-13, "max_step": 0.2}
        return solve_ivp(slip_and_deviations, span, start, "DOP853", args=(z[1],), **options).y[:, -1]

    z = fsolve(lambda z: last(z)[:2] - state(z), [phase, w], xtol=1e-13)
    found = np.linalg.eigvals(last(z)[2:].reshape(2, 2))
    return z[1], found[np.argsort(-np.abs(found))]


def test_an_orbit_of_the_field_that_violates_a_guard_is_refused():
    """Beyond its grazing the orbit of the slip field goes on, faster than the belt for a while."""
    w, force = 1.66, 0.1

    def wrong(y):
        return end(y, force, w, 2).y[:2, -1] - y

    def late(t, y, force, w):
        return slip(t, y, force, w)[1]

    y = fsolve(wrong, [0.0626, 0.067], xtol=1e-13)
    late.direction = -1.0
    run = end(y, force, w, 2, events=late)
    top = int(np.argmax(run.y_events[0][:, 1]))
    at, fastest = float(run.t_events[0][top]), run.y_events[0][top]
    assert fastest[1] > 1.01
    guess = OrbitGuess(Motion(float(fastest[0]), float(fastest[1])), 4 * np.pi / w, 0, at)
    found = periodic_orbit(ForcedBlock(force, w), guess, forced=True)
    assert not bool(found.successful)


@pytest.mark.parametrize(
    ("turns", "w", "start", "phase", "least"),
    [(2, 1.67, (0.06294528, 0.05908821), 2.22, 1.665), (4, 1.711, (0.0693904, 0.00284825), 9.57, 1.7)],
)
def test_grazing_of_the_orbits_of_several_turns(turns, w, start, phase, least):
    """The multipliers at the last orbit without stick are those of the slip, not of the other side."""
    guess = OrbitGuess(Motion(*start), 2 * np.pi * turns / w, 0)
    branch = continue_orbit(
        ForcedBlock(0.1, w), guess, "frequency", (least, w + 0.0015), step=0.1,
        forcing_period=of_frequency,
    )  # fmt: skip
    (graze,) = branch["GR"]
    known, multipliers = touch(turns, phase, graze.value)
    assert graze.words == "grazing-sliding, 0 events, 2 beyond"
    assert int(graze.orbit.events.count) == 0
    assert graze.value == pytest.approx(known, abs=1e-10)
    np.testing.assert_allclose(np.asarray(graze.orbit.multipliers), multipliers, atol=1e-6)
    assert not branch["PD"]
