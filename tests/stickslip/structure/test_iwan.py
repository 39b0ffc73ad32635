"""Many sliders in parallel: plays of a motion, Masing's rule, Segalman's distribution."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip._jaxpr import equations
from stickslip.structure import HarmonicForce, Jenkins, LinearStructure, WithSliders, iwan

STRICT = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12), max_steps=100_000)
K, F = np.full(100, 0.02), np.linspace(0.0005, 0.0195, 100)
LIMITS = F / K


def under(force, element):
    return WithSliders(LinearStructure([[1.0]], [[0.04]], [[1.0]], force), {"joint": element})


def plays(xs, z, limits):
    """Positions of sliders after a motion through these turns, each by itself."""
    for x in xs:
        z = np.clip(z, x - limits, x + limits)
    return z


def two_tones(t, q, v, args):
    return jnp.array([0.6 * jnp.cos(0.7 * t) + 0.4 * jnp.cos(3.1 * t)])


def test_each_of_a_hundred_sliders_is_the_play_of_the_motion():
    system = under(two_tones, Jenkins([1.0], K, F))
    run = ss.simulate(
        system, 0.0, 40.0, system.start(system.system.state()), integrator=STRICT,
        saveat=ss.SaveAt(max_events=4096),
    )  # fmt: skip
    count = int(run.num_events)
    turns = np.append(np.asarray(run.events.y_after.y.q[:count, 0]), float(run.y1.y.q[0]))
    right = plays(turns, np.zeros(100), LIMITS)
    np.testing.assert_allclose(run.y1.z, right, atol=1e-13)
    force = float(system.slider_forces(40.0, run.y1, run.mode1)["joint"])
    assert force == pytest.approx(float(np.sum(K * (turns[-1] - right))), abs=1e-13)
    # After a small loop all that slipped in it do so again in one instant.
    modes = np.asarray(run.events.mode_after[:count])
    assert any(abs(after - before) > 1 and after != 100 for before, after in itertools.pairwise(modes))
    assert int(run.flags) == 0


@pytest.mark.more
def test_loops_obey_masings_rule():
    system = under(HarmonicForce([0.5], 1.1), Jenkins([1.0], K, F))
    times = np.linspace(0.0, 40.0, 801)
    run = ss.simulate(
        system, 0.0, 40.0, system.start(system.system.state()), integrator=STRICT,
        saveat=ss.SaveAt(ts=times, max_events=4096),
    )  # fmt: skip
    log, y, mode = run.events, run.outputs.y, run.outputs.mode
    force = np.asarray(jax.vmap(lambda t, y, m: system.slider_forces(t, y, m)["joint"])(times, y, mode))
    stick = np.array([m >= 0 and system.mode_names[int(m)] == "stick" for m in log.mode_after])
    t_turn, x_turn = np.asarray(log.t)[stick], np.asarray(log.y_after.y.q[:, 0])[stick]

    def virgin(x):
        return np.sum(np.minimum(K * x[:, None], F), axis=1)

    # From the largest turn so far the way back is the first curve, twice as large.
    place = int(np.argmax(np.abs(x_turn)))
    assert 0 < place < len(x_turn) - 1
    back = (times > t_turn[place]) & (times < t_turn[place + 1])
    x, side = np.asarray(y.y.q[:, 0])[back], np.sign(x_turn[place])
    right = virgin(np.abs(x_turn[place : place + 1])) - 2.0 * virgin(0.5 * np.abs(x_turn[place] - x))
    np.testing.assert_allclose(side * force[back], right, atol=1e-12)
    assert np.ptp(right) > 0.8


@pytest.mark.more
def test_the_program_does_not_grow_with_the_sliders():
    def size(n):
        system = under(two_tones, Jenkins([1.0], np.full(n, 1.0 / n), np.linspace(0.1, 1.0, n) / n))
        begin = system.start(system.system.state())
        closed = jax.make_jaxpr(lambda y: ss.simulate(system, 0.0, 1.0, y, throw=False).y1)(begin)
        return len(list(equations(closed.jaxpr)))

    assert size(10) == size(200)


@pytest.mark.more
def test_derivatives_by_bounds_and_springs_of_many():
    weights = np.cos(np.arange(20.0))

    def end(p):
        bounds = (0.01 + 0.002 * jnp.arange(20.0)) * p[0]
        system = under(HarmonicForce([0.5], 1.1), Jenkins([1.0], 0.05 * p[1] * jnp.ones(20), bounds))
        run = ss.simulate(
            system, 0.0, 12.0, system.start(system.system.state()), integrator=STRICT,
            saveat=ss.SaveAt(max_events=None),
        )  # fmt: skip
        return run.y1.y.q[0] + run.y1.z @ weights, (run.flags, run.num_events)

    at, h = jnp.array([1.0, 1.0]), 1e-5
    slope, (flags, events) = jax.jacfwd(end, has_aux=True)(at)
    shifts = h * jnp.concatenate([jnp.eye(2), -jnp.eye(2)])
    ends = jax.vmap(lambda s: end(at + s)[0])(shifts)
    assert int(events) > 40
    assert int(flags) == 0
    np.testing.assert_allclose(slope, (ends[:2] - ends[2:]) / (2 * h), rtol=1e-6)


def test_the_four_parameters_are_stiffness_force_and_the_power_of_small_loops():
    element = iwan([1.0], 2.0, 5.0, -0.4, 0.7, 2000)
    k, f = np.asarray(element.stiffness), np.asarray(element.bound)
    assert k.sum() == pytest.approx(5.0, rel=1e-12)
    assert f.sum() == pytest.approx(2.0, rel=1e-12)
    assert np.all(np.diff(f / k) > 0.0)

    # Loss per turn of a loop of amplitude u: 4 sum f (u - f/k), as a power of the force.
    def loss_and_force(u):
        return 4 * np.sum(np.maximum(f * (u - f / k), 0.0)), np.sum(np.minimum(k * u, f))

    most = f[-1] / k[-1]
    (a, p), (b, r) = loss_and_force(0.05 * most), loss_and_force(0.02 * most)
    power = np.log(a / b) / np.log(0.05 / 0.02)
    assert power == pytest.approx(3.0 - 0.4, abs=2e-3)  # of the elongation, that is small
    assert p > r
    # The last ones lose beta/(beta + 1) of the stiffness at once, as the share of their density.
    share = 0.7 + 0.6 / 1.6
    assert most == pytest.approx(2.0 * 1.7 / (5.0 * share), rel=1e-12)
    assert k[-1] == pytest.approx(2.0 * 0.7 / (most * share), rel=1e-12)


@pytest.mark.more
def test_a_row_whose_sliders_have_crossed_has_no_mode():
    system = under(None, Jenkins([1.0], [1.0, 1.0], [0.1, 0.2]))
    y = system.system.state()
    crossed = system.start(y, [0.1, -0.1])
    with pytest.raises(ValueError, match=r"y0\.z"):
        ss.simulate(system, 0.0, 1.0, crossed)
    traced = jax.jit(lambda y: ss.simulate(system, 0.0, 1.0, y, throw=False).result)(crossed)
    assert traced == ss.RESULTS.no_admissible_mode
