"""One instant of a drawn machine for the reference: motion in a mode, and the law of all contacts.

Accelerations behind an event are the minimum of Gauss' function, found by trying every pattern of rest
and senses. Nothing is shared with the package but the texts of the expressions.
"""

import itertools
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import linprog

from ._laws import LAWS, MATHS
from ._structure import Numbers, Structure

SLOW = 1e-9  # speeds and accelerations below it are rounding, in units in which motions are of size 1
OPEN, FREE = 2, 3  # no force at all; a contact that can bear no friction


class Unsure(Exception):
    """The reference knows no answer."""


STENCIL = ((-2, 1 / 12, -1 / 12), (-1, -2 / 3, 4 / 3), (1, 2 / 3, 4 / 3), (2, -1 / 12, -1 / 12))


class Instants:
    """A machine with its numbers, at any time in any state."""

    def __init__(self, structure: Structure, numbers: Numbers):
        s = self.s = structure
        self.end = numbers.end
        self.names, self.n, self.k = list(s.coordinates), len(s.coordinates), len(s.states)
        self.kept = [i for i, c in enumerate(self.names) if c not in s.cyclic]
        pairs = [(a, b) for i, a in enumerate(self.names) for b in self.names[i:]]
        mass = [s.mass.get(p) or s.mass.get(p[::-1]) or "0.0" for p in pairs]
        self.places = [(self.names.index(a), self.names.index(b)) for a, b in pairs]
        sums = {c: ["0.0"] for c in self.names}
        for c, term in s.forces:
            sums[c].append(term)
        self.values = {name: numbers.values[name] for name in s.parameters}
        self.contacts, self.stops = s.contacts, s.stops
        self.m = len(s.contacts) + len(s.stops)
        self.dynamics = self._function(
            mass, [" + ".join(sums[c]) for c in self.names], [rate for _, rate in s.states.values()]
        )
        rows = [[c.row.get(x, "0.0") for x in self.names] for c in s.contacts]
        self.rows = self._function(*rows)
        self.constant = [not self._varies([*row, c.surface or "0.0"])
                         for row, c in zip(rows, s.contacts, strict=True)]  # fmt: skip
        self.touch = self._function(
            [c.surface or "0.0" for c in s.contacts],
            [c.normal or "1.0" for c in s.contacts],
        )
        push = [[(c.push or {}).get(x, "0.0") for x in self.names] for c in s.contacts]
        self.push = self._function(*push) if any(c.push for c in s.contacts) else None
        self.gaps = self._function([w.gap for w in s.stops])
        self.laws = [self._number(c.law) for c in s.contacts]
        self.restitution = [self._number(w.restitution) for w in s.stops]
        self.rest_speed = [self._number(w.rest_speed) for w in s.stops]
        times = [self._number(b) for b in s.breaks]
        if s.period:
            period = self._number(s.period)
            cycles = range(-1, int(numbers.end / period) + 2)
            times = [b + period * i for i in cycles for b in times]
        self.jumps = [*sorted({b for b in times if 1e-12 < b < self.end}), self.end]
        self.y0 = np.array([numbers.start.get(c, 0.0) for c in self._all], float)
        self.span = (0.0, self.end)
        self.form = s.form.partition("(")[0]
        arguments = s.form.partition("(")[2].replace("LuGre, ", "dict(", 1)
        self.given = (
            self._number(arguments if "dict(" in arguments else f"({arguments}") if s.form else None
        )

    @property
    def _all(self) -> list[str]:
        return [*self.names, *self.s.states, *(f"v_{c}" for c in self.names)]

    def _number(self, text: str) -> Any:
        return eval(text, {**MATHS, **LAWS, **self.values})

    def _varies(self, texts: list[str]) -> bool:
        return any(w in (*self._all, "t") for x in texts for w in re.findall(r"[A-Za-z_]\w*", x))

    def _function(self, *groups: list[str]) -> Callable[..., Any]:
        arguments = ", ".join(["t", *self._all])
        body = ", ".join(f"[{', '.join(g)}]" for g in groups)
        space = {**MATHS, **self.values}
        exec(f"def f({arguments}): return [{body}]", space)
        return space["f"]

    # -- one instant

    def at(self, t: float, y: np.ndarray, sense: list[int], without: tuple = ()) -> Any:
        """Mass, force of all but what rests (and `without`), rows, surface speeds, loads, speeds."""
        t = min(max(t, self.span[0]), self.span[1])
        y, n, count = y.tolist(), self.n, len(self.contacts)
        mass, force, rates = self.dynamics(t, *y)
        M, f = np.empty((n, n)), np.array(force)
        for (i, j), x in zip(self.places, mass, strict=True):
            M[i, j] = M[j, i] = x
        v = np.array(y[n + self.k :])
        rows = np.array(self.rows(t, *y), float).reshape(count, n)
        w, N = self.touch(t, *y)
        u = rows @ v - w
        push = self.push(t, *y) if self.push else None
        for c in range(count):
            if push is not None and sense[c] != OPEN:
                f = f + np.array(push[c]) * N[c]
            if sense[c] in (-1, 1, FREE) and c not in without:
                way = sense[c] if sense[c] != FREE else (1 if u[c] >= 0 else -1)
                law = self.laws[c]
                f = f - rows[c] * (law.kinetic(u[c], way) * N[c] + law.drag(u[c]))
        return M, f, rates, rows, np.array(w), N, u, v

    def stop_rows(self, t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gradients of the gaps, their rates by the time alone, and their second rates without
        acceleration."""
        k, n = len(self.stops), self.n
        if not k:
            return np.zeros((0, n)), np.zeros(0), np.zeros(0)
        h, rows = 1e-3, np.zeros((k, n + 1))
        for j in range(n + 1):
            for step, weight, _ in STENCIL:
                z, now = y.copy(), t
                if j < n:
                    z[j] += step * h
                else:
                    now += step * h
                rows[:, j] += weight / h * np.array(self.gaps(now, *z)[0])
        bend = -2.5 * np.array(self.gaps(t, *y)[0])
        for step, _, weight in STENCIL:
            z = y.copy()
            z[:n] += step * h * y[n + self.k :]
            bend += weight * np.array(self.gaps(t + step * h, *z)[0])
        bend[np.abs(bend) < 1e-14] = 0.0
        return rows[:, :n], rows[:, n], bend / h**2

    def drift(self, t: float, y: np.ndarray, rates: list[float]) -> np.ndarray:
        """What n . a is while a contact rests: rates of the surface less those of the direction."""
        count, h = len(self.contacts), 1e-3
        found = np.zeros(count)
        if all(self.constant):
            return found
        n, v = self.n, y[self.n + self.k :]
        for step, weight, _ in STENCIL:
            z = y.copy()
            z[:n] += step * h * v
            z[n : n + self.k] += step * h * np.array(rates)
            now = t + step * h
            rows = np.array(self.rows(now, *z), float).reshape(count, n)
            found -= weight / h * (rows @ v - np.array(self.touch(now, *z)[0]))
        found[self.constant] = 0.0
        return found

    def motion(self, t: float, y: np.ndarray, sense: list[int]) -> tuple[Any, ...]:
        """Acceleration, forces in all that rests, its null space, rates, loads and speeds."""
        M, f, rates, rows, _, N, u, _ = self.at(t, y, sense)
        rest = [c for c, s in enumerate(sense) if s == 0]
        free = np.linalg.solve(M, f)
        if not rest:
            return free, {}, None, rates, N, u
        J, gamma = self._held(t, y, rows, rates, rest)
        inverse = np.linalg.solve(M, J.T)
        D = J @ inverse
        force, Z = solved(D, gamma - J @ free)
        return free + inverse @ force, dict(zip(rest, force, strict=True)), Z, rates, N, u

    def _held(self, t, y, rows, rates, rest):
        count = len(self.contacts)
        J, gamma = rows, self.drift(t, y, rates)
        if rest[-1] >= count:
            walls, _, bend = self.stop_rows(t, y)
            J, gamma = np.vstack([rows, walls]), np.concatenate([gamma, -bend])
        return J[rest], gamma[rest]

    def limits(self, c: int, N: list[float], which: str = "static", sense: int = 0) -> tuple:
        """Least and greatest force of row `c` at rest."""
        if c >= len(self.contacts):
            return 0.0, np.inf
        law, load = self.laws[c], max(N[c], 0.0)
        ahead = law.kinetic(0.0, 1) if sense > 0 else law.static(1)
        behind = -law.kinetic(0.0, -1) if sense < 0 else law.static(-1)
        return -ahead * load, behind * load

    # -- the law of all contacts

    def settle(self, t: float, y: np.ndarray, sense: list[int], standing: list[int], forced: dict):
        """Senses after an event: `standing` rows have no speed, `forced` ones of them give way."""
        sense, count = list(sense), len(self.contacts)
        for c in [c for c in standing if c < count]:
            N = self.at(t, y, sense)[5]
            if self.limits(c, N) == (0.0, 0.0):
                sense[c] = FREE
        standing = [c for c in standing if sense[c] != FREE]
        if not standing:
            return sense
        for c in standing:
            sense[c] = 0
        M, f, rates, rows, _, N, *_ = self.at(t, y, sense, tuple(standing))
        J, gamma = self._held(t, y, rows, rates, standing)
        given = [forced.get(c, 0) for c in standing]
        for _ in range(12):
            bounds = [self.limits(c, N, sense=g) for c, g in zip(standing, given, strict=True)]
            found, a = self._gauss(M, f, J, gamma, bounds)
            for i, c in enumerate(standing):
                if not np.abs(J[i]).max() > 1e-12 and abs(gamma[i]) < SLOW:
                    found[i] = self._soon(t, y, a, rates, c)
                way = forced.get(c, 0)
                if way and found[i] == 0 and c >= count:
                    found[i] = way
                if way and found[i] == 0 and c < count:
                    kinetic, static = (self.limits(c, N, sense=x) for x in (way, 0))
                    side = 0 if way > 0 else 1
                    if abs(kinetic[side] - static[side]) <= 1e-12 * abs(static[side]):
                        found[i] = way
            if found == given:
                break
            given = found
        else:
            raise Unsure("the law of all contacts has no answer")
        for c, s in zip(standing, given, strict=True):
            sense[c] = (OPEN if s else 0) if c >= count else s
        return sense

    def _soon(self, t, y, a, rates, c):
        h = 1e-4
        v = y[self.n + self.k :]
        z = np.concatenate(
            [
                y[: self.n] + h * v + 0.5 * h * h * a,
                y[self.n : self.n + self.k] + h * np.array(rates),
                v + h * a,
            ]
        )
        u = np.dot(self.rows(t + h, *z)[c], z[self.n + self.k :]) - self.touch(t + h, *z)[0][c]
        return int(np.sign(u)) if abs(u) > 1e-14 else 0

    def _gauss(self, M, f, J, gamma, bounds):
        """Of all patterns of rest and senses the one with the least of Gauss' function."""
        best, size = None, 1.0 + np.abs(f).max()
        choices = [(0, 1) if high == np.inf else (0, 1, -1) for _, high in bounds]
        for pattern in itertools.product(*choices):
            g = f.copy()
            for s, n, (low, high) in zip(pattern, J, bounds, strict=True):
                if s:
                    g = g + n * (low if s > 0 else high)
            a = np.linalg.solve(M, g)
            rest = [i for i, s in enumerate(pattern) if s == 0]
            if rest:
                inverse = np.linalg.solve(M, J[rest].T)
                D, need = J[rest] @ inverse, gamma[rest] - J[rest] @ a
                force, _ = solved(D, need)
                if np.abs(D @ force - need).max() > SLOW * (1 + np.abs(need).max()):
                    continue
                a = a + inverse @ force
            slip = J @ a - gamma
            slip[rest] = 0.0
            value = 0.5 * a @ M @ a - a @ f
            for x, (low, high) in zip(slip, bounds, strict=True):
                if high == np.inf:
                    value += 1e6 * max(-x - SLOW * size, 0.0)
                else:
                    value += -low * x if x > 0 else -high * x
            if best is None or value < best[0] - 1e-13 * size * size:
                best = (value, slip, a)
        if best is None:
            raise Unsure("nothing is admissible")
        size = 1.0 + np.abs(best[2]).max()
        return [int(np.sign(x)) if abs(x) > SLOW * size else 0 for x in best[1]], best[2]

    def reserve(self, force: dict, Z: Any, N: list[float]) -> tuple[float, list[int]]:
        """What is left to bear of all that rests together, and which rows have least of it."""
        rest, p = list(force), np.array(list(force.values()))
        bounds = [self.limits(c, N) for c in rest]
        low, high = np.array(bounds).T
        if Z is None:
            left = np.minimum(high - p, p - low)
        else:
            k, wide = Z.shape[1], np.isfinite(high)
            A = np.vstack(
                [np.hstack([-Z, np.ones((len(p), 1))]), np.hstack([Z, np.ones((len(p), 1))])[wide]]
            )
            b = np.concatenate([p - low, (high - p)[wide]])
            ends = [(None, None)] * k + [(None, 1e6)]
            x = linprog([0.0] * k + [-1.0], A, b, bounds=ends).x
            q = p + Z @ x[:k]
            left = np.minimum(high - q, q - low)
            return float(x[k]), [c for c, e in zip(rest, left, strict=True) if e < x[k] + SLOW]
        return float(left.min()), [c for c, e in zip(rest, left, strict=True) if e < left.min() + SLOW]

    def yielding(self, t: float, y: np.ndarray, sense: list[int]) -> dict[int, int]:
        """Rows at rest that give way, with their senses."""
        _, force, Z, rates, N, _ = self.motion(t, y, sense)
        if Z is None:
            rows = self.reserve(force, Z, N)[1]
            return {c: 1 if c >= len(self.contacts) or force[c] < 0 else -1 for c in rows}
        rest = list(force)
        M, f, rates, rows, _, N, _, _ = self.at(t, y, sense, tuple(rest))
        J, gamma = self._held(t, y, rows, rates, rest)
        bounds = [
            (low * (1 - 1e-5), high * (1 - 1e-5)) for low, high in (self.limits(c, N) for c in rest)
        ]
        found, _ = self._gauss(M, f, J, gamma, bounds)
        return {c: s for c, s in zip(rest, found, strict=True) if s}


def solved(D: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, Any]:
    """The least solution of a symmetric system, and the null space if there is one."""
    if len(b) == 1:
        return (b / D[0], None) if D[0, 0] > 1e-14 else (0.0 * b, np.ones((1, 1)))
    values, vectors = np.linalg.eigh(D)
    small = values < 1e-10 * max(values[-1], 1e-300)
    inverse = np.where(small, 0.0, 1.0 / np.where(small, 1.0, values))
    return vectors @ (inverse * (vectors.T @ b)), vectors[:, small] if small.any() else None
