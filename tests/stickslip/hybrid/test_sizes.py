"""Tolerances know the size of the motion: the same digits for nanometres and for kilometres."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid.status import COARSE
from stickslip.systems import CoulombOscillator, Motion
from tests.stickslip.hybrid._accuracy import set_accuracy
from tests.stickslip.hybrid._systems import State, StickSlip
from tests.stickslip.systems._closed_forms import BeltCycle, derivatives

NAMES = ("mass", "stiffness", "static_force", "kinetic_force", "belt_speed")


def random_oscillators(number, seed):
    """Parameters of oscillators with amplitudes from 1e-14 to 1e3 m, and a time of a few cycles."""
    rng = np.random.default_rng(seed)
    rows, ends = [], []
    while len(rows) < number:
        amplitude, mass, stiffness = 10 ** rng.uniform((-14, -6, -3), (3, 3, 6))
        static = amplitude * stiffness * rng.uniform(0.2, 1)
        kinetic = static * rng.uniform(0.2, 0.95)
        frequency = np.sqrt(stiffness / mass)
        speed = amplitude * frequency * 10 ** rng.uniform(-1.5, 0.3)
        cycle = BeltCycle(mass, stiffness, static, kinetic, np.asarray(speed))
        end = float(cycle.first_slip + cycle.period * rng.uniform(0.3, 6))
        if cycle.distance_to_event(end) * frequency > 1e-3:
            rows.append((mass, stiffness, static, kinetic, speed))
            ends.append(end)
    return np.array(rows), np.array(ends)


@jax.jit
@jax.vmap
def value_and_slopes(row, end):
    def position(row):
        done = ss.simulate(CoulombOscillator(*row), 0.0, end, Motion(0.0, row[4]), 1, throw=False)
        return done.y1.x, (done.y1.x, done.successful, done.flags)

    slopes, rest = jax.jacfwd(position, has_aux=True)(row)
    return *rest, slopes


@pytest.mark.more
def test_the_same_digits_for_all_amplitudes():
    rows, ends = random_oscillators(200, seed=0)
    x, good, flags, slopes = map(np.asarray, value_and_slopes(jnp.asarray(rows), jnp.asarray(ends)))
    assert np.all(good)
    assert not np.any(flags)
    for row, end, found, by in zip(rows, ends, x, slopes, strict=True):
        given = dict(zip(NAMES, row, strict=True))

        def position(end=end, **given):
            return BeltCycle(**given).position(end)

        size = row[2] / row[1] + row[4] * np.sqrt(row[0] / row[1])
        np.testing.assert_allclose(found, position(**given), atol=1e-6 * size, rtol=0)
        # By the logarithms of the parameters, so that they have one unit.
        true = np.array([derivatives(position, given)[name] for name in NAMES]) * row
        np.testing.assert_allclose(by * row, true, atol=1e-4 * np.abs(true).max(), rtol=0)


def test_an_absolute_tolerance_above_the_motion_is_flagged():
    def run(size, **tolerance):
        block = CoulombOscillator(1.0, 1.0, size, 0.5 * size, 0.2 * size)
        integrator = ss.Integrator(step=ss.AdaptiveStep(1e-10, **tolerance))
        return ss.simulate(block, 0.0, 30.0, Motion(0.0, 0.2 * size), 1, integrator=integrator)

    assert int(run(1.0, atol=1e-10).flags) == 0
    assert int(run(1e-7, atol=1e-10).flags) == COARSE
    assert int(run(1e-7).flags) == 0
    assert int(run(1e-7, atol={"m": 1e-17, "m/s": 1e-17}).flags) == 0
    assert int(run(1e-7, atol={"m/s": 1e-10}).flags) == COARSE
    assert int(run(1e-7, atol={"x": 1e-17}).flags) == 0
    assert int(run(1e-7, atol=Motion(1e-17, 1e-17)).flags) == 0
    exact = 1e-7 * float(run(1.0).y1.x)
    np.testing.assert_allclose(float(run(1e-7).y1.x), exact, rtol=1e-9)


def test_a_system_without_stated_magnitudes_is_as_exact_when_it_is_small():
    """Guards are violated below a part of their own size, not below 1e-12 newtons."""
    size = 1e-13
    run = ss.simulate(StickSlip(0.2 * size, size, 0.5 * size), 0.0, 30.0, State(0.0, 0.2 * size), 0)
    large = ss.simulate(StickSlip(0.2), 0.0, 30.0, State(0.0, 0.2), 0)
    assert int(run.num_events) == int(large.num_events) == 6
    np.testing.assert_allclose(run.events.t[:6], large.events.t[:6], rtol=1e-9)
    np.testing.assert_allclose(run.y1.x / size, large.y1.x, rtol=1e-9)


class Chain(ss.AbstractSmoothSystem):
    """Integrators in a row; the last begins like t^12, of which no method has a digit."""

    def vector_field(self, t, y, mode, args):
        return jnp.concatenate([jnp.ones(1), y[:-1]])


def test_what_begins_like_a_high_power_of_time_starts():
    run = ss.simulate(Chain(), 0.0, 2.0, jnp.zeros(12))
    powers = np.cumprod(2.0 / np.arange(1, 13))
    np.testing.assert_allclose(run.y1, powers, rtol=1e-8)
    assert int(run.stats.num_attempts) < 100


class Spring(ss.AbstractSmoothSystem):
    """A mass on a stiff spring under its weight."""

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, 3.0 - 1e6 * y.x)


def test_an_equilibrium_is_not_resolved_below_rounding():
    run = ss.simulate(Spring(), 0.0, 1.0, Motion(3e-6, 0.0))
    assert int(run.stats.num_attempts) < 3000
    np.testing.assert_allclose(run.y1.x, 3e-6, rtol=1e-12)


def test_without_the_rounding_of_the_field_an_equilibrium_costs_many_more_steps(monkeypatch):
    set_accuracy(monkeypatch, few_roundings=0.0)
    integrator = ss.Integrator(max_steps=3000, detect_dips=False)  # another program
    start = Motion(3e-6 * (1 + 4e-16), 0.0)
    run = ss.simulate(Spring(), 0.0, 1.0, start, integrator=integrator, throw=False)
    assert not bool(run.successful)


@pytest.mark.parametrize("atol", [{"kg": 1e-9}, {"x": -1.0}, {"x": "small"}, "small", [1e-9], -1.0])
def test_wrong_tolerances_are_named(atol):
    with pytest.raises((ValueError, TypeError), match="atol"):
        ss.simulate(
            CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2), 0.0, 1.0, Motion(0.0, 0.2),
            integrator=ss.Integrator(step=ss.AdaptiveStep(1e-10, atol)),
        )  # fmt: skip
