"""Sections that are zero where an event is, or where the run begins: each crossing counts once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import Motion
from tests.stickslip.hybrid._loads import Block, random_loads
from tests.stickslip.hybrid._systems import Circle, Flight, State, fixed

END = 20.0
REST = Motion(0.0, 0.0)


def tone_only(amplitude, omega):
    """A load of one tone."""
    loads, _ = random_loads(1, seed=0)
    none = jax.tree.map(lambda a: 0.0 * a[0], loads)
    one = jnp.ones(2)
    return none._replace(
        tone=jnp.stack([amplitude, 0.0]), omega=omega * one, pulse_width=one, ramp_lasts=jnp.ones(()),
        step_at=END + one, step_lasts=one,
    )  # fmt: skip


SECTIONS = (
    ss.Section(lambda system, t, y, dy, mode, args: args(t) - 1.0, "both", name="threshold"),
    ss.Section(lambda system, t, y, dy, mode, args: y.v, "both", name="speed"),
    ss.Section(lambda system, t, y, dy, mode, args: y.v, "rising", name="speed rises"),
)


@pytest.mark.more
@pytest.mark.parametrize("number", [40, pytest.param(1000, marks=pytest.mark.slow)])
def test_zeros_of_guards_are_crossings_of_the_same_functions(number):
    """The load at which a block breaks loose, which may come back within a step; where it stops."""
    rng = np.random.default_rng(4)
    amplitude, omega = 1.0 + 10 ** rng.uniform(-4, -0.2, number), 10 ** rng.uniform(-0.5, 1.0, number)

    @jax.jit
    @jax.vmap
    def run(amplitude, omega):
        load = tone_only(amplitude, omega)
        found = ss.simulate(
            Block(load), 0.0, END, REST, args=load, saveat=ss.SaveAt(sections=SECTIONS), throw=False
        )
        return found.successful, found.flags, found.events, found.num_events, found.crossings

    successful, flags, events, events_count, crossings = run(jnp.asarray(amplitude), jnp.asarray(omega))
    assert np.all(successful)
    assert not np.any(flags)
    for i in range(number):
        # The load goes through 1 at its events and, while the block slides, without one.
        turns = 2.0 * np.pi * np.arange(END * omega[i] / (2.0 * np.pi) + 1.0)[:, None]
        up = np.arcsin(1.0 / amplitude[i])
        times = np.ravel(turns + np.array([up, np.pi - up])) / omega[i]
        happened = slice(0, int(events_count[i]))
        stops = np.asarray(events.guard[i][happened]) == 0
        backward = stops & (np.asarray(events.mode_before[i][happened]) == 0)
        t = np.asarray(events.t[i][happened])
        for section, true in zip(crossings, (times[times < END], t[stops], t[backward]), strict=True):
            assert int(section.count[i]) == len(true)
            # The time of a crossing that is only just one is known to the root of rounding.
            np.testing.assert_allclose(section.t[i][: len(true)], true, rtol=0, atol=2e-7)


@pytest.mark.more
@pytest.mark.parametrize(("direction", "terminal"), [("falling", True), ("both", False)])
def test_what_leaves_zero_and_comes_back_within_the_first_step(direction, terminal):
    """Thrown up at 1 m/s it is back after 2/9 s, at the last quarter of the first step."""
    section = ss.Section(lambda system, t, y, dy, mode, args: y.x, direction, terminal=terminal)
    flight = Flight(acceleration=-9.0, slope=-100.0)
    step = ss.Integrator("rk4", ss.FixedStep(0.3), detect_dips=False)
    run = ss.simulate(
        flight, 0.0, 0.9, State(0.0, 1.0), saveat=ss.SaveAt(sections=section), integrator=step
    )
    assert int(run.crossings[0].count) == 1
    np.testing.assert_allclose(run.crossings[0].t[0], 2.0 / 9.0, rtol=1e-12)
    down = ss.Section(lambda system, t, y, dy, mode, args: y.x, "rising", terminal=terminal)
    run = ss.simulate(
        flight, 0.0, 0.9, State(0.0, 1.0), saveat=ss.SaveAt(sections=down), integrator=step
    )
    assert int(run.crossings[0].count) == 0


@pytest.mark.more
def test_what_begins_on_zero_is_counted_once_it_comes_back():
    section = ss.Section(lambda system, t, y, dy, mode, args: y.x, "both")
    run = ss.simulate(
        Flight(-9.0, slope=-100.0), 0.0, 0.5, State(0.0, 1.0), saveat=ss.SaveAt(sections=section)
    )
    assert int(run.crossings[0].count) == 1
    np.testing.assert_allclose(run.crossings[0].t[0], 2.0 / 9.0, rtol=1e-9)


def test_a_step_between_two_events_crosses_at_its_end():
    """x = cos t passes -level down and up again within one step; the section is the guard."""
    levels = np.linspace(0.9, 0.99995, 32)

    @jax.jit
    @jax.vmap
    def run(level):
        section = ss.Section(lambda system, t, y, dy, mode, args: y.x + level, "both")
        return ss.simulate(
            Circle(-level), 0.0, 6.0, State(1.0, 0.0), saveat=ss.SaveAt(sections=section, max_events=2),
            integrator=fixed(1.0),
        )  # fmt: skip

    found = run(jnp.asarray(levels))
    np.testing.assert_array_equal(found.num_events, 2)
    np.testing.assert_array_equal(found.crossings[0].count, 2)
    np.testing.assert_allclose(found.crossings[0].t[:, :2], found.events.t, rtol=1e-12)


@pytest.mark.more
def test_sections_next_to_a_guard_are_crossed_once():
    """Nearer to it than an event is located, on either side: x = cos t, closed form."""
    rng = np.random.default_rng(0)
    levels = rng.uniform(-0.99, 0.99, 256)
    others = levels + 10.0 ** rng.uniform(-13.0, -9.5, 256) * rng.choice([-1.0, 1.0], 256)
    ends = rng.uniform(2.0, 20.0, 256)
    ends[::4] = np.arccos(levels[::4]) + 2.0 * np.pi  # on an event

    @jax.jit
    @jax.vmap
    def run(level, other, end):
        sections = tuple(
            ss.Section(lambda system, t, y, dy, mode, args: y.x - other, direction)
            for direction in ("both", "rising", "falling")
        )
        saveat = ss.SaveAt(sections=sections)
        found = ss.simulate(
            Circle(level), 0.0, end, State(1.0, 0.0), integrator=fixed(1.0), saveat=saveat
        )
        return found.crossings

    for crossings, turns in zip(run(levels, others, ends), ((1, -1), (-1,), (1,)), strict=True):
        for i, end in enumerate(ends):
            angles = [turn * np.arccos(others[i]) for turn in turns]
            times = np.sort(np.add.outer(2.0 * np.pi * np.arange(5), angles).ravel())
            times = times[times > 0]
            count = int(crossings.count[i])
            assert np.sum(times < end - 1e-3) <= count <= np.sum(times < end + 1e-3)
            np.testing.assert_allclose(crossings.t[i, :count], times[:count], atol=1e-4)
