"""Systems with known periodic orbits, written here from their equations."""

import functools
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, continue_orbit, periodic_orbit


def whole_turn(system):
    """Period of a forcing of frequency 1."""
    return 2 * jnp.pi


def of_frequency(system):
    """Period of a forcing of the system's frequency."""
    return 2 * jnp.pi / system.frequency


def half_turn(system):
    """Period of the square of a forcing of frequency 0.92."""
    return jnp.pi / 0.92


class Motion(NamedTuple):
    x: Any
    v: Any


class WeakeningBlock(ss.AbstractHybridSystem):
    r"""Block on a belt, $\ddot x = -x - c\dot x + 1/(1 + 3(v_b - \dot x))$; sticks up to $x + cv = 1$.

    Leine, Van Campen, De Kraker, Van den Steen, Nonlinear Dynamics 16 (1998), with a dashpot.
    """

    belt_speed: Any
    damping: Any
    mode_names: ClassVar = ("stick", "slip")
    guard_names: ClassVar = ("release", "stop")
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        friction = 1.0 / (1.0 + 3.0 * (self.belt_speed - y.v))
        return Motion(y.v, jnp.where(mode == 0, 0.0, friction - y.x - self.damping * y.v))

    def guards(self, t, y, mode, args):
        stick = mode == 0
        return (
            jnp.where(stick, 1.0 - y.x - self.damping * y.v, 1.0),
            jnp.where(stick, 1.0, self.belt_speed - y.v),
        )

    def transition(self, t, y, mode, guard, args):
        holds = y.x + self.damping * self.belt_speed < 1.0
        return Motion(y.x, self.belt_speed + 0.0 * y.v), jnp.where((guard == 1) & holds, 0, 1)

    def initial_mode(self, t, y, args):
        return jnp.where(y.v == self.belt_speed, 0, 1)


class ForcedBlock(ss.AbstractHybridSystem):
    r"""$\ddot x + x = C(1 - \dot x) + F\cos\omega t$, $C(u) = 1.5\,\mathrm{sgn} u - 1.5u + 0.45u^3$.

    Yoshitake, Sueoka; the example of SlideCont. Modes: slower than the belt, with it, faster.
    """

    amplitude: Any
    frequency: Any
    mode_names: ClassVar = ("backward", "stick", "forward")
    guard_names: ClassVar = ("release down", "release up", "stop")
    units: ClassVar = {"x": "m", "v": "m/s"}

    def load(self, t):
        return self.amplitude * jnp.cos(self.frequency * t)

    def time_scale(self, args):
        return 1.0 / self.frequency

    def vector_field(self, t, y, mode, args):
        u = 1.0 - y.v
        sign = 1.0 - 1.0 * jnp.asarray(mode, jnp.float64)
        slip = -y.x + 1.5 * sign - 1.5 * u + 0.45 * u**3 + self.load(t)
        return Motion(y.v, jnp.where(mode == 1, 0.0, slip))

    def guards(self, t, y, mode, args):
        held, stick = y.x - self.load(t), mode == 1
        sign = 1.0 - 1.0 * jnp.asarray(mode, jnp.float64)
        return (
            jnp.where(stick, 1.5 - held, 1.0),
            jnp.where(stick, 1.5 + held, 1.0),
            jnp.where(stick, 1.0, sign * (1.0 - y.v)),
        )

    def transition(self, t, y, mode, guard, args):
        held = y.x - self.load(t)
        after = jnp.where(held > 1.5, 0, jnp.where(held < -1.5, 2, 1))
        after = jnp.where(guard == 0, 0, jnp.where(guard == 1, 2, after))
        return Motion(y.x, 1.0 + 0.0 * y.v), after.astype(jnp.int32)

    def initial_mode(self, t, y, args):
        held = y.x - self.load(t)
        at = jnp.where(held > 1.5, 0, jnp.where(held < -1.5, 2, 1))
        return jnp.where(y.v < 1.0, 0, jnp.where(y.v > 1.0, 2, at)).astype(jnp.int32)


class Sliding(NamedTuple):
    x: Any
    v: Any
    u: Any


class CocoStickSlip(ss.AbstractHybridSystem):
    r"""`stickslip` of COCO (Dankowicz, Schilder, Recipes for Continuation, examples 9.3, 9.4).

    $F = V^2\sin^2 wt/(1 - x)^2 - c\dot x - x$. Stick: $\ddot x = F$. Slip with speed $u$:
    $\dot u = -n - F/5$, $\ddot x = n + 6F/5$ until $u = 0$. Stop at $x = 1/2$: $u = (1 + e)\dot x/6$,
    $\dot x \to -e\dot x$.
    """

    voltage: Any
    mode_names: ClassVar = ("stick", "slip")
    guard_names: ClassVar = ("impact", "stop")
    units: ClassVar = {"x": "1", "v": "1", "u": "1"}

    def time_scale(self, args):
        return 1.0 / 0.92

    def vector_field(self, t, y, mode, args):
        force = (self.voltage * jnp.sin(0.92 * t) / (1.0 - y.x)) ** 2 - 0.04 * y.v - y.x
        stick = mode == 0
        return Sliding(
            y.v, jnp.where(stick, force, 3.17 + 1.2 * force), jnp.where(stick, 0.0, -3.17 - 0.2 * force)
        )

    def guards(self, t, y, mode, args):
        stick = mode == 0
        return jnp.where(stick, 0.5 - y.x, 1.0), jnp.where(stick, 1.0, y.u)

    def transition(self, t, y, mode, guard, args):
        impact = guard == 0
        after = Sliding(
            y.x, jnp.where(impact, -0.8 * y.v, y.v), jnp.where(impact, 0.3 * y.v, 0.0 * y.u)
        )
        return after, jnp.where(impact, 1, 0)

    def initial_mode(self, t, y, args):
        return jnp.where(y.u > 0, 1, 0)


class Plane(NamedTuple):
    x: Any
    y: Any


class PolarPieces(ss.AbstractHybridSystem):
    r"""`piecewise` of COCO: $\dot r = r(1 - r)$, $\dot\phi = 1$ left of the axis; right of it
    $\dot r = \alpha r(\beta - r)$, $\dot\phi = \gamma + \beta - r$."""

    alpha: Any
    beta: Any
    gamma: Any
    mode_names: ClassVar = ("left", "right")
    guard_names: ClassVar = ("axis",)

    def vector_field(self, t, y, mode, args):
        left, r = mode == 0, jnp.sqrt(y.x**2 + y.y**2)
        grow = jnp.where(left, 1.0 - r, self.alpha * (self.beta - r))
        turn = jnp.where(left, 1.0, self.gamma + self.beta - r)
        return Plane(grow * y.x - turn * y.y, grow * y.y + turn * y.x)

    def guards(self, t, y, mode, args):
        return (jnp.where(mode == 0, -y.x, y.x),)

    def transition(self, t, y, mode, guard, args):
        return y, 1 - mode

    def initial_mode(self, t, y, args):
        return jnp.where(y.x < 0, 0, 1)


class Bouncing(ss.AbstractHybridSystem):
    r"""Ball on a table $A\cos\omega t$ that hardly moves against the height: $\ddot x = -1$, $x = 0$:
    $v^+ = -e v^- + (1 + e) G\sin(-t)$ in units of $g/\omega$."""

    strength: Any
    restitution: Any
    mode_names: ClassVar = ("flight",)
    guard_names: ClassVar = ("impact",)

    def time_scale(self, args):
        return 1.0

    def table(self, t):
        return self.strength * jnp.cos(t)

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, -1.0 + 0.0 * y.v)

    def guards(self, t, y, mode, args):
        return (y.x - self.table(t),)

    def transition(self, t, y, mode, guard, args):
        speed = -self.strength * jnp.sin(t)
        return Motion(y.x, speed - self.restitution * (y.v - speed)), 0

    def initial_mode(self, t, y, args):
        return 0


class CoulombForced(ss.AbstractHybridSystem):
    r"""$\ddot x + 0.1\dot x + x = f\cos\omega t - \mathrm{sgn}\,\dot x$ (Den Hartog 1931).

    Modes: backward, stick, forward.
    """

    amplitude: Any
    frequency: Any
    mode_names: ClassVar = ("backward", "stick", "forward")
    guard_names: ClassVar = ("stop", "release")
    units: ClassVar = {"x": "m", "v": "m/s"}

    def time_scale(self, args):
        return 1.0 / self.frequency

    def pull(self, t, y):
        return self.amplitude * jnp.cos(self.frequency * t) - y.x

    def vector_field(self, t, y, mode, args):
        sign = jnp.asarray(mode, jnp.float64) - 1.0
        slip = self.pull(t, y) - 0.1 * y.v - sign
        return Motion(y.v, jnp.where(mode == 1, 0.0, slip))

    def guards(self, t, y, mode, args):
        sign, stick = jnp.asarray(mode, jnp.float64) - 1.0, mode == 1
        return jnp.where(stick, 1.0, sign * y.v), jnp.where(stick, 1.0 - jnp.abs(self.pull(t, y)), 1.0)

    def transition(self, t, y, mode, guard, args):
        pull = self.pull(t, y)
        slips = jnp.where(guard == 1, True, jnp.abs(pull) > 1.0)
        after = jnp.where(slips, jnp.where(pull > 0, 2, 0), 1)
        return Motion(y.x, 0.0 * y.v), after.astype(jnp.int32)

    def initial_mode(self, t, y, args):
        pull = self.pull(t, y)
        at = jnp.where(pull > 1.0, 2, jnp.where(pull < -1.0, 0, 1))
        return jnp.where(y.v > 0, 2, jnp.where(y.v < 0, 0, at)).astype(jnp.int32)


class Stopped(ss.AbstractHybridSystem):
    r"""Impact oscillator of COCO: $\ddot x + 0.1\dot x + x = A\cos t$, stop at 1: $v^+ = -0.8 v^-$."""

    amplitude: Any
    mode_names: ClassVar = ("free",)
    guard_names: ClassVar = ("stop",)

    def time_scale(self, args):
        return 1.0

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.amplitude * jnp.cos(t) - 0.1 * y.v - y.x)

    def guards(self, t, y, mode, args):
        return (1.0 - y.x,)

    def transition(self, t, y, mode, guard, args):
        return Motion(y.x, -0.8 * y.v), 0

    def initial_mode(self, t, y, args):
        return 0


class TwoStops(ss.AbstractHybridSystem):
    r"""$\ddot x + 0.1\dot x + x = b + A\cos t$ between stops at 1 and -1.2: $v^+ = -0.8 v^-$.

    Without impact $x = b + 10 A\sin t$.
    """

    amplitude: Any
    offset: Any
    mode_names: ClassVar = ("free",)
    guard_names: ClassVar = ("above", "below")

    def time_scale(self, args):
        return 1.0

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.offset + self.amplitude * jnp.cos(t) - 0.1 * y.v - y.x)

    def guards(self, t, y, mode, args):
        return 1.0 - y.x, y.x + 1.2

    def transition(self, t, y, mode, guard, args):
        return Motion(y.x, -0.8 * y.v), 0

    def initial_mode(self, t, y, args):
        return 0


class Cycle(NamedTuple):
    x: Any
    y: Any


class Radial(ss.AbstractSmoothSystem):
    r"""$\dot r = r(1 + a - r^2)$, $\dot\theta = 1$: multiplier $e^{-4\pi(1 + a)}$ of the cycle."""

    a: Any
    units: ClassVar = {"x": "1", "y": "1"}

    def vector_field(self, t, y, mode, args):
        grow = 1.0 + self.a - y.x**2 - y.y**2
        return Cycle(grow * y.x - y.y, grow * y.y + y.x)


@functools.cache
def closed_branch():
    """Of the forced block's orbits of two turns over the frequency, once for all that begin there."""
    w = 1.75
    system = ForcedBlock(0.1, w)
    orbit = periodic_orbit(system, OrbitGuess(Motion(1.0, 0.0), 4 * np.pi / w), forced=True)
    return continue_orbit(
        system, orbit, "frequency", (1.5, 2.0), forcing_period=of_frequency, follow=Follow(step=0.02)
    )
