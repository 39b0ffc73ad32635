"""Systems with known attractors for orbit diagrams."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

import stickslip as ss


class Rotor(NamedTuple):
    u: Any
    v: Any


class HopfOscillator(ss.AbstractSmoothSystem):
    r"""$\dot u = \mu u - v - u r^2$, $\dot v = u + \mu v - v r^2$: a circle of radius $\sqrt\mu$."""

    mu: Any
    units: ClassVar = {"u": "m", "v": "m"}

    def vector_field(self, t, y, mode, args):
        s = self.mu - y.u * y.u - y.v * y.v
        return Rotor(s * y.u - y.v, y.u + s * y.v)

    def gap(self, t, y, mode, args=None):
        """Distance to a wall at u = -1.1."""
        return y.u + 1.1


class Level(NamedTuple):
    x: Any
    c: Any  # phase of a clock that gives one section a time unit
    s: Any


def beside_clock(slope, y):
    """Rates of a `Level` whose x has this one."""
    return Level(slope, -2.0 * jnp.pi * y.s, 2.0 * jnp.pi * y.c)


class Hysteresis(ss.AbstractSmoothSystem):
    r"""$\dot x = p + x - x^3$: two branches between $p = \mp 2/(3\sqrt 3)$, jumps at those ends."""

    p: Any

    def vector_field(self, t, y, mode, args):
        return beside_clock(self.p + y.x - y.x * y.x * y.x, y)


class Quadratic(ss.AbstractSmoothSystem):
    r"""$\dot x = p x^2$: finite for p = 0, else infinite at $t = 1/(p x_0)$."""

    p: Any

    def vector_field(self, t, y, mode, args):
        return beside_clock(self.p * y.x * y.x, y)


class Driven(NamedTuple):
    x: Any
    v: Any
    c: Any  # cos and sin of the drive's phase
    s: Any


class DoubleWell(ss.AbstractSmoothSystem):
    r"""$\ddot x + 0.3\dot x - x + x^3 = f\cos 1.2t$, the driven beam between magnets.

    A well-known cascade (textbooks; Wikipedia, "Duffing equation"): period 1 of the drive at
    f = 0.20, 2 at 0.28, 4 at 0.29, 5 at 0.37, chaos at 0.50, 2 at 0.65.
    """

    f: Any

    def vector_field(self, t, y, mode, args):
        force = y.x - y.x**3 - 0.3 * y.v + self.f * y.c
        return Driven(y.v, force, -1.2 * y.s, 1.2 * y.c)

    def far(self, t, y, mode, args=None):
        """x in hundredths, a million away."""
        return 1e6 + 0.01 * y.x
