"""Errors planted on purpose: each must move the numbers the other tests look at, far beyond tolerance.

The engine is traced anew for each fault (another `max_steps` is another program).
"""

import itertools
from typing import ClassVar

import jax
import jax.numpy as jnp
import pytest

import stickslip as ss
from stickslip.hybrid import _attempt, _event_decision
from tests.stickslip.hybrid._accuracy import set_accuracy
from tests.stickslip.hybrid._systems import State, StickSlip, stick_slip_motion

V = 0.2
RELEASE = 1.0 / V
SLOPE = 16.2232182593  # d x(30)/d v in closed form
_programs = itertools.count(7000)


def x_and_slope(system=StickSlip):
    """x(30), its derivative by the belt speed, and the time of the second event."""
    integrator = ss.Integrator("tsit5", ss.FixedStep(0.05), max_steps=next(_programs))

    def end(v):
        run = ss.simulate(system(v), 0.0, 30.0, State(0.0 * v, v), 0, integrator=integrator)
        return run.y1.x, run.events.t[1]

    (x, time), (slope, _) = jax.jvp(end, (V,), (1.0,))
    return float(x), float(slope), float(time)


def errors(**kwargs):
    x, slope, time = x_and_slope(**kwargs)
    exact, times = stick_slip_motion(30.0, V)
    return abs(x - exact), abs(slope - SLOPE), abs(time - times[1])


def test_without_a_fault():
    x, slope, time = errors()
    assert x < 1e-8
    assert slope < 1e-6
    assert time < 1e-9


@pytest.mark.more
def test_no_saltation(monkeypatch):
    """The event time is not differentiated: the value stays, the derivative does not."""

    real = _attempt.event_delay

    def event_delay(*operands):
        return jax.lax.stop_gradient(real(*operands))

    monkeypatch.setattr(_attempt, "event_delay", event_delay)
    x, slope, _ = errors()
    assert x < 1e-8
    assert slope > 1.0


@pytest.mark.more
def test_event_by_linear_interpolation(monkeypatch):
    """The first attempt past the guard is accepted after one linear correction."""
    set_accuracy(monkeypatch, solved=1e3, reach=1e3)
    _, _, time = errors()
    assert time > 1e-5


def test_wrong_guard_direction():
    class Wrong(StickSlip):
        guard_directions: ClassVar = ("falling", "rising")

        def guards(self, t, y, mode, args):
            stick, slip = super().guards(t, y, mode, args)
            return stick, jnp.where(mode == 0, -1.0, slip)

    run = ss.simulate(
        Wrong(V), 0.0, 30.0, State(0.0, V), 0, throw=False,
        integrator=ss.Integrator("tsit5", ss.FixedStep(0.05), max_steps=next(_programs)),
    )  # fmt: skip
    assert abs(float(run.y1.x) - stick_slip_motion(30.0, V)[0]) > 1e-3


def test_kinetic_instead_of_static_threshold():
    class Wrong(StickSlip):
        def guards(self, t, y, mode, args):
            _, slip = super().guards(t, y, mode, args)
            return jnp.where(mode == 0, self.kinetic_force - y.x, 1.0), slip

    x, _, time = errors(system=Wrong)
    assert x > 1e-3
    assert not time < 1e-3  # NaN: without a drop of the force the block never sticks again


@pytest.mark.more
@pytest.mark.parametrize("part", ["value", "rate"])
def test_a_guard_evaluated_with_the_wrong_sign(monkeypatch, part):
    """Wrong values make another motion; with wrong rates every event looks like grazing."""
    real = _event_decision.lowest

    def lowest(*operands):
        first = real(*operands)
        return first._replace(**{part: -getattr(first, part)})

    def run():
        integrator = ss.Integrator("tsit5", ss.FixedStep(0.05), max_steps=next(_programs))
        run = ss.simulate(StickSlip(V), 0.0, 30.0, State(0.0, V), 0, integrator=integrator, throw=False)
        return abs(float(run.y1.x) - stick_slip_motion(30.0, V)[0]), int(run.flags)

    error, flags = run()
    assert error < 1e-8
    assert flags == 0
    monkeypatch.setattr(_attempt, "lowest", lowest)
    error, flags = run()
    assert error > 1e-3 if part == "value" else flags != 0
