"""A slow, safe march through the modes of a drawn machine, in NumPy and SciPy only.

Between events DOP853 with short steps; guards are looked at four times a step on its dense output.
"""

import itertools
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from ._instants import FREE, OPEN, SLOW, Instants, Unsure, solved
from ._structure import Numbers, Structure

MOST_CALLS = 400_000  # of a smooth form, in each stretch between jumps


class March(Instants):
    """One machine with its numbers, on its way."""

    def __init__(self, structure: Structure, numbers: Numbers, rtol: float = 1e-11, steps: int = 160):
        super().__init__(structure, numbers)
        self.rtol, self.longest = rtol, numbers.end / steps

    def guards(self, t: float, y: np.ndarray, sense: list[int]) -> tuple[np.ndarray, list]:
        """Values that must stay positive, and what happens where they do not."""
        values, labels, count = [], [], len(self.contacts)
        rest = 0 in sense
        if rest:
            _, force, Z, _, N, u = self.motion(t, y, sense)
        else:
            *_, N, u, _ = self.at(t, y, sense)
        for c, touch in enumerate(self.contacts):
            s = sense[c]
            if s in (-1, 1):
                values.append(s * u[c])
                labels.append(("stops", c))
            if s == FREE:
                low, high = self.limits(c, N)
                values.append(1e-12 - max(high, -low))
                labels.append(("binds", c))
            if touch.opens:
                # What presses with nothing for a while is open.
                values.append((-N[c] or 1.0) if s == OPEN else N[c] or -1.0)
                labels.append(("closes" if s == OPEN else "opens", c))
            elif touch.normal:
                values.append(N[c] + 1e-12)
                labels.append(("ends", c))
        gaps = self.gaps(t, *y)[0] if self.stops else []
        for i, gap in enumerate(gaps):
            if sense[count + i] == OPEN:
                values.append(gap)
                labels.append(("met", count + i))
        if rest:
            values.append(self.reserve(force, Z, N)[0])
            labels.append(("yields", None))
        return np.array(values), labels

    def begun(self, t: float, y: np.ndarray) -> list[int]:
        """Senses of a state, from nothing but speeds, gaps and normal forces."""
        count = len(self.contacts)
        sense = [FREE] * count + [OPEN] * len(self.stops)
        *_, N, u, v = self.at(t, y, sense)
        size, standing = 1.0 + np.abs(v).max(), []
        ahead = self.touch(t + 1e-7, *y)[1]
        for c, touch in enumerate(self.contacts):
            if touch.opens and (N[c] < 0.0 or (N[c] == 0.0 and ahead[c] <= 0.0)):
                sense[c] = OPEN
            elif abs(u[c]) <= SLOW * size:
                standing.append(c)
            else:
                sense[c] = int(np.sign(u[c]))
        for i, gap in enumerate(self.gaps(t, *y)[0] if self.stops else []):
            row, rate, _ = self.stop_rows(t, y)
            if gap < 1e-12 and row[i] @ v + rate[i] < SLOW:
                if row[i] @ v + rate[i] < -SLOW:
                    raise Unsure("begins on a stop, towards it")
                standing.append(count + i)
        return self.settle(t, y, sense, standing, {})

    def _slow(self, t, y, sense) -> list[int]:
        *_, u, v = self.at(t, y, sense)
        size = 1.0 + np.abs(v).max()
        slow = [c for c in range(len(u)) if sense[c] in (-1, 0, 1) and abs(u[c]) <= SLOW * size]
        return slow + [c for c in range(len(u), self.m) if sense[c] == 0]

    def changed(self, t: float, y: np.ndarray, sense: list[int], label: tuple) -> tuple[Any, list]:
        """State and senses behind an event."""
        kind, c = label
        if kind == "met":
            return self._impact(t, y, sense, c)
        sense = list(sense)
        if kind == "yields":
            rest = [i for i, s in enumerate(sense) if s == 0]
            return y, self.settle(t, y, sense, rest, self.yielding(t, y, sense))
        if kind == "opens":
            sense[c] = OPEN
        if kind in ("closes", "binds"):
            *_, u, v = self.at(t, y, sense)
            sense[c] = int(np.sign(u[c])) if abs(u[c]) > SLOW * (1 + np.abs(v).max()) else 0
        standing = sorted({*self._slow(t, y, sense), *([c] if kind == "stops" else [])})
        return y, self.settle(t, y, sense, standing, {})

    def _impact(self, t, y, sense, hit):
        count, first = len(self.contacts), self.n + self.k
        M = self.at(t, y, sense)[0]
        rows, rate, _ = self.stop_rows(t, y)
        i, u = hit - count, rows @ y[first:] + rate
        closed = [c - count for c in range(count, self.m) if sense[c] == 0]
        if u[i] >= 0.0:
            return y, sense

        def after(target):
            for some in itertools.chain.from_iterable(
                itertools.combinations(closed, r) for r in range(len(closed) + 1)
            ):
                K = [i, *some]
                inverse = np.linalg.solve(M, rows[K].T)
                need = np.array([target, *[0.0] * len(some)]) - u[K]
                impulse, _ = solved(rows[K] @ inverse, need)
                v = y[first:] + inverse @ impulse
                off = rows @ v + rate
                if (impulse >= -SLOW).all() and (off[closed] >= -SLOW).all():
                    return np.concatenate([y[:first], v]), off
            raise Unsure("an impact without an answer")

        def state(y, off, closes):
            new = list(sense)
            for c in range(count, self.m):
                new[c] = 0 if c - count in closes and abs(off[c - count]) <= SLOW else OPEN
            speeds = self.at(t, y, new)[6]
            size = 1.0 + np.abs(y[first:]).max()
            for c in range(count):
                if new[c] in (-1, 0, 1):
                    new[c] = int(np.sign(speeds[c])) if abs(speeds[c]) > SLOW * size else 0
            standing = [c for c, s in enumerate(new) if s == 0]
            return self.settle(t, y, new, standing, {})

        bounce = -self.restitution[i] * u[i]
        if bounce <= self.rest_speed[i]:
            still, off = after(0.0)
            if all(off[j] <= self.rest_speed[j] for j in closed):
                new = state(still, off, [i, *closed])
                if new[hit] == 0:
                    return still, new
        z, off = after(bounce)
        return z, state(z, off, [*closed, *([i] if bounce == 0.0 else [])])

    def _slope(self, sense):
        def slope(t, y):
            a, _, _, rates, _, _ = self.motion(t, y, sense)
            return np.concatenate([y[self.n + self.k :], rates, a])

        return slope

    def run(self, ts: np.ndarray) -> tuple[np.ndarray, float]:
        """States at the times `ts`, NaN where the motion has ended; and the time at which it ended."""
        out = np.full((len(ts), len(self.y0)), np.nan)
        t, y, events, wait = 0.0, self.y0.copy(), 0, 0.0
        out[0] = y
        if self.form:
            return self._smooth(ts, out)
        for end in self.jumps:
            self.span = (t + 1e-13 * (1 + t) * (t > 0), end - 1e-13 * (1 + end) * (end < self.end))
            sense = self.begun(t, y) if t == 0.0 else self._behind(t, y, sense)
            while t < end - 1e-13:
                found = self._until(t, y, end, sense, ts, out)
                t, y, label = found
                if label is None:
                    break
                if label[0] == "ends":
                    return out[:, self._shown], t
                y, sense = self.changed(t, y, sense, label)
                events, wait = (events + 1, wait) if t - wait < 1e-10 else (0, t)
                if events > 40:
                    raise Unsure("events without end")
            t = end
        return out[:, self._shown], self.end

    @property
    def _shown(self) -> list[int]:
        return [*self.kept, *range(self.n, len(self.y0))]

    def _behind(self, t, y, sense):
        """Senses behind a jump of the load."""
        N = self.at(t, y, sense)[5]
        new = [s if s != FREE else 0 for s in sense]
        *_, u, v = self.at(t, y, new)
        for c, touch in enumerate(self.contacts):
            if touch.opens and (new[c] == OPEN) != (N[c] <= 0.0):
                new[c] = OPEN if N[c] <= 0.0 else 0
            if new[c] == 0 and abs(u[c]) > SLOW * (1 + np.abs(v).max()):
                new[c] = int(np.sign(u[c]))
        return self.settle(t, y, new, self._slow(t, y, new), {})

    def _until(self, t, y, end, sense, ts, out):
        """On to the next event or to `end`; writes the outputs passed."""
        solver = DOP853(
            self._slope(sense), t, y, end, max_step=self.longest, rtol=self.rtol, atol=1e-13
        )
        before, labels = self.guards(t, y, sense)
        before = np.maximum(before, 1e-300)
        times, values = [t], [before]
        while solver.status == "running":
            if solver.step():
                raise Unsure("the reference's steps end")
            dense = solver.dense_output()
            event = None
            for x in np.linspace(solver.t_old, solver.t, 5)[1:]:
                now = self.guards(x, dense(x), sense)[0]
                times, values = [*times[-2:], x], [*values[-2:], now]
                if (now < 0.0).any():
                    event = self._first(dense, max(times[-2], solver.t_old), x, values[-2], now, sense)
                    break
                dip = self._dip(times, values)
                if dip is not None and solver.t_old <= dip <= solver.t:
                    low = self.guards(dip, dense(dip), sense)[0]
                    if (low < 0.0).any():
                        event = self._first(dense, solver.t_old, dip, values[0], low, sense)
                        break
            last = solver.t if event is None else event[0]
            passed = (ts > solver.t_old) & (ts <= last)
            for i in np.flatnonzero(passed):
                out[i] = dense(ts[i])
            if event is not None:
                return event[0], dense(event[0]), labels[event[1]]
        return end, solver.y.copy(), None

    def _first(self, dense, a, b, before, after, sense):
        """Time and number of the first guard that is negative at `b`."""
        found = []
        for i in np.flatnonzero(after < 0.0):

            def value(x, i=i):
                return self.guards(x, dense(x), sense)[0][i] if x > a else max(before[i], 1e-300)

            found.append((brentq(value, a, b, xtol=1e-14, rtol=1e-15) if before[i] > 0 else a, i))
        return min(found)

    def _dip(self, times, values):
        """Where a guard may have been negative between three times."""
        if len(times) < 3:
            return None
        (a, b, c), (x, y, z) = times, values
        for i in np.flatnonzero((y < x) & (y < z)):
            p = np.polyfit([a - b, 0.0, c - b], [x[i], y[i], z[i]], 2)
            if p[0] > 0 and p[2] - p[1] ** 2 / (4 * p[0]) < 0.1 * y[i]:
                return b - p[1] / (2 * p[0])
        return None

    def _smooth(self, ts, out):
        """The smooth forms: one mode."""
        count, first = len(self.contacts), len(self.y0)
        bristles = isinstance(self.given, dict)

        def parts(t, yz):
            y, every = yz[:first], tuple(range(count))
            N = self.touch(min(max(t, self.span[0]), self.span[1]), *y)[1]
            sense = [OPEN if c.opens and N[i] < 0.0 else FREE for i, c in enumerate(self.contacts)]
            M, f, rates, rows, _, N, u, v = self.at(t, y, sense, every)
            z_rates = np.zeros(len(yz) - first)
            for c, law in enumerate(self.laws):
                way, load = 1 if u[c] >= 0 else -1, max(N[c], 0.0) if self.contacts[c].opens else N[c]
                size = way * law.kinetic(u[c], way)
                peak = law.static(way) - way * law.kinetic(0.0, way)
                if bristles:
                    v_s = self.given.get("v_s")
                    g = size + (peak * np.exp(-((u[c] / v_s) ** 2)) if v_s else 0.0)
                    z_rates[c] = u[c] - self.given["sigma_0"] * abs(u[c]) / g * yz[first + c]
                    mu = self.given["sigma_0"] * yz[first + c] + self.given["sigma_1"] * z_rates[c]
                else:
                    x = u[c] / (10 * self.given)
                    mu = np.tanh(u[c] / self.given) * size + peak * np.exp(0.5 - 0.5 * x * x) * x
                if load > 0.0 or not self.contacts[c].opens:
                    f = f - rows[c] * (mu * load + law.drag(u[c]))
            return np.concatenate([v, rates, np.linalg.solve(M, f), z_rates]), N

        y, t = np.concatenate([self.y0, np.zeros(count if bristles else 0)]), 0.0
        for end in self.jumps:
            self.span = (t + 1e-13 * (1 + t) * (t > 0), end - 1e-13 * (1 + end) * (end < self.end))
            solver = DOP853(
                lambda t, y: parts(t, y)[0],
                t,
                y,
                end,
                max_step=self.longest,
                rtol=self.rtol,
                atol=1e-13,
            )
            while solver.status == "running":
                # Bristles whose friction falls to 0 with the speed are stiff without bound.
                if solver.nfev > MOST_CALLS or not np.isfinite(solver.y).all() or solver.step():
                    raise Unsure("the reference's steps end")
                dense, ends = solver.dense_output(), []
                N = parts(solver.t, solver.y)[1]
                for c, touch in enumerate(self.contacts):

                    def load(x, c=c, dense=dense):
                        return parts(x, dense(x))[1][c]

                    if N[c] < 0 and not touch.opens:
                        presses = load(solver.t_old) > 0
                        ends.append(brentq(load, solver.t_old, solver.t) if presses else solver.t_old)
                for i in np.flatnonzero((ts > solver.t_old) & (ts <= min([solver.t, *ends]))):
                    out[i] = dense(ts[i])[:first]
                if ends:
                    return out[:, self._shown], min(ends)
            t, y = end, solver.y
        return out[:, self._shown], self.end
