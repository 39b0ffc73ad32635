"""Systems with known attractors for orbit diagrams."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

import stickslip as ss


class Rotor(NamedTuple):
    u: Any
    v: Any


class HopfOscillator(ss.AbstractHybridSystem):
    r"""$\dot u = \mu u - v - u r^2$, $\dot v = u + \mu v - v r^2$: a circle of radius $\sqrt\mu$."""

    mu: Any
    mode_names: ClassVar = ("motion",)
    guard_names: ClassVar = ()
    units: ClassVar = {"u": "m", "v": "m"}

    def vector_field(self, t, y, mode, args):
        s = self.mu - y.u * y.u - y.v * y.v
        return Rotor(s * y.u - y.v, y.u + s * y.v)

    def guards(self, t, y, mode, args):
        return ()

    def transition(self, t, y, mode, guard, args):
        return y, mode

    def initial_mode(self, t, y, args):
        return jnp.zeros((), jnp.int32)

    def gap(self, t, y, mode, args=None):
        """Distance to a wall at u = -1.1."""
        return y.u + 1.1


class Level(NamedTuple):
    x: Any
    c: Any  # phase of a clock that gives one section a time unit
    s: Any


class Hysteresis(ss.AbstractHybridSystem):
    r"""$\dot x = p + x - x^3$: two branches between $p = \mp 2/(3\sqrt 3)$, jumps at those ends."""

    p: Any
    mode_names: ClassVar = ("motion",)
    guard_names: ClassVar = ()

    def vector_field(self, t, y, mode, args):
        rate = 2.0 * jnp.pi
        return Level(self.p + y.x - y.x * y.x * y.x, -rate * y.s, rate * y.c)

    def guards(self, t, y, mode, args):
        return ()

    def transition(self, t, y, mode, guard, args):
        return y, mode

    def initial_mode(self, t, y, args):
        return jnp.zeros((), jnp.int32)


class BlowUp(NamedTuple):
    x: Any
    c: Any
    s: Any


class Quadratic(ss.AbstractHybridSystem):
    r"""$\dot x = p x^2$: finite for p = 0, else infinite at $t = 1/(p x_0)$."""

    p: Any
    mode_names: ClassVar = ("motion",)
    guard_names: ClassVar = ()

    def vector_field(self, t, y, mode, args):
        rate = 2.0 * jnp.pi
        return BlowUp(self.p * y.x * y.x, -rate * y.s, rate * y.c)

    def guards(self, t, y, mode, args):
        return ()

    def transition(self, t, y, mode, guard, args):
        return y, mode

    def initial_mode(self, t, y, args):
        return jnp.zeros((), jnp.int32)
