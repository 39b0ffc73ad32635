"""Systems and maps with known Lyapunov exponents, and one computed by hand."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import brentq

import stickslip as ss


class Point(NamedTuple):
    x: Any
    y: Any
    z: Any


class Flow(ss.AbstractSmoothSystem):
    r"""$\dot u = Au + b\,(0, -xz, xy) - c\,(x^2 + y^2)(x, y, 0)$.

    Linear; Lorenz's for `b = 1`; with `c = 1` and a rotation in `matrix` a circle that attracts.
    """

    matrix: Any
    b: Any
    c: Any

    def vector_field(self, t, u, mode, args):
        A, r2 = self.matrix, u.x * u.x + u.y * u.y
        rows = [A[i, 0] * u.x + A[i, 1] * u.y + A[i, 2] * u.z for i in range(3)]
        return Point(
            rows[0] - self.c * r2 * u.x,
            rows[1] - self.b * u.x * u.z - self.c * r2 * u.y,
            rows[2] + self.b * u.x * u.y,
        )


def lorenz(rho=28.0):
    matrix = np.array([[-10.0, 10.0, 0.0], [rho, -1.0, 0.0], [0.0, 0.0, -8.0 / 3.0]])
    return Flow(jnp.asarray(matrix), jnp.asarray(1.0), jnp.asarray(0.0))


class Impacts(NamedTuple):
    """A driven oscillator over a stop, m = k = 1."""

    c: float  # damping
    e: float  # restitution
    P: float  # amplitude of the force
    Omega: float  # its frequency
    stop: float

    def flow(self, t0, z, t):
        """State and its tangent matrix at `t` from `z` at `t0`: the closed form."""
        c, W = self.c, self.Omega
        w = np.sqrt(1 - c * c / 4)
        d = (1 - W * W) ** 2 + (c * W) ** 2
        forced = lambda s: self.P / d * np.array([  # noqa: E731
            (1 - W * W) * np.cos(W * s) + c * W * np.sin(W * s),
            W * (-(1 - W * W) * np.sin(W * s) + c * W * np.cos(W * s)),
        ])  # fmt: skip
        s = t - t0
        decay, co, si = np.exp(-c * s / 2), np.cos(w * s), np.sin(w * s) / w
        matrix = decay * np.array([[co + c / 2 * si, si], [-si, co - c / 2 * si]])
        return forced(t) + matrix @ (z - forced(t0)), matrix

    def growth(self, z, t_end, frame, step=0.02):
        """ln R of the frame's columns up to `t_end`: flow matrices, saltation matrices by hand, QR."""
        t, now, sums = 0.0, np.array(z), np.zeros(2)
        while True:
            a = t + step
            while self.flow(t, now, a)[0][0] > self.stop and a < t_end:
                a += step
            if a >= t_end and self.flow(t, now, t_end)[0][0] > self.stop:
                _, r = np.linalg.qr(self.flow(t, now, t_end)[1] @ frame)
                return sums + np.log(np.abs(np.diag(r)))
            hit = brentq(
                lambda s, t=t, z=now: self.flow(t, z, s)[0][0] - self.stop, a - step, a, xtol=1e-14
            )
            before, matrix = self.flow(t, now, hit)
            v = before[1]
            after = np.array([self.stop, -self.e * v])
            force = self.P * np.cos(self.Omega * hit)
            kick = force - self.c * after[1] - after[0]
            kick += self.e * (force - self.c * v - before[0])
            S = np.array([[-self.e, 0.0], [kick / v, -self.e]])
            frame, r = np.linalg.qr(S @ matrix @ frame)
            sums += np.log(np.abs(np.diag(r)))
            t, now = hit, after
