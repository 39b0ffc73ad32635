"""Small systems for the engine's tests; their answers are known in closed form."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

import stickslip as ss


class State(NamedTuple):
    """Displacement and speed."""

    x: Any
    v: Any


class StickSlip(ss.AbstractHybridSystem):
    """Block on belt, m = k = 1: x' = v_b until x = F_s; x'' = -x + F_k until x' = v_b."""

    belt_speed: Any
    static_force: Any = 1.0
    kinetic_force: Any = 0.5

    mode_names: ClassVar = ("stick", "slip")
    guard_names: ClassVar = ("breaks loose", "sticks")
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return State(y.v, jnp.where(mode == 0, 0.0, self.kinetic_force - y.x))

    def guards(self, t, y, mode, args):
        stick = mode == 0
        return (
            jnp.where(stick, self.static_force - y.x, 1.0),
            jnp.where(stick, 1.0, self.belt_speed - y.v),
        )

    def transition(self, t, y, mode, guard, args):
        return State(y.x, jnp.asarray(self.belt_speed)), 1 - mode

    def initial_mode(self, t, y, args):
        return jnp.where(y.v == self.belt_speed, 0, 1)


def stick_slip_motion(t, v, fs=1.0, fk=0.5):
    """x(t), event times and modes of `StickSlip` from x = 0 in stick, in NumPy."""
    now, x, times = 0.0, 0.0, []
    while True:
        stuck = (fs - x) / v
        if now + stuck >= t:
            return x + v * (t - now), np.array(times)
        now += stuck
        times.append(now)
        a = fs - fk
        slipping = 2 * np.pi - 2 * np.arctan(a / v)
        if now + slipping >= t:
            return fk + a * np.cos(t - now) + v * np.sin(t - now), np.array(times)
        now += slipping
        times.append(now)
        x = fk + a * np.cos(slipping) + v * np.sin(slipping)


class Flight(ss.AbstractHybridSystem):
    """Uniform acceleration `a`; a guard `floor(t, x) = x - slope t - curvature t^2/2` that reverses
    the speed relative to nothing: v -> -e v. Curved in time where `curvature` is not zero."""

    acceleration: Any = -1.0
    restitution: Any = 0.5
    slope: Any = 0.0
    curvature: Any = 0.0

    mode_names: ClassVar = ("flight",)
    guard_names: ClassVar = ("floor",)

    def vector_field(self, t, y, mode, args):
        return State(y.v, self.acceleration + 0.0 * y.x)

    def guards(self, t, y, mode, args):
        return (y.x - self.slope * t - 0.5 * self.curvature * t * t,)

    def transition(self, t, y, mode, guard, args):
        return State(y.x, -self.restitution * y.v), mode

    def initial_mode(self, t, y, args):
        return 0


class Pendulum(ss.AbstractSmoothSystem):
    """x'' = -sin x, no events: a smooth nonlinear system."""

    def vector_field(self, t, y, mode, args):
        return State(y.v, -jnp.sin(y.x))


class Circle(ss.AbstractHybridSystem):
    """x'' = -x; counts where x falls below `level` (mode 1: below, 0: above), motion unchanged.

    From x = 1, v = 0: x = cos t. The guard of mode 0 is `x - level`, that of mode 1 `level - x`.
    """

    level: Any = 0.0
    frequency: Any = 1.0

    mode_names: ClassVar = ("above", "below")
    guard_names: ClassVar = ("falls", "rises")

    def vector_field(self, t, y, mode, args):
        return State(y.v, -self.frequency * self.frequency * y.x)

    def guards(self, t, y, mode, args):
        above = mode == 0
        return jnp.where(above, y.x - self.level, 1.0), jnp.where(above, 1.0, self.level - y.x)

    def transition(self, t, y, mode, guard, args):
        return y, 1 - mode

    def initial_mode(self, t, y, args):
        return jnp.where(y.x >= self.level, 0, 1)


class Parabola(Circle):
    """x'' = 1: the steps are exact, whatever their length."""

    def vector_field(self, t, y, mode, args):
        return State(y.v, 1.0 + 0.0 * y.x)


def fixed(h, method="dop853", **kwargs):
    """Integrator with fixed steps."""
    return ss.Integrator(method=method, step=ss.FixedStep(h), max_steps=2000, **kwargs)
