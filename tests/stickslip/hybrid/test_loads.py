"""A mechanism at rest under a load that changes with time misses none of its events in silence."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid import _doubt
from stickslip.hybrid.status import DISCONTINUOUS, GRAZING
from stickslip.systems import Motion, OscillatorBetweenStops
from tests.stickslip.hybrid._accuracy import set_accuracy
from tests.stickslip.hybrid._loads import END, Block, march, random_loads

REST = Motion(0.0, 0.0)


@jax.jit
@jax.vmap
def by_default(load):
    return ss.simulate(Block(load), 0.0, END, REST, saveat=ss.SaveAt(max_events=512), throw=False)


@jax.jit
@jax.vmap
def with_breaks(load):
    block = ss.WithBreaks(Block(load), load.breaks)
    return ss.simulate(
        block, 0.0, END, block.start(REST), saveat=ss.SaveAt(max_events=512), throw=False
    )


def wrong(x, run, reference, events):
    """Which runs end elsewhere, or have other events. The march is right to some 1e-7."""
    off = np.abs(x - reference) > 1e-6 * (1e-2 + np.abs(reference))
    return off | (np.asarray(run.num_events) != np.asarray(events))


MANY = pytest.param(1000, 100_000, marks=pytest.mark.slow)


@pytest.mark.more
@pytest.mark.parametrize(("number", "steps"), [(60, 60_000), MANY])
def test_random_loads_end_as_marched_by_hand_or_are_flagged(number, steps):
    loads, kinds = random_loads(number, seed=number)
    run = by_default(loads)
    off = wrong(run.y1.x, run, *march(loads, steps))
    flags = np.asarray(run.flags)
    assert np.all(run.successful)
    assert not np.any(off & (flags == 0)), kinds[off & (flags == 0)]
    # Only loads that jump at times nobody declared are flagged, and those are right all the same.
    steps = np.isin(kinds, ["steps", "all"])
    assert not np.any(flags[~steps])
    assert np.sum(off) <= number // 100
    assert np.all(np.isin(flags[flags != 0] & ~(DISCONTINUOUS | GRAZING), 0))


@pytest.mark.more
@pytest.mark.parametrize(("number", "steps"), [(40, 60_000), MANY])
def test_loads_with_declared_steps_are_right_without_a_flag(number, steps):
    loads, kinds = random_loads(4 * number, seed=number + 1)
    chosen = np.flatnonzero(np.isin(kinds, ["steps", "all"]))[:number]
    loads = jax.tree.map(lambda a: a[chosen], loads)
    run = with_breaks(loads)
    x, events = march(loads, steps)
    assert np.all(run.successful)
    assert not np.any(run.flags)
    np.testing.assert_allclose(run.y1.y.x, x, atol=1e-6, rtol=1e-6)
    # Each break is an event of its own, and what it sets off is part of it.
    assert np.all(np.asarray(run.num_events) <= np.asarray(events) + 4)


@pytest.mark.more
def test_without_the_doubt_most_events_at_rest_are_missed(monkeypatch):
    """The fault this file is about, planted."""
    loads, _ = random_loads(30, seed=3)
    set_accuracy(monkeypatch, _doubt, doubt_certain=0.0, slack=1e300)
    free = ss.Integrator(step=ss.AdaptiveStep(1e-10, dtmax=jnp.inf))

    @jax.jit
    @jax.vmap
    def run(load):
        return ss.simulate(
            Block(load), 0.0, END, REST, saveat=ss.SaveAt(max_events=512), throw=False, integrator=free
        )

    off = wrong((found := run(loads)).y1.x, found, *march(loads, 60_000))
    assert np.sum(off & (np.asarray(found.flags) == 0)) > 10


@pytest.mark.more
@pytest.mark.parametrize("amplitude", [1.05, 1.001, 1.5])
@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_a_resting_block_under_one_tone(amplitude, rate):
    loads, _ = random_loads(1, seed=0)
    load = jax.tree.map(lambda a: 0.0 * a[0] + 1.0, loads)
    zero = jnp.zeros(2)
    load = load._replace(
        tone=jnp.asarray([amplitude, 0.0]), omega=jnp.asarray([rate, 1.0]), phase=zero, pulse=zero,
        step=zero, chirp=jnp.zeros(()), ramp=jnp.zeros(()),
    )  # fmt: skip
    fine = ss.Integrator(step=ss.AdaptiveStep(1e-12, 1e-14, dtmax=1e-2 / rate))
    run, exact = (
        ss.simulate(Block(load), 0.0, 30.0 / rate, REST, integrator=i, saveat=ss.SaveAt(max_events=64))
        for i in (None, fine)
    )
    assert int(run.num_events) == int(exact.num_events) > 5
    np.testing.assert_allclose(run.events.t, exact.events.t, rtol=1e-9)
    assert int(run.flags) == 0


def test_a_mass_at_rest_on_a_stop_leaves_it():
    stops = OscillatorBetweenStops(
        1.0, 1e-3, lower=-0.1, upper=0.1, restitution=0.0, force_amplitude=1.0, force_frequency=1.0
    )
    run = ss.simulate(stops, 0.0, 40.0, REST)
    assert int(run.num_events) == 26  # by an independent march
    np.testing.assert_allclose(run.y1.x, 0.0368, atol=5e-5)


class Pushed(ss.AbstractSmoothSystem):
    """A free mass under a load of 1 N that lasts for a moment."""

    begin: float
    lasts: float

    def vector_field(self, t, y, mode, args):
        inside = (t >= self.begin) & (t < self.begin + self.lasts)
        return Motion(y.v, jnp.where(inside, 1.0, 0.0))


def moments(number, lasts):
    return jnp.asarray(np.random.default_rng(1).uniform(0.0, END - lasts, number))


@pytest.mark.more
def test_what_lasts_for_less_than_the_documented_bound_is_what_can_be_missed():
    """`AdaptiveStep`: shorter than 0.4 of 1/1000 of the run; here 12 ms in 30 s."""
    lasts = 0.4 * END / 1000
    none, _ = random_loads(1, seed=0)
    none = jax.tree.map(lambda a: 0.0 * a[0] + 1.0, none)
    zero = jnp.zeros(2)

    def block(begin, lasts):
        load = none._replace(
            tone=zero, pulse=zero, chirp=jnp.zeros(()), ramp=jnp.zeros(()),
            step=jnp.asarray([2.0, 0.0]), step_at=jnp.stack([begin, END + 1.0]),
            step_lasts=jnp.stack([jnp.asarray(lasts), jnp.asarray(1.0)]),
        )  # fmt: skip
        run = ss.simulate(Block(load), 0.0, END, REST, throw=False)
        return run.num_events, run.y1.x

    begin = moments(60, lasts)
    blocks = jax.jit(jax.vmap(block, in_axes=(0, None)))
    events, x = blocks(begin, lasts)
    # It slides for 12 ms at 1.5 m/s^2 and then slows down by 0.5 m/s^2.
    speed = 1.5 * lasts
    np.testing.assert_array_equal(events, 2)
    np.testing.assert_allclose(x, speed * lasts / 2 + speed**2 / (2 * 0.5), rtol=1e-6)
    events, _ = blocks(begin, lasts / 50)
    assert np.mean(np.asarray(events) == 0) > 0.5  # so that the bound is one


def test_a_load_on_a_free_mass_at_rest_is_felt():
    lasts = 0.4 * END / 1000

    def speed(begin):
        return ss.simulate(Pushed(begin, lasts), 0.0, END, REST).y1.v

    np.testing.assert_allclose(jax.jit(jax.vmap(speed))(moments(60, lasts)), lasts, rtol=1e-6)


def test_sections_of_time_are_not_jumped_over():
    """A stroboscopic section, while nothing moves."""
    strobe = ss.Section(lambda system, t, y, dy, mode, args: jnp.sin(2 * jnp.pi * t), "rising")
    rest = Pushed(1e9, 1.0)
    run = ss.simulate(rest, 0.0, 25.5, REST, saveat=ss.SaveAt(sections=strobe))
    np.testing.assert_allclose(run.crossings[0].t[:25], np.arange(1.0, 26.0), atol=1e-9)
    assert int(run.crossings[0].count) == 25


def test_a_jump_that_nobody_declared_is_flagged_and_one_that_is_not_there_is_not():
    push = ss.simulate(Pushed(10.0, 100.0), 0.0, END, Motion(0.0, 1.0))
    np.testing.assert_allclose(push.y1.x, END + 20.0**2 / 2, rtol=1e-9)
    assert int(push.flags) == DISCONTINUOUS
    assert int(ss.simulate(Pushed(100.0, 100.0), 0.0, END, Motion(0.0, 1.0)).flags) == 0


@pytest.mark.more
@pytest.mark.parametrize("rows", [2, 7, 61, 601])
def test_the_motion_does_not_depend_on_what_is_asked_for(rows):
    loads, _ = random_loads(8, seed=11)
    load = jax.tree.map(lambda a: a[0], loads)
    ts = jnp.linspace(0.0, END, rows)
    run = ss.simulate(Block(load), 0.0, END, REST, saveat=ss.SaveAt(ts=ts), throw=False)
    plain = ss.simulate(Block(load), 0.0, END, REST, throw=False)
    assert int(run.num_events) == int(plain.num_events)
    np.testing.assert_allclose(run.y1.x, plain.y1.x, rtol=1e-8)
