"""The branch of the hunting cycle without sampling, by root finding, and where it is born and ends."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, orbit_guess, periodic_orbit
from tests.stickslip.control._axis import Continuous, begin, under_pid


def cycle(ki, excess=0.5, guess=(0.0053, 0.55)):
    """Where it sticks, how long it slips and how long it sticks: half of a symmetric cycle.

    It slips from -a, where the integral has reached the static force, to rest at +a: the motion is
    linear, of third order. There the integral winds up evenly until it has the other sign.
    """
    matrix = np.zeros((4, 4))
    matrix[0, 1] = matrix[1, 2] = 1.0
    matrix[2] = -ki, -50.0, -10.0, -1.0

    def start(a):
        return (50.0 * a - 1.0 - excess) / ki

    def end(a, lasts):
        return scipy.linalg.expm(matrix * lasts) @ [start(a), -a, 0.0, 1.0]

    def missed(z):
        _, x, v, _ = end(*z)
        return [v, x - z[0]]

    a, slips = scipy.optimize.fsolve(missed, guess, xtol=1e-13)
    assert np.max(np.abs(missed((a, slips)))) < 1e-15
    return a, slips, (-start(a) - end(a, slips)[0]) / a


def orbit_at(ki):
    a, slips, sticks = cycle(ki, guess=(0.016, 0.45))
    system = Continuous(ki)
    # Just before it breaks away.
    start = system.state(x=a, I=(1.5 - 50.0 * a) / ki - 0.01 * sticks * a)
    return periodic_orbit(system, OrbitGuess(start, 2.0 * (slips + sticks), t0=0.0))


@pytest.mark.slow
def test_the_branch_over_the_gain_ends_where_the_stick_has_no_length_left():
    """In a fold, with the unstable cycle that only slips, whose size is unbounded at the gain where
    the loop without friction is unstable, k_i = k_p k_d / m = 500."""
    system = Continuous(600.0)
    found = continue_orbit(
        system, orbit_at(600.0), "ki", (550.0, 800.0), follow=Follow(step=0.1, max_points=60)
    )
    end = scipy.optimize.brentq(lambda ki: cycle(ki, guess=(0.03, 0.46))[2], 640.0, 660.0, xtol=1e-11)
    (fold,) = found["GR"]
    assert float(fold.value) == pytest.approx(end, abs=1e-8)
    sticks = np.asarray(found.orbits.stable)
    assert np.sum(sticks) >= 5
    guess = (0.012, 0.45)
    for ki, period, x in zip(
        found.values[sticks], found.orbits.period[sticks], found.orbits.highest.x[sticks], strict=True
    ):
        a, slips, rests = cycle(float(ki), guess=guess)
        guess = a, slips
        assert float(period) == pytest.approx(2.0 * (slips + rests), rel=1e-9)
        assert float(x) == pytest.approx(a, rel=1e-9)
    # Beyond the fold it only slips, and grows towards 500.
    beyond = ~sticks
    assert np.all(np.diff(found.orbits.highest.x[beyond]) > 0.0)
    assert float(found.values[-1]) == pytest.approx(550.0)


@pytest.mark.slow
def test_the_branch_over_the_excess_is_born_at_zero_with_an_infinite_period():
    """Its size is in proportion to the excess, and so is the time in which it winds up."""
    first = orbit_at(600.0)
    found = continue_orbit(
        Continuous(600.0), first, "excess", (1e-3, 0.6), follow=Follow(step=0.3, both=True)
    )
    a, slips, _ = cycle(600.0, guess=(0.016, 0.45))
    excess = np.asarray(found.values)
    assert np.min(excess) == pytest.approx(1e-3)
    assert np.all(np.asarray(found.orbits.stable))
    np.testing.assert_allclose(found.orbits.highest.x, a * excess / 0.5, rtol=1e-8)
    rests = [cycle(600.0, e, (a * e / 0.5, slips))[2] for e in excess]
    np.testing.assert_allclose(found.orbits.period, 2.0 * (slips + np.array(rests)), rtol=1e-8)
    assert float(np.max(found.orbits.period)) > 100.0


@pytest.mark.slow
def test_a_forced_orbit_of_a_sampled_loop_is_followed_over_a_gain():
    """The period is 100 samples; each orbit is where a long run of its loop ends."""
    w = np.pi

    def reference(t, args):
        return 0.2 * jnp.sin(w * t), 0.2 * w * jnp.cos(w * t)

    def loop(ki):
        return under_pid(0.02, ki=ki, pid={"reference": reference})

    guess = orbit_guess(
        loop(50.0), begin(loop(50.0), 0.0), transient=20.0, max_period=2.0, forcing_period=2.0
    )
    found = continue_orbit(
        loop(50.0), guess, "update__ki", (30.0, 70.0), forcing_period=lambda system: 2.0,
        follow=Follow(step=0.1, max_points=4),
    )  # fmt: skip
    assert len(found.values) == 7
    assert np.all(np.asarray(found.orbits.stable))
    first = loop(float(found.values[0]))
    run = ss.simulate(first, 0.0, float(guess.t0) + 40.0, begin(first, 0.0))
    assert float(found.values[0]) != pytest.approx(50.0, abs=1.0)
    assert float(found.orbits.y0.y.x[0]) == pytest.approx(float(run.y1.y.x), abs=1e-12)
