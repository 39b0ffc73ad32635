"""Exact motions of the reference systems, in NumPy alone and from the equations of motion alone.

Every function takes complex parameters too: the imaginary part of the result over an imaginary step
of 1e-30 is its derivative, exact to rounding (Squire and Trapp, SIAM Review 40, 1998).
"""

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.linalg

STEP = 1e-30


def derivatives(function: Callable, parameters: dict) -> dict:
    """Derivative of `function(**parameters)` with respect to each parameter."""
    return {
        name: np.imag(function(**{**parameters, name: value + 1j * STEP})) / STEP
        for name, value in parameters.items()
    }


class BeltCycle(NamedTuple):
    """Stick-slip cycle of a block started in stick at x = 0, on a belt of positive speed.

    With w = sqrt(k/m), c = F_k/k and D = (F_s - F_k)/k >= 0 it sticks up to x = c + D, then
    x = c + D cos(wt) + (v_b/w) sin(wt) until its speed is v_b again: by symmetry at x = c - D, after
    the time 2 (pi - arctan(D w/v_b))/w.
    """

    mass: float
    stiffness: float
    static_force: float
    kinetic_force: float
    belt_speed: np.ndarray

    @property
    def frequency(self):
        return np.sqrt(self.stiffness / self.mass)

    @property
    def half_range(self):
        return (self.static_force - self.kinetic_force) / self.stiffness

    @property
    def first_slip(self):
        return self.static_force / self.stiffness / self.belt_speed

    @property
    def slip_time(self):
        ratio = self.half_range * self.frequency / self.belt_speed
        return 2 * (np.pi - np.arctan(ratio)) / self.frequency

    @property
    def period(self):
        return self.slip_time + 2 * self.half_range / self.belt_speed

    def events(self, count: int) -> np.ndarray:
        """Times of the first events, the slips at even places; last axis."""
        number = np.arange(count) // 2
        starts = np.asarray(self.first_slip)[..., None]
        starts = starts + number * np.asarray(self.period)[..., None]
        return starts + (np.arange(count) % 2) * np.asarray(self.slip_time)[..., None]

    def position(self, t: float) -> np.ndarray:
        """x(t)."""
        c, D, w, v = (
            self.kinetic_force / self.stiffness,
            self.half_range,
            self.frequency,
            self.belt_speed,
        )
        since = t - self.first_slip
        phase = since - np.floor(np.real(since) / np.real(self.period)) * self.period
        slip = c + D * np.cos(w * phase) + v / w * np.sin(w * phase)
        stick = c - D + v * (phase - self.slip_time)
        inside = np.where(np.real(phase) < np.real(self.slip_time), slip, stick)
        return np.where(np.real(since) < 0, v * t, inside)

    def distance_to_event(self, t: float) -> np.ndarray:
        """Time from t to the nearest event."""
        count = int(2 * (2 + t / np.min(np.real(self.period))))
        return np.min(np.abs(np.real(self.events(count)) - t), axis=-1)


def throw(mass, kinetic_force, force, v, t):
    """(x, v) of a block thrown with v > 0 from x = 0, and when it stops; it stays at rest."""
    slowing = (kinetic_force - force) / mass
    stop = v / slowing
    moving = np.where(np.real(t) < np.real(stop), t, stop)
    return v * moving - slowing * moving**2 / 2, v - slowing * moving, stop


def bounces(gravity, restitution, height, count):
    """Impact times and speeds before the impacts of a ball dropped from `height`."""
    first_speed = np.sqrt(2 * gravity * height)
    speeds = first_speed * restitution ** np.arange(count)
    flights = 2 * restitution * speeds[:-1] / gravity
    first = np.sqrt(2 * height / gravity)
    return first + np.concatenate([[0 * first], np.cumsum(flights)]), speeds


def ball(gravity, restitution, height, t):
    """(x, v) of the ball at time t, while it still bounces."""
    times, speeds = bounces(gravity, restitution, height, 200)
    n = int(np.sum(np.real(times) < t))
    if n == 0:
        return height - gravity * t**2 / 2, -gravity * t
    since, speed = t - times[n - 1], restitution * speeds[n - 1]
    return speed * since - gravity * since**2 / 2, speed - gravity * since


def limit_of_bounces(gravity, restitution, height):
    """Time at which all the infinitely many impacts are over."""
    first_speed = np.sqrt(2 * gravity * height)
    return first_speed / gravity + 2 * first_speed * restitution / (gravity * (1 - restitution))


def impacts_of_free_oscillator(mass, stiffness, gap, restitution, v, count):
    """Impact times and speeds between stops at -gap and +gap, from x = 0 with v > 0, undamped.

    From stop to stop the spring does no work, so that the speed after the n-th impact is e**n times
    the first one; the time between is that of a harmonic motion symmetric about x = 0.
    """
    w = np.sqrt(stiffness / mass)
    speed = np.sqrt(v**2 - (w * gap) ** 2)
    times, speeds = [np.arctan(gap * w / speed) / w], [speed]
    for _ in range(count - 1):
        after = restitution * speeds[-1]
        times.append(times[-1] + 2 * np.arctan(gap * w / after) / w)
        speeds.append(after)
    return np.array(times), np.array(speeds)


class Event(NamedTuple):
    """Time, guard and modes of an event."""

    t: float
    guard: str
    before: object
    after: object


def follow(matrix, guards, jump, y, mode, t_end, grid=4e-3):
    """Exact motion of a piecewise linear system: y' = A(mode) y between events.

    `matrix(mode)` is A; `guards(mode)` maps names to rows g with g.y > 0 inside the mode;
    `jump(y, mode, guard)` gives state and mode after an event. Constants, ramps and harmonic drives
    are components of y. The flow is the matrix exponential; events are bracketed on a fine grid and
    then solved by Newton's method on the exact flow. Returns the state at t_end and the events.
    """
    t, events = 0.0, []
    exponentials = {}
    while True:
        A, rows = matrix(mode), guards(mode)
        names, G = list(rows), np.array(list(rows.values()))
        if mode not in exponentials:
            exponentials[mode] = scipy.linalg.expm(A * grid)
        start, position = y, y
        for n in itertools.count():
            if np.real(t) + n * grid >= t_end:
                return scipy.linalg.expm(A * (t_end - t)) @ start, events
            ahead = exponentials[mode] @ position
            if np.any(np.real(G @ ahead) < 0):
                break
            position = ahead
        first = None
        for i in np.flatnonzero(np.real(G @ ahead) < 0):
            tau = n * grid
            for _ in range(30):
                now = scipy.linalg.expm(A * tau) @ start
                tau = tau - (G[i] @ now) / (G[i] @ A @ now)
            if first is None or np.real(tau) < np.real(first[0]):
                first = tau, names[i]
        tau, name = first
        if np.real(t + tau) >= t_end:
            return scipy.linalg.expm(A * (t_end - t)) @ start, events
        y, after = jump(scipy.linalg.expm(A * tau) @ start, mode, name)
        t = t + tau
        events.append(Event(t, name, mode, after))
        mode = after


def two_blocks(t_end, mass, stiffness, coupling, static, kinetic, belt_speed, x=(0.0, 0.0)):
    """State (x1, v1, x2, v2) at t_end and the events of two blocks that start in stick at `x`.

    `mass`, `stiffness`, `static`, `kinetic` are pairs; static >= kinetic. A mode is the pair of
    senses of slip, 0 in stick.
    """
    K = np.array([[stiffness[0] + coupling, -coupling], [-coupling, stiffness[1] + coupling]])
    rows_of_load = np.zeros((2, 5), dtype=K.dtype)
    rows_of_load[:, 0], rows_of_load[:, 2] = -K[:, 0], -K[:, 1]
    unit = np.eye(5)

    def matrix(mode):
        A = np.zeros((5, 5), dtype=complex)
        for i, sense in enumerate(mode):
            A[2 * i, 2 * i + 1] = 1
            if sense:
                A[2 * i + 1] = (rows_of_load[i] - sense * kinetic[i] * unit[4]) / mass[i]
        return A

    def guards(mode):
        rows = {}
        for i, sense in enumerate(mode):
            if sense:
                rows[f"speed {i}"] = sense * (unit[2 * i + 1] - belt_speed * unit[4])
            else:
                rows[f"forward {i}"] = static[i] * unit[4] - rows_of_load[i]
                rows[f"backward {i}"] = static[i] * unit[4] + rows_of_load[i]
        return rows

    def jump(y, mode, guard):
        word, i = guard.split()
        i = int(i)
        y, mode = y.copy(), list(mode)
        y[2 * i + 1] = belt_speed
        load = np.real(rows_of_load[i] @ y)
        held = word == "speed" and abs(load) <= np.real(static[i])
        mode[i] = 0 if held else int(np.sign(load))
        return y, tuple(mode)

    start = np.array([x[0], belt_speed, x[1], belt_speed, 1.0])
    end, events = follow(matrix, guards, jump, start, (0, 0), t_end)
    return end[:4], events


def between_stops(
    t_end, mass, stiffness, damping, lower, upper, restitution, amplitude, frequency, x, v
):
    """State (x, v) at t_end and the impacts of the driven oscillator; no rest at a stop."""
    A = np.zeros((5, 5), dtype=complex)
    A[0, 1] = 1
    A[1] = [-stiffness / mass, -damping / mass, amplitude / mass, 0, 0]
    A[2, 3], A[3, 2] = -frequency, frequency  # cos and sin of the drive
    rows = {"lower": np.array([1, 0, 0, 0, -lower]), "upper": np.array([-1, 0, 0, 0, upper])}

    def jump(y, mode, guard):
        stop = lower if guard == "lower" else upper
        return np.array([stop, -restitution * y[1], *y[2:]]), mode

    start = np.array([x, v, 1.0, 0.0, 1.0])
    end, events = follow(lambda _: A, lambda _: rows, jump, start, "free", t_end)
    return end[:2], events
