"""Machines of the tests, and the textbook's filter in NumPy."""

from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.linalg import expm

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact


class Pushed(AbstractMechanism):
    """Block of 1 kg and a spring of 1 N/m on a belt, under a force that drifts."""

    static_force: Any = 1.0
    kinetic_force: Any = 0.5
    belt_speed: Any = 0.2
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"belt": {"x": 1.0}}
    first_order: ClassVar = {"d": "N"}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": q.d - q.x}

    def rates(self, t, q, v, args):
        return {"d": 0.0 * q.d}

    def contacts(self, t, q, v, args):
        law = Coulomb(self.static_force, self.kinetic_force)
        return {"belt": Contact(law, surface_speed=self.belt_speed)}


class Pair(NamedTuple):
    x: Any
    v: Any


class Linear(ss.AbstractSmoothSystem):
    stiffness: Any = 4.0
    damping: Any = 0.3
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        return Pair(y.v, -self.stiffness * y.x - self.damping * y.v)

    @property
    def matrix(self):
        return np.array([[0.0, 1.0], [-self.stiffness, -self.damping]])


def place(system, t, y, mode, args):
    return {"x": y.x}


def van_loan(A, Q, dt):
    """Transition matrix and covariance of the noise over a time."""
    n = len(A)
    found = expm(dt * np.block([[-A, Q], [np.zeros((n, n)), A.T]]))
    transition = found[n:, n:].T
    return transition, transition @ found[:n, n:]


def textbook(A, Q, H, R, t0, t, values, mean, covariance):
    """Kalman's filter, and the smoother of Rauch, Tung and Striebel, of x' = A x."""
    steps, likelihood, since = [], 0.0, t0
    for time, row in zip(t, values, strict=True):
        transition, noise = van_loan(A, Q, time - since)
        since = time
        before = transition @ mean, transition @ covariance @ transition.T + noise
        there = ~np.isnan(row)
        h, r = H[there], R[np.ix_(there, there)]
        off = row[there] - h @ before[0]
        spread = h @ before[1] @ h.T + r
        gain = before[1] @ h.T @ np.linalg.inv(spread)
        mean, covariance = before[0] + gain @ off, (np.eye(len(A)) - gain @ h) @ before[1]
        size = np.linalg.slogdet(2.0 * np.pi * spread)[1]
        likelihood += -0.5 * (off @ np.linalg.solve(spread, off) + size)
        steps.append((transition, before, (mean, covariance)))
    smoothed = [steps[-1][2]]
    for (_, _, (m, P)), (transition, before, _) in zip(steps[-2::-1], steps[:0:-1], strict=True):
        gain = P @ transition.T @ np.linalg.inv(before[1])
        later, wide = smoothed[-1]
        smoothed.append((m + gain @ (later - before[0]), P + gain @ (wide - before[1]) @ gain.T))
    filtered = [step[2] for step in steps]
    return filtered, smoothed[::-1], likelihood
