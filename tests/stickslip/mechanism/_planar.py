"""Machines with friction in a plane, and their motion by Moreau's time stepping with the disc."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from stickslip.mechanism import AbstractMechanism, Contact

G = 9.81


class Puck(AbstractMechanism):
    """1 kg on a table that moves with a constant velocity, under a constant force."""

    law: Any
    px: Any = 0.0
    py: Any = 0.0
    wx: Any = 0.0
    wy: Any = 0.0
    across: Any = None  # law of the second axis, where it is another
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"along": {"x": 1.0}, "across": {"y": 1.0}}
    planar: ClassVar = {"along": "across"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": self.px, "y": self.py}

    def contacts(self, t, q, v, args):
        second = self.law if self.across is None else self.across
        return {
            "along": Contact(self.law, self.load(t, q), self.wx),
            "across": Contact(second, surface_speed=self.wy),
        }

    def load(self, t, q):
        return G

    def time_scale(self, args):
        return jnp.inf


class Swayed(Puck):
    """Pushed sideways by a force that swings, under a normal force that does too."""

    swing: Any = 1.5

    def forces(self, t, q, v, args):
        return {"x": self.px - 3.0 * q.x, "y": self.py + self.swing * jnp.sin(2.0 * t)}

    def load(self, t, q):
        return G * (1.0 + 0.3 * jnp.cos(3.0 * t))

    def time_scale(self, args):
        return 0.3


class Turntable(Puck):
    """On a table that turns at `turn` [rad/s], which grows by `rate` [rad/s^2]."""

    turn: Any = 3.0
    rate: Any = 0.0

    def contacts(self, t, q, v, args):
        w = self.turn + self.rate * t
        return {
            "along": Contact(self.law, G, -w * q.y),
            "across": Contact(self.law, surface_speed=w * q.x),
        }

    def time_scale(self, args):
        return 0.5


class Pulled(AbstractMechanism):
    """Two pucks and a spring; the first is pulled by another spring, whose end moves."""

    law: Any
    pull: Any = 4.0
    spring: Any = 10.0
    speed: Any = (0.5, 0.2)
    coordinates: ClassVar = {"x": "m", "y": "m", "a": "m", "b": "m"}
    contact_directions: ClassVar = {
        "first x": {"x": 1.0}, "first y": {"y": 1.0}, "second x": {"a": 1.0}, "second y": {"b": 1.0},
    }  # fmt: skip
    planar: ClassVar = {"first x": "first y", "second x": "second y"}
    mass: ClassVar = (1.0, 1.0, 0.7, 0.7)

    def mass_matrix(self, q):
        return dict(zip(self.coordinates, self.mass, strict=True))

    def forces(self, t, q, v, args):
        fx, fy = self.spring * (q.a - q.x), self.spring * (q.b - q.y)
        gx = self.pull * (self.speed[0] * t - q.x)
        return {"x": fx + gx, "y": fy + self.pull * (self.speed[1] * t - q.y), "a": -fx, "b": -fy}

    def contacts(self, t, q, v, args):
        free = Contact(self.law)
        return {
            "first x": Contact(self.law, G), "first y": free,
            "second x": Contact(self.law, 0.7 * G), "second y": free,
        }  # fmt: skip

    def time_scale(self, args):
        return 1.0


def moreau(masses, limits, force, surface, q, v, t1, steps):
    """Pucks of `masses` [n] with friction of at most `limits(t)` [n], in the middle of each step.

    The impulse of each is the nearest to that which stops it out of the disc; `q`, `v`: [n, 2].
    """
    h, m = t1 / steps, np.asarray(masses)[:, None]
    for k in range(steps):
        t, middle = (k + 0.5) * h, q + 0.5 * h * v
        v = v + h * force(t, middle) / m
        slip = v - surface(t, middle)
        size = np.linalg.norm(m * slip, axis=1, keepdims=True)
        most = h * np.asarray(limits(t)).reshape(-1, 1)
        v = v - slip * np.minimum(1.0, most / np.maximum(size, 1e-300))
        q = middle + 0.5 * h * v
    return np.concatenate([q.ravel(), v.ravel()])


def by_scipy(force, normal, belt, static, kinetic, v, t1, rest=1e-7):
    """A puck of 1 kg from the origin, by SciPy; slower than `rest` [m/s] it has stopped."""
    t, y, slides = 0.0, np.r_[0.0, 0.0, v], True
    for _ in range(200):
        field, guard = _phase(force, normal, belt, static, kinetic, rest, slides)
        options = dict(method="DOP853", rtol=1e-10, atol=1e-12, max_step=0.02)
        run = solve_ivp(field, (t, t1), y, events=guard, **options)
        t, y = run.t[-1], run.y[:, -1]
        if run.status == 0:
            return y
        load = force(t, y[:2])
        slides = not slides or np.hypot(*load) > static * normal(t)
        y[2:] = belt + (1.01 * rest * load / np.hypot(*load) if slides else 0.0)
    raise AssertionError("too many events")


def _phase(force, normal, belt, static, kinetic, rest, slides):
    """Field and guard of a puck that slides, or rests on its belt."""

    def field(t, y):
        if not slides:
            return np.r_[belt, 0.0, 0.0]
        u = y[2:] - belt
        friction = kinetic * normal(t) * u / max(np.hypot(*u), 1e-300)
        return np.r_[y[2:], force(t, y[:2]) - friction]

    def guard(t, y):
        if slides:
            return np.hypot(*(y[2:] - belt)) - rest
        return static * normal(t) - np.hypot(*force(t, y[:2]))

    guard.terminal, guard.direction = True, -1
    return field, guard


def slide_to_rest(u, load, deceleration):
    """Time and way of a slide from `u` [m/s] to rest under a constant load [m/s^2] within friction."""
    u, m = np.asarray(u, float), np.asarray(load, float) / deceleration
    s = np.hypot(*u)
    e, m2 = u / s, m @ m
    g = m @ e
    way = (2.0 + g) / (4.0 - m2) * e
    way = way + (4.0 - m2 + 6.0 * g + 3.0 * g * g) / (4.0 * (1.0 - m2) * (4.0 - m2)) * m
    return s * (1.0 + g) / deceleration / (1.0 - m2), s * s / deceleration * way
