"""Late loads, rest for ever, tiny and huge scales, no friction, blocks that stop together."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism._modes import ModeNames, mode_of, states_of
from tests.stickslip.hybrid._loads import END, march, random_loads
from tests.stickslip.mechanism._machines import Chain, Oscillator, Pushed, Train, chain, flat


@pytest.mark.more
def test_random_loads_that_begin_late():
    """Against a march in small steps that knows nothing of events; jumps are declared as breaks."""
    loads, kinds = random_loads(40, 3)
    ground = Coulomb(1.0, 0.5)

    def run(load):
        machine = Pushed(ground, load)
        system = ss.WithBreaks(machine, load.breaks)
        y0 = system.start(machine.state(), 0.0)
        found = ss.simulate(system, 0.0, END, y0, saveat=ss.SaveAt(max_events=None))
        return found.y1.y.x, found.num_events, found.flags

    x, events, flags = jax.jit(jax.vmap(run))(loads)
    expected, number = march(loads, 60_000)
    jumps = np.asarray(jax.vmap(lambda load: jnp.sum(load.breaks <= END))(loads))
    same = np.asarray(events) - jumps == np.asarray(number)
    sound = np.asarray(flags) == 0
    assert (sound & same).sum() >= 25
    np.testing.assert_allclose(x[sound & same], expected[sound & same], rtol=1e-5, atol=1e-6)
    assert set(kinds) >= {"pulses", "ramp", "chirp"}


@pytest.mark.more
def test_a_chain_at_rest_that_is_barely_moved():
    """1.001 sin t starts it for a thousandth of a period, and nothing but its tip says so."""

    class Shaken(Chain):
        def forces(self, t, q, v, args):
            f = list(super().forces(0.0, q, v, args))
            f[1] = f[1] + 1.001 * jnp.sin(t)
            return f

    laws = (Coulomb(2.0), Coulomb(1.0, 0.5), Coulomb(2.0))
    machine = Shaken(1.0, 1.0, 2.0, laws, 0.0, 3)
    run = ss.simulate(machine, 0.0, 3.0, machine.state(), saveat=ss.SaveAt(max_events=16))
    assert float(run.events.t[0]) == pytest.approx(np.arcsin(1 / 1.001), abs=1e-9)
    assert int(run.num_events) >= 2

    def reference(t):
        """x'' = 1.001 sin t - 0.5 - 5 x while it slides, from rest at the start."""
        w, start = np.sqrt(5.0), np.arcsin(1 / 1.001)
        a = 1.001 / (5.0 - 1.0)
        c = -(a * np.sin(start) - 0.1)
        d = -a * np.cos(start) / w
        s = t - start
        x = a * np.sin(t) - 0.1 + c * np.cos(w * s) + d * np.sin(w * s)
        return x, a * np.cos(t) - c * w * np.sin(w * s) + d * w * np.cos(w * s)

    stop = float(run.events.t[1])
    x, v = reference(stop)
    assert abs(v) < 1e-9
    assert float(run.events.y_before.x_2[1]) == pytest.approx(x, abs=1e-9)


@pytest.mark.more
@pytest.mark.parametrize("length", [1e-12, 1e-6, 1e6])
@pytest.mark.parametrize("kind", [Chain, Train])
def test_units_of_length_do_not_matter(length, kind):
    """The same chain with all lengths and forces scaled: the same events, the motion scaled."""

    def run(size):
        laws = tuple(Coulomb(size * (1.0 + 0.1 * i), 0.6 * size) for i in range(3))
        machine = kind(1.0, 1.0, 2.0, laws, 0.1 * size, 3)
        start = machine.state(x_1=0.5 * size, x_2=-0.8 * size)
        found = ss.simulate(machine, 0.0, 20.0, start, saveat=ss.SaveAt(max_events=64))
        return int(found.num_events), np.asarray(found.events.t[:6]), np.asarray(flat(found.y1)) / size

    number, times, end = run(length)
    expected_number, expected_times, expected = run(1.0)
    assert number == expected_number >= 6
    np.testing.assert_allclose(times, expected_times, rtol=1e-8)
    np.testing.assert_allclose(end, expected, atol=1e-8)


@pytest.mark.more
def test_all_contacts_at_rest_for_the_whole_run():
    machine = chain(3, speed=0.001)
    run = ss.simulate(machine, 0.0, 50.0, machine.state(x_1=0.1))
    assert int(run.num_events) == 0
    np.testing.assert_array_equal(flat(run.y1), [0.1, 0, 0, 0, 0, 0])
    assert machine.mode_names[int(run.mode1)] == "stick / stick / stick"


@pytest.mark.more
def test_no_friction_is_no_contact():
    """An undamped oscillation with a frequency that is known."""
    block = Oscillator(2.0, 8.0, Coulomb(0.0), 0.3)
    run = ss.simulate(block, 0.0, 10.0, block.state(x=0.7), saveat=ss.SaveAt(max_events=64))
    np.testing.assert_allclose(flat(run.y1), [0.7 * np.cos(20.0), -1.4 * np.sin(20.0)], atol=1e-9)

    row = Chain(1.0, 1.0, 2.0, (Coulomb(0.0),) * 2, 0.0, 2)
    run = ss.simulate(row, 0.0, 10.0, row.state(x_1=0.5, x_2=0.5), saveat=ss.SaveAt(max_events=64))
    np.testing.assert_allclose(flat(run.y1)[:2], 0.5 * np.cos(10.0), atol=1e-9)


def test_kinetic_above_static_friction():
    """The threshold is the greater of the two: as one coefficient."""
    ends = []
    for law in (Coulomb(0.2, 0.5), Coulomb(0.5)):
        machine = Chain(1.0, 1.0, 2.0, (law,) * 3, 0.3, 3)
        run = ss.simulate(
            machine, 0.0, 12.0, machine.state(x_1=1.0, x_2=-1.0), saveat=ss.SaveAt(max_events=64)
        )
        ends.append(flat(run.y1))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-10)


@pytest.mark.more
@pytest.mark.parametrize("kind", [Chain, pytest.param(Train, marks=pytest.mark.slow)])
def test_equal_blocks_stop_and_start_at_one_instant(kind):
    """Blocks side by side without a spring between that stretches: each is the block alone."""
    laws, n = (Coulomb(1.0, 0.5),) * 4, 4
    many = kind(1.0, 1.0, 2.0, laws, 0.2, n)
    alone = Chain(1.0, 1.0, 2.0, laws[:1], 0.2, 1)
    moved = range(n if kind is Chain else 1)
    start = many.state(**{f"x_{i + 1}": 1.3 for i in moved})
    run = ss.simulate(many, 0.0, 30.0, start, saveat=ss.SaveAt(max_events=256))
    one = ss.simulate(alone, 0.0, 30.0, alone.state(x_1=1.3), saveat=ss.SaveAt(max_events=64))
    assert int(run.num_events) >= int(one.num_events) >= 5
    end = np.asarray(flat(run.y1)).reshape(2, n)
    end = end if kind is Chain else end.cumsum(1)
    np.testing.assert_allclose(end, np.asarray(flat(one.y1))[:, None] * np.ones(n), atol=1e-8)


@pytest.mark.slow
def test_as_many_contacts_as_32_bits_hold():
    machine = chain(15)
    run = ss.simulate(machine, 0.0, 2.0, machine.state(x_15=3.0), saveat=ss.SaveAt(max_events=64))
    assert int(run.num_events) > 0
    last = machine.contact_states(int(run.events.mode_after[0]))
    assert len(last) == 15
    assert next(iter(last.values())) == "stick"
    with pytest.raises(ValueError, match=r"mode0.*\.\.\."):
        ss.simulate(machine, 0.0, 2.0, machine.state(), "glued")


def test_more_contacts_than_64_bits_hold_are_refused():
    with pytest.raises(ValueError, match=r"32 contacts.*at most 31"):
        chain(32)


@pytest.mark.more
@pytest.mark.parametrize("contacts", [1, 15, 16, 31])
def test_modes_of_many_contacts(contacts):
    """States to and fro, and the names of the modes."""
    states = np.random.default_rng(contacts).integers(-1, 3, (50, contacts)).astype(float)
    modes = jax.vmap(lambda row: mode_of(list(row)))(jnp.asarray(states))
    assert modes.dtype == (jnp.int32 if contacts <= 15 else jnp.int64)
    assert (modes >= 0).all()
    back = jax.vmap(lambda mode: jnp.stack(states_of(mode, contacts)))(modes)
    np.testing.assert_array_equal(back, states)
    names, words = ModeNames(contacts), ("slip backward", "stick", "slip forward", "open")
    for mode, row in zip(modes, states, strict=True):
        expected = " / ".join(words[int(s) + 1] for s in row)
        assert names[int(mode)] == expected
        assert names.index(expected) == int(mode)


@pytest.mark.slow
def test_modes_beyond_32_bits():
    """Seventeen blocks, the last one displaced: it slides back to its stop, in closed form."""
    n = 17
    machine = chain(n, speed=0.0)
    run = ss.simulate(machine, 0.0, 6.0, machine.state(x_17=0.45), saveat=ss.SaveAt(max_events=8))
    assert run.mode1.dtype == jnp.int64
    assert int(run.num_events) == 1
    before, after = (
        machine.mode_names[int(m[0])] for m in (run.events.mode_before, run.events.mode_after)
    )
    assert before == " / ".join([*["stick"] * (n - 1), "slip backward"])
    assert after == " / ".join(["stick"] * n)
    assert float(run.events.t[0]) == pytest.approx(np.pi / np.sqrt(3.0), rel=1e-9)
    assert float(run.y1.x_17) == pytest.approx(-0.05, abs=1e-9)
    again = ss.simulate(
        machine, 0.0, 6.0, machine.state(x_17=0.45), before, saveat=ss.SaveAt(max_events=8)
    )
    assert int(again.sequence) == int(run.sequence)
    assert int(again.mode1) == int(run.mode1) == machine.mode_names.index(after)


@pytest.mark.more
def test_parameters_of_many_lanes_at_once():
    """A machine made of arrays, one number a lane, is mapped over like any pytree."""
    speeds = jnp.asarray([0.1, 0.2, 0.3])
    ones = jnp.ones(3)
    many = Oscillator(ones, ones, Coulomb(ones, 0.5 * ones), speeds, ones)

    def end(machine):
        return ss.simulate(machine, 0.0, 20.0, machine.state(v_x=machine.belt_speed), throw=False).y1.x

    one_by_one = [end(Oscillator(1.0, 1.0, Coulomb(1.0, 0.5), v)) for v in speeds]
    np.testing.assert_allclose(jax.vmap(end)(many), one_by_one, rtol=1e-9)
