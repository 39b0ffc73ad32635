"""The jointed beam in numba: DOP853 with fixed steps, events by shortened steps, a lane a thread.

What a researcher writes for this one system: stages written out, the Jacobian and the saltation by
hand, and only of what can be different from zero.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ._illinois import compiled

BACKWARD, STICK, FORWARD, APART = 0, 1, 2, 3
TRIES = 60  # at most, to find an event within a step


class Beam(NamedTuple):
    """Numbers of the system that all lanes share."""

    m: float
    k1: float
    k2: float
    k3: float
    mu: float
    gamma: float
    phi: np.ndarray  # eigenfunctions at the joint
    omega2: np.ndarray  # squares of the eigenfrequencies
    x0: float


def stages(a: np.ndarray, b: np.ndarray, columns: str) -> str:
    """Source of one step of a Runge-Kutta method, coefficients written out; two loops a stage."""
    lines = ["def step(slope, s, mode, h, v, P, K, out):", "    slope(s, mode, v, P, K[0])"]
    for i, row in enumerate([*a[1:], b], start=1):
        terms = " + ".join(f"{c!r} * K[{j}, c]" for j, c in enumerate(map(float, row)) if c != 0.0)
        lines += [f"    for c in range({columns}):", f"        out[c] = s[c] + h * ({terms})"]
        if i < len(a):
            lines.append(f"    slope(out, mode, v, P, K[{i}])")
    return "\n".join(lines)


def _step(numba, columns: str) -> Any:
    from scipy.integrate import DOP853

    space: dict[str, Any] = {}
    exec(stages(DOP853.A[: DOP853.n_stages, : DOP853.n_stages], DOP853.B, columns), space)
    return numba.njit(fastmath=True, error_model="numpy")(space["step"])


@functools.cache
def kernels() -> tuple[Callable, Callable]:
    """Compiled `diagram` and `exponents`."""
    import numba  # pyright: ignore[reportMissingImports]

    jit = functools.partial(numba.njit, fastmath=True, error_model="numpy")
    step = _step(numba, "s.size")
    secant, narrow = compiled()

    @jit(inline="always")
    def friction(x, V, mode, P):
        """Force of the belt in slip and its derivative by V."""
        sense = 1.0 if mode == FORWARD else -1.0
        per = 1.0 / (1.0 + P.gamma * sense * V)
        force = -sense * P.mu * P.k3 * x * per
        return force, -force * P.gamma * sense * per

    @jit
    def slope(s, mode, v, P, d):
        n = P.phi.size
        w = 0.0
        for i in range(n):
            w += P.phi[i] * s[4 + i]
        joint = P.k1 * (s[2] - w)
        N = 0.0 if mode == APART else P.k3 * s[0]
        d[0], d[1] = s[1], -(P.k2 * s[0] + N) / P.m
        d[2] = s[3]
        if mode == STICK:
            d[3] = 0.0
        else:
            force = 0.0 if mode == APART else friction(s[0], s[3] - v, mode, P)[0]
            d[3] = (force - joint) / P.m
        for i in range(n):
            d[4 + i] = s[4 + n + i]
            d[4 + n + i] = P.phi[i] * joint - P.omega2[i] * s[4 + i]

    @jit
    def tangent_slope(s, mode, v, P, d):
        """State in the first numbers, then a row of deviations for each of y, vy, q, p."""
        n = P.phi.size
        S = 4 + 2 * n
        M = 2 + 2 * n
        slope(s[:S], mode, v, P, d[:S])
        D, E = s[S:].reshape(M, M), d[S:].reshape(M, M)
        by_V = 0.0
        if mode == FORWARD or mode == BACKWARD:
            by_V = friction(s[0], s[3] - v, mode, P)[1]
        free = 0.0 if mode == STICK else 1.0 / P.m
        for c in range(M):
            E[0, c] = D[1, c]
            E[1, c] = D[0, c]
        for i in range(n):
            for c in range(M):
                E[1, c] -= P.phi[i] * D[2 + i, c]
        for i in range(n):
            for c in range(M):
                E[2 + i, c] = D[2 + n + i, c]
                E[2 + n + i, c] = P.phi[i] * P.k1 * E[1, c] - P.omega2[i] * D[2 + i, c]
        for c in range(M):
            E[1, c] = free * (by_V * D[1, c] - P.k1 * E[1, c])

    @jit
    def guard(s, mode, v, P, unit):
        """Smallest guard, in units of the belt's speed, and its number."""
        if mode == APART:
            return -s[0] / unit, 0
        g, which = s[0] / unit, 0
        if mode == STICK:
            n = P.phi.size
            w = 0.0
            for i in range(n):
                w += P.phi[i] * s[4 + i]
            joint, limit = P.k1 * (s[2] - w), P.mu * P.k3 * s[0]
            scale = 1.0 / (P.k1 * unit)
            if (limit + joint) * scale < g:
                g, which = (limit + joint) * scale, 2
            if (limit - joint) * scale < g:
                g, which = (limit - joint) * scale, 3
        else:
            V = (s[3] - v if mode == FORWARD else v - s[3]) / v
            if V < g:
                g, which = V, 1
        return g, which

    @jit
    def at_rest(s, P):
        n = P.phi.size
        w = 0.0
        for i in range(n):
            w += P.phi[i] * s[4 + i]
        joint, limit = P.k1 * (s[2] - w), P.mu * P.k3 * s[0]
        return BACKWARD if joint > limit else (FORWARD if -joint > limit else STICK)

    @jit
    def after(s, mode, which, v, P):
        """Mode after the event; the state is set onto the border."""
        if which == 0:
            s[0] = 0.0
            if mode != APART:
                return APART
            return FORWARD if s[3] > v else (BACKWARD if s[3] < v else at_rest(s, P))
        s[3] = v
        if which == 1:
            return at_rest(s, P)
        return FORWARD if which == 2 else BACKWARD

    @jit
    def advance(field, s, mode, h, v, P, K, out, unit):
        """A step, or less up to an event: how long, and the guard's number (-1: none)."""
        step(field, s, mode, h, v, P, K, out)
        g, which = guard(out, mode, v, P, unit)
        if g >= 0.0:
            return h, -1
        bracket = (0.0, h, guard(s, mode, v, P, unit)[0], g, 0)
        for _ in range(TRIES):
            low, high, at_low, _at_high, _side = bracket
            # A guard at zero at the start: look for where it is positive first.
            t = secant(bracket) if at_low > 1e-14 else 0.5 * (low + high)
            step(field, s, mode, t, v, P, K, out)
            g, which = guard(out, mode, v, P, unit)
            if abs(g) < 1e-13 or high - low < 1e-15:
                return t, which
            bracket = narrow(bracket, t, g)
        return t, which

    @jit
    def begin(v, P, s):
        s[:] = 0.0
        s[0], s[3] = P.x0, v
        return at_rest(s, P)

    @jit(inline="always")
    def rate(s, P, number):
        """Rates of x, y and w."""
        if number < 2:
            return s[1 + 2 * number]
        n = P.phi.size
        total = 0.0
        for i in range(n):
            total += P.phi[i] * s[4 + n + i]
        return total

    @jit(inline="always")
    def value(s, P, number):
        if number < 2:
            return s[2 * number]
        total = 0.0
        for i in range(P.phi.size):
            total += P.phi[i] * s[4 + i]
        return total

    @jit
    def maximum(s, end, mode, h, v, P, K, out, number):
        """Value where the rate is zero within the step `h` from `s` to `end`."""
        bracket = (0.0, h, rate(s, P, number), rate(end, P, number), 0)
        for _ in range(TRIES):
            t = secant(bracket)
            step(slope, s, mode, t, v, P, K, out)
            g = rate(out, P, number)
            if abs(g) < 1e-12 * v or bracket[1] - bracket[0] < 1e-14:
                break
            bracket = narrow(bracket, t, g)
        return value(out, P, number)

    @jit(parallel=True)
    def diagram(speeds, P, h, transient, duration, points, counts, sticks):
        n = P.phi.size
        S = 4 + 2 * n
        for lane in numba.prange(speeds.size):
            v = speeds[lane]
            s, out, part, K = np.empty(S), np.empty(S), np.empty(S), np.empty((12, S))
            unit = v * math.sqrt(P.m / P.k2)
            mode = begin(v, P, s)
            for recorded in range(2):
                left = duration if recorded else transient
                while left > 1e-12:
                    done, which = advance(slope, s, mode, min(h, left), v, P, K, out, unit)
                    if recorded:
                        for number in range(3):
                            if rate(s, P, number) > 0.0 and rate(out, P, number) <= 0.0:
                                k = counts[lane, number]
                                if k < points.shape[2]:
                                    points[lane, number, k] = maximum(
                                        s, out, mode, done, v, P, K, part, number
                                    )
                                counts[lane, number] = k + 1
                    s, out = out, s
                    left -= done
                    if which >= 0:
                        new = after(s, mode, which, v, P)
                        if recorded and new == STICK and mode != STICK:
                            sticks[lane] += 1
                        mode = new

    @jit(parallel=True)
    def exponents(speeds, P, h, transient, segment, warm_up, segments, frame, found, lost):
        n = P.phi.size
        S, M = 4 + 2 * n, 2 + 2 * n
        for lane in numba.prange(speeds.size):
            v = speeds[lane]
            small, small_out, small_K = np.empty(S), np.empty(S), np.empty((12, S))
            unit = v * math.sqrt(P.m / P.k2)
            mode = begin(v, P, small)
            left = transient
            while left > 1e-12:
                done, which = advance(slope, small, mode, min(h, left), v, P, small_K, small_out, unit)
                small, small_out = small_out, small
                left -= done
                if which >= 0:
                    mode = after(small, mode, which, v, P)
            size = S + M * M
            s, out, K = np.empty(size), np.empty(size), np.empty((12, size))
            s[:S] = small
            scale = np.ones(M)
            scale[1] = math.sqrt(P.k1 / P.m)
            for i in range(n):
                scale[2 + n + i] = math.sqrt(P.omega2[i])
            Q = frame.copy()
            for number in range(warm_up + segments):
                D = s[S:].reshape(M, M)
                for i in range(M):
                    for c in range(M):
                        D[i, c] = scale[i] * Q[i, c]
                left = segment
                while left > 1e-12:
                    done, which = advance(tangent_slope, s, mode, min(h, left), v, P, K, out, unit)
                    s, out = out, s
                    left -= done
                    if which >= 0:
                        D = s[S:].reshape(M, M)
                        slope(s[:S], mode, v, P, K[0, :S])
                        before = K[0, 3]
                        # Rate of the guard in stick and how much it changes with y and w.
                        sense = 1.0 if which == 2 else -1.0
                        stuck = 0.0
                        if which >= 2:
                            pull = P.k1 * (v - rate(s[:S], P, 2))
                            stuck = P.mu * P.k3 * s[1] + sense * pull
                        new = after(s[:S], mode, which, v, P)
                        if which >= 1:
                            slope(s[:S], new, v, P, K[0, :S])
                            later = K[0, 3]
                            for c in range(M):
                                if which == 1:
                                    late = -D[1, c] / before
                                else:
                                    stretch = D[0, c]
                                    for i in range(n):
                                        stretch -= P.phi[i] * D[2 + i, c]
                                    late = -sense * P.k1 * stretch / stuck
                                D[1, c] = -later * late
                        mode = new
                D = s[S:].reshape(M, M)
                for i in range(M):
                    for c in range(M):
                        Q[i, c] = D[i, c] / scale[i]
                longest = 0.0
                for c in range(M):
                    longest = max(longest, math.sqrt(np.sum(Q[:, c] ** 2)))
                Q, R = np.linalg.qr(Q)
                if number >= warm_up:
                    for c in range(M):
                        grown = abs(R[c, c])
                        if grown > 1e-11 * longest:
                            found[lane, c] += math.log(grown) / (segments * segment)
                        else:
                            lost[lane, c] += 1

    return diagram, exponents
