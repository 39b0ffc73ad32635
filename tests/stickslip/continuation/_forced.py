"""Forced oscillators written here from their equations, and their responses without the toolkit."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.linalg import expm
from scipy.optimize import root

import stickslip as ss
from stickslip.continuation import Forcing
from tests.stickslip.continuation._systems import Motion

PUSH = Forcing(force="push", harmonics=3)


class Linear(ss.AbstractSmoothSystem):
    r"""$m\ddot x + c\dot x + kx = F\cos(\omega t + \varphi) + b$."""

    frequency: Any
    mass: Any = 2.0
    damping: Any = 0.3
    stiffness: Any = 5.0
    force: Any = 0.7
    lead: Any = 0.0
    offset: Any = 0.0
    units: ClassVar = {"x": "m", "v": "m/s"}

    def time_scale(self, args):
        return 1.0 / self.frequency

    def push(self, t, y, mode, args):
        return self.force * jnp.cos(self.frequency * t + self.lead)

    def energy(self, y):
        return 0.5 * self.mass * y.v**2 + 0.5 * self.stiffness * y.x**2

    def vector_field(self, t, y, mode, args):
        load = self.push(t, y, mode, args) + self.offset - self.damping * y.v - self.stiffness * y.x
        return Motion(y.v, load / self.mass)


class Duffing(ss.AbstractSmoothSystem):
    r"""$\ddot x + 0.1\dot x + x + \beta x^3 = F\cos\omega t$."""

    frequency: Any
    cubic: Any = 1.0
    force: Any = 0.2

    def time_scale(self, args):
        return 1.0 / self.frequency

    def vector_field(self, t, y, mode, args):
        load = self.force * jnp.cos(self.frequency * t)
        return Motion(y.v, load - 0.1 * y.v - y.x - self.cubic * y.x**3)


class Slider(NamedTuple):
    x: Any
    v: Any
    z: Any


REST = Slider(0.0, 0.0, 0.0)


class Jenkins(ss.AbstractHybridSystem):
    r"""$m\ddot x + c\dot x + kx + f = F\cos\omega t$, $f = k_t(x - z)$, $|f| \le f_s$."""

    frequency: Any
    limit: Any = 0.1
    force: Any = 0.1
    mass: Any = 1.0
    damping: Any = 0.04
    stiffness: Any = 1.0
    tangential: Any = 0.5
    mode_names: ClassVar = ("slip backward", "stick", "slip forward")
    guard_names: ClassVar = ("stop", "forward", "backward")
    units: ClassVar = {"x": "m", "v": "m/s", "z": "m"}

    def time_scale(self, args):
        return 1.0 / self.frequency

    def push(self, t, y, mode, args):
        return self.force * jnp.cos(self.frequency * t)

    def slider_force(self, t, y, mode, args):
        return self.tangential * (y.x - y.z)

    def energy(self, y):
        springs = self.stiffness * y.x**2 + self.tangential * (y.x - y.z) ** 2
        return 0.5 * (self.mass * y.v**2 + springs)

    def vector_field(self, t, y, mode, args):
        load = self.push(t, y, mode, args) - self.damping * y.v - self.stiffness * y.x
        rate = (load - self.slider_force(t, y, mode, args)) / self.mass
        return Slider(y.v, rate, jnp.where(mode == 1, 0.0, y.v))

    def guards(self, t, y, mode, args):
        sense, sticks = jnp.asarray(mode, jnp.float64) - 1.0, mode == 1
        f = self.slider_force(t, y, mode, args)
        return (
            jnp.where(sticks, 1.0, sense * y.v),
            jnp.where(sticks, self.limit - f, 1.0),
            jnp.where(sticks, self.limit + f, 1.0),
        )

    def transition(self, t, y, mode, guard, args):
        after = jnp.where(guard == 0, 1, jnp.where(guard == 1, 2, 0))
        behind = (jnp.asarray(after, jnp.float64) - 1.0) * self.limit / self.tangential
        return Slider(y.x, y.v, jnp.where(after == 1, y.z, y.x - behind)), after.astype(jnp.int32)

    def initial_mode(self, t, y, args):
        f, most = self.slider_force(t, y, 1, args), self.limit * (1.0 - 1e-9)
        slips = jnp.where((f <= -most) & (y.v < 0), 0, 1)
        return jnp.where((f >= most) & (y.v > 0), 2, slips).astype(jnp.int32)


def flow(w, stiffness, damping, force, constant, span):
    """Map of (x, v, cos, sin, 1) over a time in which the motion is linear; unit mass."""
    rates = np.zeros((5, 5))
    rates[0, 1], rates[2, 3], rates[3, 2] = 1.0, -w, w
    rates[1] = [-stiffness, -damping, force, 0.0, constant]
    return expm(rates * span)


def half_turn(u, w, force, limit, k=1.0, kt=0.5, c=0.04):
    """What a symmetric orbit leaves of: amplitude, phase of the force at the top, duration of stick."""
    top, phase, stick = u
    state = np.array([top, 0.0, np.cos(phase), np.sin(phase), 1.0])
    state = flow(w, k + kt, c, force, kt * top - limit, stick) @ state
    free = state[0] - (top - 2.0 * limit / kt)
    state = flow(w, k, c, force, limit, np.pi / w - stick) @ state
    return [free, state[0] + top, state[1]]


def solved(equations, guess, *given):
    """The root near a guess, as far as rounding lets the search go."""
    found = root(equations, guess, args=given, tol=1e-13)
    assert np.max(np.abs(found.fun)) < 1e-11
    return found.x


def exact(w, guess, force=0.1, limit=0.1):
    """Amplitude, phase of the force at the top, duration of stick."""
    return solved(half_turn, guess, w, force, limit)


def harmonic_balance(w, count, force=0.1, limit=0.1, k=1.0, kt=0.5, c=0.04, samples=1 << 13):
    """Amplitude by odd harmonics up to `count`, the slider's force sampled in time (AFT)."""
    odd = np.arange(1, count + 1, 2)
    turn = 2.0 * np.pi * np.arange(samples) / samples
    waves = np.concatenate([np.cos(np.outer(odd, turn)), np.sin(np.outer(odd, turn))])

    def slider(x):
        f, rows = 0.0, np.empty(samples)
        for _ in range(2):
            for i in range(samples):
                f = min(max(f + kt * (x[i] - x[i - 1]), -limit), limit)
                rows[i] = f
        return rows

    def wrong(u):
        a, b = np.split(u, 2)
        n = odd * w
        f = 2.0 / samples * waves @ slider(u @ waves)
        load = np.zeros(odd.size)
        load[0] = force
        cos = (k - n**2) * a + c * n * b + f[: odd.size] - load
        sin = (k - n**2) * b - c * n * a + f[odd.size :]
        return np.concatenate([cos, sin])

    start = np.zeros(2 * odd.size)
    start[0], start[odd.size] = -0.1, 0.5
    u = solved(wrong, start)
    return np.ptp(u @ waves) / 2.0
