"""Jenkins elements on linear structures, piece by piece in closed form: NumPy and SciPy alone.

Between events the motion under a harmonic force is linear: the exponential of one matrix. Events are
bracketed on a fine grid and located by bisection on the exact motion.
"""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq


class Reference:
    """`M q'' + C q' + K q + sum n f = F cos(w t)`, elements with directions in the rows of `n`."""

    def __init__(self, M, C, K, F, w, n, kt, fs):
        self.M, self.C, self.K, self.F = (np.asarray(a, float) for a in (M, C, K, F))
        self.w, self.n = w, np.asarray(n, float)
        self.kt, self.fs = np.asarray(kt, float), np.asarray(fs, float)
        self.events, self.loss = [], np.zeros(len(self.kt))

    def matrix(self, state):
        """Of the rates of `(q, v, z, 1, cos, sin)` with each element in its state, -1, 0 or 1."""
        size, m = len(self.F), len(self.kt)
        A = np.zeros((2 * size + m + 3,) * 2)
        inverse = np.linalg.inv(self.M)
        q, v = slice(0, size), slice(size, 2 * size)
        one, cos, sin = -3, -2, -1
        A[q, v] = np.eye(size)
        A[v, q], A[v, v] = -inverse @ self.K, -inverse @ self.C
        A[v, cos] = inverse @ self.F
        A[cos, sin], A[sin, cos] = -self.w, self.w
        for j, s in enumerate(state):
            push = inverse @ self.n[j]
            if s == 0:
                A[v, q] -= np.outer(push, self.kt[j] * self.n[j])
                A[v, 2 * size + j] += push * self.kt[j]
            else:
                A[v, one] -= push * s * self.fs[j]
                A[2 * size + j, v] = self.n[j]
        return A

    def margins(self, x, state):
        """What is left until each element changes its state."""
        size, m = len(self.F), len(self.kt)
        stretch = self.n @ x[:size] - x[2 * size : 2 * size + m]
        speed = self.n @ x[size : 2 * size]
        return np.where(state == 0, self.fs - self.kt * np.abs(stretch), state * speed)

    def run(self, q, v, z, until, step):
        """The state `(q, v, z)` at a time; elements in the middle of their limits at first."""
        x = np.concatenate([q, v, z, [1.0, 1.0, 0.0]])
        size, m = len(self.F), len(self.kt)
        state, t = np.zeros(m), 0.0
        while t < until:
            A = self.matrix(state)
            whole = expm(A * step)
            armed = self.margins(x, state) > 1e-11
            while True:
                h = min(step, until - t)
                after = (whole if h == step else expm(A * h)) @ x
                found = self.margins(after, state)
                over = (found < 0.0) & armed
                if not over.any():
                    self._lose(state, x, after)
                    t, x = t + h, after
                    armed |= found > 1e-11
                    if t >= until:
                        break
                    continue
                place, j = min((self._zero(A, x, state, j, h), j) for j in np.flatnonzero(over))
                after = expm(A * place) @ x
                self._lose(state, x, after)
                t, x = t + place, after
                stretch = self.n[j] @ x[:size] - x[2 * size + j]
                state[j] = np.sign(stretch) if state[j] == 0 else 0.0
                self.events.append((t, j, state[j]))
                break
        return x[:size], x[size : 2 * size], x[2 * size : 2 * size + m]

    def _zero(self, A, x, state, j, h):
        """When the margin of an element is zero, within `h`."""
        return brentq(
            lambda s: self.margins(expm(A * s) @ x, state)[j], 0.0, h, xtol=1e-16, rtol=8.9e-16
        )

    def _lose(self, state, before, after):
        size, m = len(self.F), len(self.kt)
        moved = (after - before)[2 * size : 2 * size + m]
        self.loss += np.where(state == 0, 0.0, self.fs * state * moved)
