"""Sampled loops against closed forms between their instants."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.control import Commanded, WithController, encoder_reading
from tests.stickslip.control._axis import Axis, begin, under_pid
from tests.stickslip.control._reference import Loop

SAMPLES = 200
# Of each: T_s, the three gains, static friction, where it begins, latency (in parts of T_s), quantum.
LOW = (0.005, 20.0, 0.0, 4.0, 1.0, -0.2, 0.01, 1e-4)
HIGH = (0.03, 80.0, 80.0, 12.0, 2.0, 0.2, 0.99, 1e-3)


def drawn(number, seed):
    rows = np.random.default_rng(seed).uniform(LOW, HIGH, (number, len(LOW)))
    rows[:, 6] *= rows[:, 0]
    return rows


def rounded_reading(t, y, quantum):
    return encoder_reading(y.x, quantum), y.v_x


def end_of(row, delay, late, rounds):
    period, kp, ki, kd, static, x, latency, quantum = row
    measure = {"measure": rounded_reading} if rounds else {}
    loop = under_pid(
        period, kp, ki, kd, static, delay=delay, latency=latency if late else None, **measure
    )
    return ss.simulate(
        loop, 0.0, SAMPLES * period, begin(loop, x, args=quantum), args=quantum, throw=False
    )


def reference(row, delay, late, rounds):
    period, kp, ki, kd, static, x, latency, quantum = row
    loop = Loop(
        period, kp, ki, kd, static, quantum=quantum if rounds else 0.0, delay=delay,
        latency=latency if late else 0.0,
    )  # fmt: skip
    return loop.run(SAMPLES, x)


@pytest.mark.more
@pytest.mark.parametrize(
    ("period", "reading", "x", "total"),
    [
        (0.01, {}, 0.004581286467697737, -0.016075663788908234),
        (0.001, {}, 0.0045095278419187475, -0.01574372274322063),
        (0.001, {"quantum": 1e-4, "delay": 1}, 0.004527043748386453, -0.015871999999996653),
    ],
)
def test_the_numbers_of_the_closed_form(period, reading, x, total):
    quantum = reading.get("quantum")
    measure = {"measure": rounded_reading} if quantum else {}
    loop = under_pid(period, delay=reading.get("delay", 0), **measure)
    run = ss.simulate(loop, 0.0, 10.0, begin(loop, args=quantum), args=quantum)
    assert float(run.y1.y.x) == pytest.approx(x, abs=1e-12)
    assert float(run.y1.y.v_x) == 0.0
    # The run has one sample more, that at its end.
    read = x if quantum is None else round(x / quantum) * quantum
    sampled = -float(run.y1.state.integral) / 50.0
    assert sampled == pytest.approx(total + period * read, abs=1e-12)
    assert int(run.num_events) == 2
    assert int(run.flags) == 0
    assert int(run.stats.num_attempts) <= 2 * 10.0 / period + 20
    again = Loop(period, **reading).run(round(10.0 / period), 0.1)
    assert again[0] == pytest.approx(x, abs=1e-15)
    assert again[3] == 2


def test_slopes_of_one_random_loop():
    """By gains, sample time, friction, beginning and latency; fifty of them below."""
    row = drawn(50, seed=3)[0]
    found = jax.jit(jax.jacfwd(lambda row: end_of(row, 1, True, rounds=False).y1.y.x))(row)
    for j in range(7):
        moved = [row.copy(), row.copy()]
        h = 1e-6 * max(abs(row[j]), 1e-2)
        moved[0][j], moved[1][j] = row[j] - h, row[j] + h
        low, high = (reference(one, 1, True, rounds=False) for one in moved)
        assert low[3] == high[3]
        assert float(found[j]) == pytest.approx((high[0] - low[0]) / (2 * h), rel=1e-6, abs=1e-9), j


@pytest.mark.parametrize(
    ("delay", "late", "rounds"),
    [
        (2, True, True),
        pytest.param(0, False, False, marks=pytest.mark.more),
        pytest.param(1, True, False, marks=pytest.mark.more),
        pytest.param(1, False, True, marks=pytest.mark.more),
    ],
)
def test_fifty_random_loops(delay, late, rounds):
    rows = drawn(50, seed=delay + 10 * rounds)
    run = jax.jit(jax.vmap(lambda row: end_of(row, delay, late, rounds)))(rows)
    for i, row in enumerate(rows):
        x, v, _, _ = reference(row, delay, late, rounds)
        assert float(run.y1.y.x[i]) == pytest.approx(x, abs=1e-12), row
        assert float(run.y1.y.v_x[i]) == pytest.approx(v, abs=1e-12), row
    assert bool(jnp.all(run.successful))


@pytest.mark.more
@pytest.mark.parametrize("late", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_derivatives_of_fifty_random_loops(late):
    """By gains, sample time, friction, beginning and latency, in reverse; by gains forward too."""
    rows = drawn(50, seed=3)

    def end(row):
        run = end_of(row, 1, late, rounds=False)
        return run.y1.y.x, run.flags

    backward, flags = jax.jit(jax.vmap(jax.grad(end, has_aux=True)))(rows)
    gains = jnp.eye(len(LOW))[1:4]
    forward = jax.jit(
        jax.vmap(lambda row: jax.vmap(lambda d: jax.jvp(lambda r: end(r)[0], (row,), (d,))[1])(gains))
    )(rows)
    assert np.allclose(forward, backward[:, 1:4], rtol=1e-9, atol=1e-14)
    compared = 0
    for i, row in enumerate(rows):
        for j in range(7 if late else 6):
            h = 1e-6 * max(abs(row[j]), 1e-2)
            ends = []
            for sign in (-1.0, 1.0):
                moved = row.copy()
                moved[j] += sign * h
                ends.append(reference(moved, 1, late, rounds=False))
            if int(flags[i]) == 0 and ends[0][3] == ends[1][3]:
                slope = (ends[1][0] - ends[0][0]) / (2 * h)
                assert float(backward[i, j]) == pytest.approx(slope, rel=1e-6, abs=1e-9), (i, j)
                compared += 1
    assert compared >= 300


@pytest.mark.parametrize("v", [0.05, 0.02])
def test_a_stop_that_falls_on_a_sample_is_taken_and_flagged(v):
    """0.05 m/s under 0.5 N of 1 N friction ends at 0.07 s; 0.02 m/s under none at 0.02 s."""

    def push(k, t, measured, state, args):
        return jnp.where(k < 3, 0.0, jnp.where(k < 9, 0.5, 1.3)), state

    loop = WithController(Axis(1.0, 1.0), push, 0.01)
    runs = [ss.simulate(loop, 0.0, 0.2, begin(loop, 0.0, v + d)) for d in (-1e-9, 0.0, 1e-9)]
    low, exact, high = (float(run.y1.y.x) for run in runs)
    assert float(exact) == pytest.approx(0.5 * (low + high), abs=1e-12)
    assert float(runs[1].events.t[0]) == pytest.approx(0.07 if v == 0.05 else 0.02, abs=1e-15)
    assert int(runs[1].flags) == 2
    assert int(runs[0].flags) == int(runs[2].flags) == 0


@pytest.mark.more
def test_a_stop_between_a_sample_and_its_output():
    # Nothing acts until 0.008 s; without what acts then it would stop at 0.01 s.
    loop = Loop(0.01, kp=0.0, ki=0.0, kd=100.0, latency=0.008, static=3.0, kinetic=2.0)
    x, v, _, stops = loop.run(3, 0.0, 0.02)
    system = under_pid(0.01, 0.0, 0.0, 100.0, 3.0, 2.0, latency=0.008)
    run = ss.simulate(system, 0.0, 0.03, begin(system, 0.0, 0.02))
    assert stops == 1
    assert float(run.events.t[0]) == pytest.approx(0.009, abs=1e-15)
    assert float(run.y1.y.x) == pytest.approx(x, abs=1e-15)
    assert float(run.y1.y.v_x) == v == 0.0


@pytest.mark.more
def test_samples_are_at_their_times_and_neither_logged_nor_counted():
    loop = under_pid(0.007)

    def update(k, t, measured, state, args):
        return 0.0 * measured.x, (t, k.astype(jnp.float64))

    loop = WithController(Axis(), update, 0.007, (0.0, 0.0), offset=0.1)
    times = 0.1 + 0.007 * np.arange(500)
    run = ss.simulate(
        loop, 0.0, 0.1 + 0.007 * 499, begin(loop), saveat=ss.SaveAt(ts=times, max_events=3)
    )
    at, number = run.outputs.y.state
    assert np.array_equal(number, np.arange(500))
    assert np.array_equal(at, times)
    assert int(run.num_events) == 0 == int(run.events.count)
    assert int(run.stats.num_attempts) < 1050


@pytest.mark.more
def test_output_at_a_sample_stands_behind_it_and_a_run_goes_on_from_there():
    loop = under_pid()
    run = ss.simulate(loop, 0.0, 1.0, begin(loop), saveat=ss.SaveAt(ts=[0.0, 0.07, 0.29, 1.0]))
    for i, samples in enumerate((0, 7, 29, 100)):
        x, _, total, _ = Loop().run(samples, 0.1)
        assert float(run.outputs.y.y.x[i]) == pytest.approx(x, abs=1e-15)
        assert -float(run.outputs.y.state.integral[i]) / -50 == pytest.approx(
            total - 0.01 * x, abs=1e-15
        )
    first = ss.simulate(loop, 0.0, 0.5037, begin(loop))
    second = ss.simulate(loop, 0.5037, 1.0, first.y1, first.mode1)
    assert float(second.y1.y.x) == pytest.approx(float(run.y1.y.x), abs=1e-15)


@pytest.mark.more
def test_without_integral_action_it_rests_in_the_dead_zone_everywhere():
    loop = under_pid(ki=0.0, static=1.0)
    starts = jnp.linspace(-0.02, 0.02, 9) * (1.0 - 1e-9)
    end = jax.vmap(lambda x: ss.simulate(loop, 0.0, 3.0, begin(loop, x)).y1.y.x)(starts)
    assert np.array_equal(end, starts)
    far = jax.vmap(lambda x: ss.simulate(loop, 0.0, 3.0, begin(loop, x)).y1.y)(
        jnp.linspace(0.1, 1.0, 9)
    )
    assert np.all(np.abs(far.x) <= 1.0 / 50.0)
    assert np.all(far.v_x == 0.0)
    assert np.ptp(np.asarray(far.x)) > 1e-4


def test_the_error_of_sampling_falls_with_the_period():
    """First order: output held for T_s is late by T_s/2 on average."""
    periods = np.array([0.004, 0.002, 0.001])
    ends = []
    for period in periods:
        loop = under_pid(period)
        ends.append(float(ss.simulate(loop, 0.0, 0.4, begin(loop)).y1.y.x))
    ratio = (ends[0] - ends[1]) / (ends[1] - ends[2])
    assert ratio == pytest.approx(2.0, abs=0.05)


@pytest.mark.more
def test_lanes_give_what_single_runs_give():
    def end(kp, period):
        loop = under_pid(period, kp)
        return ss.simulate(loop, 0.0, 0.5, begin(loop), throw=False).y1.y.x

    gains, periods = jnp.linspace(20.0, 80.0, 5), jnp.linspace(0.004, 0.011, 5)
    found = ss.map_lanes(end)(gains, periods)
    for x, kp, period in zip(found, gains, periods, strict=True):
        assert float(x) == pytest.approx(float(end(kp, period)), abs=1e-15)


@pytest.mark.more
def test_two_controllers_in_one_loop():
    """A velocity loop of 1 kHz in a position loop of 100 Hz, which is sampled behind it."""
    inner = WithController(Axis(), lambda k, t, m, s, a: (20.0 * (a.output - m.v_x), s), 0.001)
    outer = WithController(inner, lambda k, t, m, s, a: (-8.0 * m.y.x, s), 0.01)
    start = inner.start(Axis().state(x=0.1), args=Commanded(jnp.zeros(()), None))
    run = ss.simulate(outer, 0.0, 0.5, outer.start(start))
    x, v, wanted = 0.1, 0.0, 0.0
    for k in range(500):
        force = 20.0 * (wanted - v)
        wanted = -8.0 * x if k % 10 == 0 else wanted
        left = 0.001
        while left > 0.0 and not (v == 0.0 and abs(force) <= 1.5):
            a = force - np.sign(v if v != 0.0 else force)
            stops = v * a < 0.0 and -v / a < left
            step = -v / a if stops else left
            x, v, left = x + v * step + 0.5 * a * step * step, v + a * step, left - step
            v = 0.0 if stops else v
    assert float(run.y1.y.y.x) == pytest.approx(x, abs=1e-13)
    assert int(run.flags) == 0


@pytest.mark.more
@pytest.mark.parametrize("options", [{}, {"delay": 2, "latency": 0.003}], ids=["plain", "late"])
def test_a_run_that_is_cut_goes_on_as_if_it_were_not(options):
    """At samples, beside and between them, twice at one instant, and where the axis stops."""
    loop = under_pid(**options)

    def run(ends):
        y, mode, since, events = begin(loop), None, 0.0, 0
        for t in ends:
            part = ss.simulate(loop, since, t, y, mode, saveat=ss.SaveAt(max_events=1))
            y, mode, since, events = part.y1, part.mode1, t, events + int(part.num_events)
        return np.array([y.y.x, y.y.v_x, y.state.integral, y.output]), events

    whole, events = run([2.0])
    stop = ss.simulate(loop, 0.0, 2.0, begin(loop), saveat=ss.SaveAt(max_events=1)).events.t[0]
    between = np.sort(np.random.default_rng(0).uniform(0.0, 2.0, 5)).tolist()
    for ends in ([0.01, 0.5, 0.505], [0.3, 0.3 + 1e-12], [0.004, 1.003], between, [float(stop)]):
        found, met = run([*ends, 2.0])
        np.testing.assert_allclose(found, whole, rtol=0, atol=1e-13)
        assert met == events
