"""Ready controllers against their equations in NumPy, and what they are for."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.control import (
    PID,
    Cascade,
    DisturbanceObserver,
    FrictionFeedforward,
    InputShaper,
    ResetPID,
    WithController,
    encoder_reading,
    reading_noise,
)
from stickslip.systems import Motion
from tests.stickslip.control._axis import Axis, begin, under_pid

READINGS = np.random.default_rng(1).uniform(-1.0, 1.0, (30, 2))
T = 0.01


def outputs_of(controller):
    found, state = [], controller.state()
    for k, read in enumerate(READINGS):
        output, state = controller(k, k * T, read, state, None)
        found.append(float(output))
    return np.array(found)


@pytest.mark.parametrize("tracking", [None, 0.05])
def test_pid_with_a_limit(tracking):
    pid = PID(2.0, 80.0, 0.3, period=T, reference=0.4, limit=1.5, tracking_time=tracking)
    total, expected = 0.0, []
    for x, v in READINGS:
        error = 0.4 - x
        wound = total + 80.0 * T * error
        free = 2.0 * error + wound - 0.3 * v
        u = min(max(free, -1.5), 1.5)
        if tracking is not None:
            wound += T / tracking * (u - free)
        elif u != free and error * free > 0.0:
            wound = total
            u = min(max(2.0 * error + wound - 0.3 * v, -1.5), 1.5)
        total = wound
        expected.append(u)
    found = outputs_of(pid)
    assert np.allclose(found, expected, atol=1e-14)
    assert np.max(np.abs(found)) == 1.5


@pytest.mark.more
def test_without_anti_windup_a_limit_would_overshoot():
    ends = []
    for tracking_time in (None, 0.1, 1e9):
        pid = {"limit": 2.0, "tracking_time": tracking_time, "reference": 1.0}
        loop = under_pid(0.01, 50.0, 50.0, 10.0, 0.0, 0.0, pid)
        run = ss.simulate(
            loop, 0.0, 10.0, begin(loop, 0.0), saveat=ss.SaveAt(ts=jnp.linspace(0.0, 10.0, 201))
        )
        ends.append(float(jnp.max(run.outputs.y.y.x)) - 1.0)
    assert max(ends[:2]) < 0.2 * ends[2]


def test_cascade():
    def reference(t, args):
        return jnp.sin(t), jnp.cos(t)

    cascade = Cascade(3.0, PID(2.0, 40.0, 7.0, period=T, reference=reference))
    total, expected = 0.0, []
    for k, (x, v) in enumerate(READINGS):
        slow = np.cos(k * T) + 3.0 * (np.sin(k * T) - x) - v
        total += 40.0 * T * slow
        expected.append(2.0 * slow + total)
    assert np.allclose(outputs_of(cascade), expected, atol=1e-13)


@pytest.mark.more
def test_a_reset_integrator_rests_where_a_pid_hunts():
    pid = PID(50.0, 200.0, 10.0, period=T)
    moves = []
    for update in (pid, ResetPID(pid, 0.0)):
        loop = WithController(Axis(), update, T, update.state())
        times = jnp.linspace(20.0, 40.0, 401)
        run = ss.simulate(loop, 0.0, 40.0, begin(loop), saveat=ss.SaveAt(ts=times))
        moves.append(float(jnp.ptp(run.outputs.y.y.x)))
    assert moves[1] < 0.5 * moves[0]
    error, total, expected = 0.0, 0.0, []
    for x, v in READINGS:
        total = -0.5 * total if error * (0.1 - x) < 0.0 else total
        error = 0.1 - x
        total += 200.0 * T * error
        expected.append(50.0 * error + total - 10.0 * v)
    reset = ResetPID(PID(50.0, 200.0, 10.0, period=T, reference=0.1), -0.5)
    assert np.allclose(outputs_of(reset), expected, atol=1e-13)


@pytest.mark.more
def test_friction_added_along_the_reference_and_by_the_measured_speed():
    """Behind the reference the axis has 1 N of friction less to overcome; by its own speed it has no
    push at rest: 1.2 N of static friction hold it."""
    w = 0.5

    def reference(t, args):
        return w * t, w * jnp.ones(())

    def friction(speed):
        return 1.0 * jnp.tanh(speed / 1e-3)

    lags = []
    for along in (None, reference, "none"):
        pid = PID(40.0, 0.0, 10.0, period=T, reference=reference)
        update = pid if along == "none" else FrictionFeedforward(pid, friction, along)
        loop = WithController(Axis(1.2, 1.0), update, T, update.state())
        run = ss.simulate(loop, 0.0, 5.0, begin(loop, 0.0, w))
        lags.append(w * 5.0 - float(run.y1.y.x))
    assert lags[2] == pytest.approx(1.0 / 40.0, rel=0.01)
    assert abs(lags[1]) < 1e-4
    assert abs(lags[0]) < 1e-4
    update = FrictionFeedforward(PID(1.0, 0.0, 0.0, period=T, reference=0.5), friction)
    held = WithController(Axis(1.2, 1.0), update, T, update.state())
    assert float(ss.simulate(held, 0.0, 1.0, begin(held, 0.0)).y1.y.x) == 0.0


def test_a_disturbance_observer_takes_a_force_away():
    class Pushed(ss.AbstractSmoothSystem):
        units: ClassVar = {"x": "m", "v": "m/s"}

        def vector_field(self, t, y, mode, args):
            return Motion(x=y.v, v=(args.output + 3.0) / 2.0)

    pid = PID(80.0, 0.0, 25.0, period=T)
    ends = []
    for update in (pid, DisturbanceObserver(pid, 2.0, 20.0, period=T)):
        loop = WithController(Pushed(), update, T, update.state())
        ends.append(ss.simulate(loop, 0.0, 5.0, loop.start(Motion(0.0, 0.0))).y1)
    assert float(ends[0].y.x) == pytest.approx(3.0 / 80.0, rel=1e-4)
    assert float(ends[1].y.x) == pytest.approx(0.0, abs=1e-7)
    assert float(ends[1].state.output) == pytest.approx(-3.0, abs=1e-5)


@pytest.mark.more
@pytest.mark.parametrize("damping", [0.0, 0.2])
def test_a_shaped_reference_leaves_no_vibration(damping):
    """A mass behind a spring whose end jumps: at rest for good as soon as the reference is."""
    omega = 7.0
    step = InputShaper(lambda t, args: (jnp.where(t >= 0.05, 1.0, 0.0), 0.0), "ZV", omega, damping)
    half = np.pi / (omega * np.sqrt(1.0 - damping**2))

    class Spring(ss.AbstractSmoothSystem):
        units: ClassVar = {"x": "m", "v": "m/s"}

        def vector_field(self, t, y, mode, args):
            pull = omega**2 * (step(t, None)[0] - y.x)
            return Motion(x=y.v, v=pull - 2.0 * damping * omega * y.v)

    loaded = ss.WithBreaks(Spring(), [0.05, 0.05 + half])
    run = ss.simulate(loaded, 0.0, 0.05 + half, loaded.start(Motion(0.0, 0.0)))
    assert float(run.y1.y.x) == pytest.approx(1.0, abs=1e-9)
    assert float(run.y1.y.v) == pytest.approx(0.0, abs=1e-8)


RANGES = {
    "ZV": (0.968, 1.032), "MZV": (0.951, 1.055), "ZVD": (0.856, 1.144), "EI": (0.8, 1.2),
    "2HUMP_EI": (0.638, 1.362),
}  # fmt: skip


@pytest.mark.parametrize("kind", RANGES)
def test_what_a_shaper_leaves_is_the_sum_of_its_steps(kind):
    """In complex amplitudes, of a machine that it knows and of others; the published ranges of 5%."""
    shaper, omega = InputShaper(0.0, kind, 7.0, 0.1), np.array([4.0, 7.0, 9.0])
    assert float(np.sum(shaper.amplitudes)) == pytest.approx(1.0, abs=1e-15)
    rate = omega * (-0.02 + 1j * np.sqrt(1.0 - 0.02**2))
    left = np.zeros(3, complex)
    for part, since in zip(shaper.amplitudes, shaper.times[-1] - shaper.times, strict=True):
        left += float(part) * np.exp(rate * float(since))
    np.testing.assert_allclose(shaper.residual(omega, 0.02), np.abs(left), rtol=1e-12)
    many = InputShaper(lambda t, args: (t, 1.0), kind, np.array([7.0, 9.0]), 0.1)
    alone = [InputShaper(lambda t, args: (t, 1.0), kind, w, 0.1)(1.0, None)[0] for w in (7.0, 9.0)]
    np.testing.assert_allclose(many(1.0, None)[0], alone, rtol=1e-14)
    place = shaper(0.0, None)[0]
    assert float(place) == 0.0
    low, high = RANGES[kind]
    plain = InputShaper(0.0, kind, 1.0)
    assert np.all(plain.residual(np.linspace(low + 5e-4, high - 5e-4, 400)) <= 0.05 + 1e-12)
    assert np.all(plain.residual(np.array([low - 1e-3, high + 1e-3])) > 0.05)
    assert float(plain.residual(1.0)) == pytest.approx(0.05 if kind == "EI" else 0.0, abs=1e-12)
    knows = float(shaper.residual(7.0, 0.1))
    assert knows == pytest.approx(0.0, abs=1e-12) if kind in ("ZV", "ZVD", "MZV") else knows < 0.06
    # Of a step in parts, each with a vibration of its own, by when they come.
    t = np.linspace(0.0, 4.0, 40_001)
    since = np.maximum(t[:, None] - np.asarray(shaper.times), 0.0)
    for damping in (0.0, 0.02):
        rates = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
        waves = np.exp(rates[:, None, None] * since) * (1.0 + 1j * damping / np.sqrt(1.0 - damping**2))
        reached = np.max((1.0 - waves.real) @ np.asarray(shaper.amplitudes), axis=1)
        peak = np.asarray(shaper.peak(omega, damping))
        assert np.all(reached <= peak * (1.0 + 1e-9))
        assert np.all(reached > (0.9 if damping else 1.0 - 1e-6) * peak)
        assert damping > 0.0 or np.allclose(peak, 1.0 + shaper.residual(omega), rtol=1e-12)


def test_readings():
    assert np.allclose(encoder_reading(np.array([0.26, -0.26, 0.25]), 0.5), [0.5, -0.5, 0.5])
    assert float(jax.grad(lambda x: encoder_reading(x, 0.5))(0.3)) == 0.0
    noise = np.array([reading_noise(3, k) for k in range(400)])
    assert noise[7] == reading_noise(3, 7)
    assert noise[7] != reading_noise(4, 7)
    assert abs(np.mean(noise)) < 0.15
    assert np.std(noise) == pytest.approx(1.0, abs=0.1)
