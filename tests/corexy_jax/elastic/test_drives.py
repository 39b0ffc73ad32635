"""Steppers and their windings, servo drives, microsteps, teeth that jump, a printer of parts."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import corexy_jax as cx
import stickslip as ss
from corexy_jax.elastic import (
    DCMotors,
    ElasticCoreXY,
    Spans,
    Stepper,
    Winding,
    desktop_printer,
    microsteps,
    resonances,
    tooth_jump,
    trajectory,
)
from stickslip.control import PID, Cascade, InputShaper, Integral, WithController
from tests.corexy_jax.elastic._run import FRICTIONLESS, ROWS, Still, belts

P, R = cx.CoreXYParameters(**FRICTIONLESS), 0.05
N, T_M, J = 50, 4.0, 1e-3


class Lines(NamedTuple):
    """Lengths of belt line [m] and their rates."""

    one: Any
    two: Any
    v_one: Any
    v_two: Any


class Rotors(ss.AbstractSmoothSystem):
    """The motors of a machine alone, the first under a load [N m]."""

    parameters: cx.CoreXYParameters
    drive: Stepper
    load: Any

    def vector_field(self, t, y, mode, args):
        r, J = self.parameters.r, self.parameters.J
        torques = self.drive(t, (y.one / r, y.two / r), (y.v_one / r, y.v_two / r), args)
        return Lines(y.v_one, y.v_two, r / J * (torques[0] - self.load), r / J * torques[1])


@jax.jit
def _turn(rotors, y0, ts):
    return ss.simulate(
        rotors, 0.0, ts[-1], y0, saveat=ss.SaveAt(ts=ts),
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-10, 1e-15)),
    )  # fmt: skip


def alone(load, lag, t1, *, v=0.0, torque=T_M, p=P, **given):
    """A run of the motors from a lag [rad] of the first; its lag and what it lost at the end."""
    r = float(p.r)
    stepper = Stepper(Still(vx=v * r), torque, r, **given)
    y0 = (-lag * r, 0.0, v * r, v * r)
    given = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), (Rotors(p, stepper, load), Lines(*y0)))
    found = _turn(*given, jnp.linspace(0.0, t1, ROWS))
    angles = found.y1.one / r, found.y1.two / r
    return found, float(stepper.lags(t1, angles)[0]), float(stepper.lost_steps(t1, angles)[0])


@pytest.mark.parametrize("load", [0.0, 2.5])
def test_a_motor_alone_vibrates_with_the_stiffness_of_its_field(load):
    rest, start = np.arcsin(load / T_M) / N, 1e-7
    found, _, _ = alone(load, rest + start, 0.05)
    omega = np.sqrt(N * np.sqrt(T_M**2 - load**2) / J)
    lag = -np.asarray(found.outputs.y.one) / R - rest
    np.testing.assert_allclose(
        lag, start * np.cos(omega * np.linspace(0.0, 0.05, ROWS)), atol=1e-4 * start
    )


def test_it_falls_out_of_step_at_its_torque_and_under_a_sudden_load_before():
    """Beyond the top of the sine, and from rest at the command where its energy takes it so far."""
    top = 0.5 * np.pi / N
    kept, gone = (alone(share * T_M, top, 0.5, damping=0.05)[1:] for share in (0.999, 1.001))
    assert kept == (pytest.approx(np.arcsin(0.999) / N, abs=1e-6), 0.0)
    assert gone[1] >= 4.0
    assert gone[1] % 4.0 == 0.0

    def left(
        share,
    ):  # of the energy, at the angle beyond the top where the load is as great as the field
        far = np.pi - np.arcsin(share)
        return share * far - (1.0 - np.cos(far))

    sudden = scipy.optimize.brentq(left, 0.5, 0.9)
    assert alone((sudden - 1e-3) * T_M, 0.0, 0.5)[2] == 0.0
    assert alone((sudden + 1e-3) * T_M, 0.0, 0.5)[2] >= 4.0


WINDING = Winding(24.0, 1.7, 1.5, 2.8e-3)


def test_pull_out_is_the_greatest_of_the_phasors():
    """Both windings in steady state, over the angle of the voltage."""
    stepper = Stepper(Still(), 0.28, R, winding=WINDING)
    K, angle = 0.28 / 1.7, np.exp(1j * np.linspace(-np.pi, np.pi, 20001))
    for speed in (0.0, 40.0, 95.0, 100.0, 300.0, -300.0, 2e3):
        current = (24.0 * angle - K * abs(speed)) / (1.5 + 1j * N * 2.8e-3 * abs(speed))
        truth = min(0.28, np.max(K * current.real))
        assert float(stepper.pull_out(speed)) == pytest.approx(truth, rel=1e-7)
    assert float(Stepper(Still(), 0.28, R).pull_out(2e3)) == 0.28
    weak = Stepper(Still(), 0.28, R, winding=Winding(3.0, 1.7, 1.5, 0.0))
    assert float(weak.pull_out(3.0 / K)) == pytest.approx(0.0, abs=1e-15)
    assert float(weak.pull_out(4.0 / K)) == 0.0


@pytest.mark.more
def test_a_limited_voltage_takes_its_torque_and_sets_the_margin():
    p, speed = cx.CoreXYParameters(J=5.5e-6), 150.0
    K, Z = 0.28 / 1.7, np.hypot(1.5, N * 2.8e-3 * speed)
    torque, lag = K * 24.0 / Z - K**2 * 1.5 * speed / Z**2, np.arcsin(0.99) / N
    assert 0.0 < torque < 0.9 * 0.28
    given = {"v": speed, "torque": 0.28, "p": p, "winding": WINDING}
    found, *kept = alone(0.99 * torque, lag, 0.3, **given)
    assert kept == [pytest.approx(lag, abs=1e-7), 0.0]
    assert alone(1.01 * torque, lag, 0.3, **given)[2] >= 4.0
    margin, other = Stepper(Still(vx=speed * R), 0.28, R).margin(0.3, (found.y1.one / R, 0.0))
    assert float(margin) == pytest.approx(np.arccos(0.99) / (0.5 * np.pi), abs=1e-5)
    assert float(other) == pytest.approx(1.0 - 45.0 / (0.5 * np.pi / N))


@pytest.mark.more
def test_losses_of_four_steps_are_events_of_a_run():
    stepper = Stepper(Still(vx=90.0 * R), T_M, R, damping=0.05)
    system = ss.WithBreaks(Rotors(P, stepper, 1.0), [0.25])
    saved = ss.SaveAt(sections=stepper.sections, max_crossings=1000)
    motion = ss.simulate(system, 0.0, 0.5, system.start(Lines(0.0, 0.0, 0.0, 0.0)), saveat=saved)
    lost = stepper.lost_steps(0.5, (motion.y1.y.one / R, motion.y1.y.two / R))
    for motor, crossings in enumerate(motion.crossings):
        times = np.asarray(crossings.t)
        count = np.isfinite(times).sum()
        assert 4.0 * count == float(lost[motor]) > 40.0
        angle = np.asarray((crossings.y.y.one, crossings.y.y.two)[motor])[:count] / R
        turns = N * (90.0 * times[:count] - angle) / (2.0 * np.pi)
        np.testing.assert_allclose(turns, np.arange(count) + 0.5, atol=1e-9)
    assert [section.name[:7] for section in stepper.sections] == ["motor 1", "motor 2"]


@pytest.mark.more
def test_a_servo_drive_is_the_linear_loop_that_samples():
    """Voltages from a cascade on both motor angles, against matrix exponentials."""
    period, target, k_x, kp, ki = 2e-3, np.array([1e-5, -2e-5]), 20.0, 0.4, 3.0

    def aim(t, args):
        return jnp.asarray(target), jnp.zeros(2)

    def read(t, y, args):
        return jnp.stack([y.one, y.two]) / R, jnp.stack([y.v_one, y.v_two]) / R

    cascade = Cascade(k_x, PID(kp, ki, 0.0, period=period, reference=aim))
    machine = ElasticCoreXY(P, belts(1e5, 1e-3), DCMotors(lambda t, args: args.output, P))
    loop = WithController(machine, cascade, period, Integral(jnp.zeros(2)), measure=read)
    times = period * (np.arange(60) + 0.5)
    motion = ss.simulate(
        loop, 0.0, times[-1], loop.start(machine.at()), saveat=ss.SaveAt(ts=times),
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-10, 1e-15)),
    )  # fmt: skip
    mass = np.diag([0.5 + 8 * 0.2, 1.5 + 4 * 0.2, 0.4, 0.4])
    g = np.array([[-1.0, -1.0, 1.0, 0.0], [-1.0, 1.0, 0.0, 1.0]])
    elastic = 1e5 * g.T @ g
    drag = 1e-3 * elastic + np.diag([0.0, 0.0, 1.0, 1.0]) * 2.0 / 0.9 * 0.03 / R**2
    field, pull = np.zeros((10, 10)), np.zeros((4, 2))
    pull[2:] = 2.0 / 0.9 / R * np.eye(2)
    field[:4, 4:8] = np.eye(4)
    field[4:8] = np.linalg.solve(mass, np.hstack([-elastic, -drag, pull]))
    half, state, integral, truth = (
        scipy.linalg.expm(0.5 * period * field),
        np.zeros(10),
        np.zeros(2),
        [],
    )
    for _ in times:
        off = k_x * (target - state[2:4] / R) - state[6:8] / R
        integral = integral + ki * period * off
        state[8:] = kp * off + integral
        truth.append(half @ state)
        state = half @ truth[-1]
    truth = np.array(truth)
    scale = np.abs(truth[:, :4]).max()
    for i, name in enumerate(("x", "y", "one", "two")):
        np.testing.assert_allclose(getattr(motion.outputs.y.y, name), truth[:, i], atol=1e-5 * scale)


@pytest.mark.more
def test_microsteps_are_the_path_rounded():
    path = trajectory(
        [[0.0, 0.0], [0.013, 0.004], [0.01, -0.003]], 0.1, acceleration=3.0, corner_speed=5e-3
    )
    shaper = InputShaper(path, "ZV", 2.0 * np.pi * 50.0)
    # Parts that come a piece later: their breaks meet those of the path.
    alike = InputShaper(path, "ZV", np.pi / float(path.times[1]))
    assert np.min(np.diff(path.breaks(alike))) == 0.0
    quantum = 2.0 * np.pi / 3200
    for smooth in (path, shaper, alike):
        breaks = path.breaks(None if smooth is path else smooth)
        found = microsteps(smooth, breaks, 0.006)
        t = np.random.default_rng(0).uniform(-0.1, float(breaks[-1]) + 0.1, 4000)

        def turned(path, t=t):
            (x, y), v = jax.vmap(lambda t: path(t, None))(jnp.asarray(t))
            return np.stack([x + y, x - y]) / 0.006, v

        (exact, _), (rounded, v) = turned(smooth), turned(found)
        np.testing.assert_allclose(
            rounded, quantum * np.floor(exact / quantum + 0.5), atol=1e-9 * quantum
        )
        assert not np.any(v)
        assert np.all(np.diff(found.breaks()) > 0.0)
    coarse = microsteps(path, path.breaks(), 0.006, division=1, steps=4)
    corner = 2.0 * np.pi / 4
    assert set(np.unique(np.round(turned(coarse)[0] / corner, 9))) == {0.0, 1.0, 2.0}
    with pytest.raises(ValueError, match=r"path = .* quadratic in time"):
        microsteps(lambda t, args: ((jnp.sin(t), 0.0 * t), (0.0, 0.0)), [0.0, 3.0], 0.006)


@pytest.mark.more
def test_a_motor_in_full_steps_rests_at_the_nearest():
    path = trajectory([[0.0, 0.0], [0.013, 0.002]], 0.1, acceleration=3.0, corner_speed=5e-3)
    found = microsteps(path, path.breaks(), R, division=1)
    system = ss.WithBreaks(Rotors(P, Stepper(found, T_M, R, damping=0.3), 0.0), found.breaks())
    end = ss.simulate(system, 0.0, 0.5, system.start(Lines(0.0, 0.0, 0.0, 0.0))).y1.y
    step = 2.0 * np.pi / 200
    for line, whole in ((end.one, 0.015), (end.two, 0.011)):
        assert float(line) / R == pytest.approx(step * round(whole / R / step), abs=1e-7)


def test_teeth_jump_where_the_tensions_part():
    machine = ElasticCoreXY(P, belts(1e5))
    stretches = jnp.asarray([0.0, 1e-4, -3e-4, 2e-4])
    states = machine.at()._replace(two=stretches)
    states = jax.tree.map(lambda a: jnp.broadcast_to(a, (4,)), states)
    tensions = jax.vmap(machine.tensions)(states)
    found = tooth_jump(tensions, 50.0)
    assert (found.pulley, found.row) == (2, 2)
    assert found.margin == pytest.approx(1.0 - 1e5 * 3e-4 / 50.0, rel=1e-12)
    _, _, two_a, two_b = machine.belts.frame.lengths(0.0, 0.0)
    # A span gives by the part of the stiffness that it has, the greater the shorter it is.
    assert found.span == "two_b"
    assert found.tension == pytest.approx(20.0 - 20.0 * float(two_a / (two_a + two_b)), rel=1e-12)
    slack = tooth_jump(Spans(30.0, 15.0, 0.0, 45.0), 40.0)
    assert slack == (1.0 - 45.0 / 40.0, 2, 0, 0.0, "two_a")


def test_the_printer_is_made_of_its_parts():
    parameters, belts, torque, winding = desktop_printer()
    assert 2.0 * np.pi * float(parameters.r) == pytest.approx(20 * 2e-3, rel=1e-12)
    assert float(parameters.K_t * winding.current) == pytest.approx(torque, rel=1e-12)
    for corner in (0.125, -0.125):
        assert min(belts.frame.lengths(corner, corner)) > 0.05
    low, next_low = resonances(parameters, belts, holding=N * torque).frequencies[:2]
    assert 40.0 < float(low) < float(next_low) < 120.0
