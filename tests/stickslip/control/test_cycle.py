"""Hunting: the continuous cycle in closed form, periodic orbits of sampled loops, maps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import OrbitGuess, periodic_orbit
from stickslip.control import HuntingMap, hunting_map
from stickslip.control._hunting import code_of
from tests.stickslip.control._axis import Continuous, begin, under_pid
from tests.stickslip.control._reference import Loop


@pytest.mark.more
def test_the_continuous_cycle_is_that_of_the_closed_form():
    system = Continuous()
    run = ss.simulate(system, 0.0, 40.0, system.state(x=0.1))
    orbit = periodic_orbit(system, OrbitGuess(run.y1, 19.4, t0=0.0))
    assert bool(orbit.stable)
    assert int(orbit.flags) == 0
    assert float(orbit.period) == pytest.approx(19.430862442, abs=1e-9)
    assert float(orbit.highest.x) == pytest.approx(0.00531998578954, abs=1e-10)
    assert float(orbit.lowest.x) == pytest.approx(-0.00531998578954, abs=1e-10)
    lasts = np.sort(np.diff(np.asarray(orbit.events.t[:4])))
    assert lasts[0] == pytest.approx(0.546379294513, abs=1e-10)
    assert lasts[-1] == pytest.approx(9.16905192648, abs=1e-10)


@pytest.mark.more
@pytest.mark.parametrize("late", [False, True])
def test_a_forced_orbit_repeats_whole_samples(late):
    """The axis follows a sine of 100 samples; the orbit is where a long run ends."""
    w, delays = np.pi, {"delay": 1, "latency": 0.005} if late else {}

    def reference(t, args):
        return 0.2 * jnp.sin(w * t), 0.2 * w * jnp.cos(w * t)

    loop = under_pid(0.02, pid={"reference": reference}, **delays)
    run = ss.simulate(loop, 0.0, 20.01, begin(loop, 0.0))
    near = run.y1._replace(y=run.y1.y._replace(x=run.y1.y.x + 1e-3))
    orbit = periodic_orbit(loop, OrbitGuess(near, 2.0, t0=20.01), forced=True)
    assert bool(orbit.stable)
    assert int(orbit.steps) > 1
    assert int(orbit.flags) == 0
    long = ss.simulate(loop, 20.01, 60.01, run.y1)
    assert float(orbit.y0.y.x) == pytest.approx(float(long.y1.y.x), abs=1e-12)

    # Multipliers are those of the map of a period: compare the largest with differences of it.
    def back(x):
        start = orbit.y0._replace(y=orbit.y0.y._replace(x=x))
        return ss.simulate(loop, 20.01, 22.01, start).y1.y.x

    slope = (back(orbit.y0.y.x + 1e-6) - back(orbit.y0.y.x - 1e-6)) / 2e-6
    assert float(orbit.monodromy[0, 0]) == pytest.approx(float(slope), rel=1e-5)


@pytest.mark.more
def test_a_map_of_hunting():
    """Static friction above the kinetic one hunts, with integral action; without either it rests."""
    ki, static = np.meshgrid([0.0, 50.0, 200.0, 700.0], [1.0, 1.5])
    rk4 = ss.Integrator("rk4", ss.FixedStep(0.01))
    found = hunting_map(
        lambda ki, static: under_pid(0.01, ki=ki, static=static), {"ki": ki, "static": static}, begin,
        160.0, "x", resolution=1e-8, integrator=rk4,
    )  # fmt: skip
    assert isinstance(found, HuntingMap)
    assert found.code.shape == (2, 4)
    words = found.verdict.tolist()
    assert words[1] == ["rests", "hunts", "hunts", "unstable"]
    assert words[0][0] == "rests"
    assert "hunts" not in words[0]
    assert words[0][3] == "unstable"
    # The cycle of the continuous loop, to first order in the period.
    assert float(found.amplitude[1, 1]) == pytest.approx(0.00532, rel=0.01)
    assert float(found.period[1, 1]) == pytest.approx(19.43, rel=0.01)
    x, _, _, stops = Loop(ki=200.0).run(16000, 0.1)
    assert stops == pytest.approx(2 * 160.0 / float(found.period[1, 2]), abs=4)
    assert abs(x) == pytest.approx(float(found.amplitude[1, 2]), rel=0.1)
    assert np.all(np.isnan(found.period[np.asarray(found.code) != 1]))


def test_verdicts_of_places_in_four_quarters():
    wave, rest = np.sin(np.linspace(0.0, 20.0, 9)), np.zeros(9)
    cases = [
        (wave, rest, rest, True, "rests"),  # and a controller that goes on there:
        (wave, rest, rest, False, "creeps"),
        (wave, wave, 0.6 * wave, False, "hunts"),
        (wave, wave, 0.4 * wave, False, "creeps"),
        (wave, rest, wave, False, "hunts"),  # it stuck in the quarter before
        (wave, rest, 2.1 * wave, False, "unstable"),
    ]
    for first, third, last, still, word in cases:
        code = code_of(np.concatenate([first, first, third]), last, True, still, 1e-8)
        assert ("rests", "hunts", "creeps", "unstable")[int(code)] == word
    assert int(code_of(np.tile(wave, 3), wave, False, False, 1e-8)) == 2


@pytest.mark.more
def test_a_block_that_sticks_while_the_integrator_winds_up_is_not_at_rest():
    """The last one breaks away in the last quarter: it moves further than in the one before."""
    x = [Loop(ki=136.0).run(n, 0.1)[0] for n in (350, 525, 700)]
    assert x[0] == x[1] > 0.0 > x[2]
    found = hunting_map(
        lambda ki: under_pid(0.01, ki=ki), {"ki": np.array([0.0, 50.0, 136.0])}, begin, 7.0, "x",
        resolution=1e-8,
    )  # fmt: skip
    assert found.verdict.tolist() == ["rests", "creeps", "creeps"]


@pytest.mark.more
def test_slopes_of_a_cycle_under_jit():
    loop = under_pid(0.02)

    def end(kp):
        controlled = under_pid(0.02, kp)
        return ss.simulate(controlled, 0.0, 12.0, begin(controlled), throw=False).y1.y.x

    slope = jax.jit(jax.grad(end))(50.0)
    ends = [Loop(0.02, kp).run(600, 0.1)[0] for kp in (50.0 - 1e-5, 50.0 + 1e-5)]
    assert float(slope) == pytest.approx((ends[1] - ends[0]) / 2e-5, rel=1e-6)
    assert loop.guard_names[-1] == "a sample"
