"""Next to grazing a derivative is right or the run is flagged, on both sides of the touch."""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.hybrid._loop_state import Plan
from stickslip.hybrid.status import GRAZING
from stickslip.systems import Motion

END = 5.0


class Grazing(ss.AbstractHybridSystem):
    """x'' = -x, and x'' = -x + A once x has passed the wall; x = A sin t until then."""

    wall: Any
    amplitude: Any

    mode_names: ClassVar = ("before", "behind")
    guard_names: ClassVar = ("passes the wall",)

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, -y.x + jnp.where(mode == 1, self.amplitude, 0.0))

    def guards(self, t, y, mode, args):
        return (jnp.where(mode == 0, self.wall - y.x, 1.0),)

    def transition(self, t, y, mode, guard, args):
        return y, 1

    def initial_mode(self, t, y, args):
        return 0


def exact(wall):
    """d x(END) / d wall for the amplitude 1."""
    angle = math.asin(wall)
    slope, rest = math.cos(angle), END - angle
    at_event = -math.sin(rest) * wall / slope - math.cos(rest) * slope / slope
    return math.cos(rest) + (wall - 1.0) * math.sin(rest) / slope + at_event


def with_derivative(amplitude):
    @jax.jit
    def run(wall):
        def end(wall):
            start = Motion(0.0, amplitude)
            done = ss.simulate(Grazing(wall, amplitude), 0.0, END, start, 0, throw=False)
            return done.y1.x, (done.num_events, done.flags)

        return jax.value_and_grad(end, has_aux=True)(wall)

    return run


@pytest.mark.parametrize("amplitude", [1.0, 1e-9])
def test_derivatives_next_to_grazing_are_right_or_flagged(amplitude):
    run = with_derivative(amplitude)
    for depth in 10.0 ** np.arange(-13.0, -2.9, 0.5):
        wall = 1.0 - depth
        (_, (events, flags)), slope = run(amplitude * wall)
        error = abs(float(slope) / exact(wall) - 1.0)
        assert int(flags) in (0, GRAZING)
        assert error < 1e-4 or int(flags), f"{depth} deep: {error}"
        assert not int(flags) or depth < 1.0001e-6, f"{depth} deep is flagged"
        # Depths below the tolerance of the motion are told by a flag at least.
        assert int(events) == 1 or (int(flags) and depth < 1e-10)


@pytest.mark.more
def test_steps_that_end_on_the_very_touch():
    """A look is led to where the guard may touch: the slope there is none, or rounding.

    The start is somewhere along the motion, so that the steps before the touch are all kinds.
    """
    rng = np.random.default_rng(1)
    depth = 10.0 ** np.concatenate([rng.uniform(-13, -12, 400), rng.uniform(-5.9, -3, 100)])
    angle = rng.uniform(0.0, 1.2, len(depth))

    @jax.jit
    @jax.vmap
    def run(wall, angle):
        start = Motion(jnp.sin(angle), jnp.cos(angle))
        done = ss.simulate(Grazing(wall, 1.0), 0.0, END, start, 0, throw=False)
        return done.num_events, done.flags

    events, flags = run(1.0 - depth, angle)
    assert np.all(flags[:400] == GRAZING)
    assert np.all(flags[400:] == 0)
    assert np.all(events[400:] == 1)


@pytest.mark.parametrize("amplitude", [1.0, 1e-9])
def test_runs_that_nearly_touch_are_flagged(amplitude):
    run = with_derivative(amplitude)
    for distance in 10.0 ** np.arange(-13.0, -2.9, 0.5):
        (_, (events, flags)), slope = run(amplitude * (1.0 + distance))
        assert int(events) == 0
        assert float(slope) == 0.0
        if distance < 1e-7:
            assert int(flags) == GRAZING, f"missed by {distance}"
        if distance > 0.9999e-6:
            assert int(flags) == 0, f"missed by {distance} is flagged"


@pytest.mark.more
def test_with_no_threshold_wrong_derivatives_go_unflagged(monkeypatch):
    monkeypatch.setattr(Plan, "touching", property(lambda self: 0.0))
    wall = 1.0 - 1e-10
    (_, (_, flags)), slope = with_derivative(1.0)(wall)
    assert abs(float(slope) / exact(wall) - 1.0) > 1e-3
    assert int(flags) == 0


@pytest.mark.more
def test_ordinary_stick_slip_is_not_flagged():
    from stickslip.systems import CoulombOscillator

    def flags(speed):
        block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, speed)
        return ss.simulate(block, 0.0, 60.0, Motion(0.0, speed), "stick", throw=False).flags

    assert not np.any(jax.jit(jax.vmap(flags))(jnp.linspace(0.02, 2.0, 100)))


class Clock(ss.AbstractHybridSystem):
    """x'' = -x, with a sample at `next` that changes nothing but the time of the next one."""

    mode_names: ClassVar = ("runs",)
    guard_names: ClassVar = ("sample",)

    def vector_field(self, t, y, mode, args):
        return {"x": y["v"], "v": -y["x"], "next": 0.0 * t}

    def guards(self, t, y, mode, args):
        return (y["next"] - t,)

    def transition(self, t, y, mode, guard, args):
        return {**y, "next": y["next"] + 0.01}, mode

    def initial_mode(self, t, y, args):
        return 0


@pytest.mark.more
def test_outputs_that_fall_on_a_steep_guard_are_no_touch():
    """A step ended at the time asked for, a rounding behind the guard, which then seemed to be flat."""
    system = Clock()
    times = ss.SaveAt(ts=jnp.asarray([6.77]))

    @jax.jit
    @jax.vmap
    def run(off):
        start = {"x": 0.1, "v": 0.2, "next": 6.77 + off}
        found = ss.simulate(system, 6.765, 6.775, start, saveat=times)
        return found.flags, found.num_events, found.y1["next"]

    off = jnp.asarray([0.0, *(s * 10.0**-k for s in (-1.0, 1.0) for k in range(10, 17))])
    flags, events, after = run(off)
    assert np.all(flags == 0)
    assert np.all(events == 1)
    np.testing.assert_allclose(after, 6.78 + off, rtol=1e-15)
