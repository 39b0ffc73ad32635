"""Independent reference: Moreau-Jean time stepping on the eight contacts, NumPy and SciPy only.

Velocities (x, y, omega_1, omega_2), SI units; nothing is shared with the package. In each step

    v+ = v + Mc^-1 (h F + h W lambda),   lambda_c in [-top_c, bottom_c] ,

a box-constrained least-squares problem in the friction forces. A contact at rest has its static limit
on both sides. One that slides has its kinetic friction ahead and, should it come through rest within
the step, its static limit behind (rule A12). First order in h.
"""

import numpy as np
from scipy.optimize import lsq_linear

TABLE = dict(
    m=0.5, M=1.0, J=1e-3, Jp=5e-4, r=0.05, R=0.9, Kt=2.0, Ke=0.03, mu_s=0.4, mu_k=0.1, mu_kb=(0.2, 0.2)
)
SCENARIOS = {
    1: dict(TABLE, P=(20.0, 20.0), v0=(10.0, 5.0), mu_sb=(10.0, 0.1), square=False),
    2: dict(TABLE, P=(30.0, 30.0), v0=(20.0, 10.0), mu_sb=(0.001, 0.001), square=False),
    3: dict(TABLE, P=(20.0, 30.0), v0=(20.0, 10.0), mu_sb=(10.0, 10.0), square=True),
}
REST = 1e-9


class Reference:
    """The machine of one scenario, stepped with length `h` [s]."""

    def __init__(self, scenario: dict, h: float):
        s, r = scenario, scenario["r"]
        P1, P2 = s["P"]
        g, root = 9.81, 2 * np.sqrt(2.0)
        self.s, self.h = s, h
        self.mass = np.array(
            [s["m"] + 8 * s["Jp"] / r**2, s["M"] + s["m"] + 4 * s["Jp"] / r**2, s["J"], s["J"]]
        )
        # Force on a rail, torque on a motor pulley, force in a belt, each with its sliding speed.
        self.W = np.array(
            [[1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0], [1, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1],
             [-1, -1, r, 0], [-1, 1, 0, r]], float
        )  # fmt: skip
        load = np.array(
            [s["m"] * g + root * (P1 + P2), (s["M"] + s["m"]) * g, root * P1, root * P2,
             2 * P1 * r, 2 * P2 * r, 2 * P1, 2 * P2]
        )  # fmt: skip
        kinetic = np.array([s["mu_k"]] * 6 + list(s["mu_kb"]))
        static = np.array([s["mu_s"]] * 6 + list(s["mu_sb"]))
        self.kinetic, self.static = kinetic * load, np.maximum(static, kinetic) * load
        root_mass = np.sqrt(self.mass)
        self.half = (self.W / root_mass).T * h
        self.root_mass = root_mass
        self.last = None

    def voltage(self, t):
        a = 2 * np.pi * 0.5 * t
        wave = (np.sin(a), np.cos(a))
        if self.s["square"]:
            wave = np.sign(wave)
        return np.array(self.s["v0"]) * wave

    def step(self, t, v, sense):
        """Velocities and senses after the step from `t`."""
        s, h = self.s, self.h
        torque = s["Kt"] / s["R"] * (self.voltage(t + 0.5 * h) - s["Ke"] * v[2:])
        free = v + h * np.concatenate([[0.0, 0.0], torque]) / self.mass
        low = np.where(sense > 0, -self.kinetic, -self.static)
        high = np.where(sense < 0, self.kinetic, self.static)
        found = self._guess(free, low, high, sense)
        if found is None:
            found = self._solve(free, low, high)
        return found

    def _guess(self, free, low, high, sense):
        """Everything goes on as it is: resting contacts hold, sliding ones keep their sense."""
        rest = sense == 0
        force = np.where(sense > 0, low, np.where(sense < 0, high, 0.0))
        v = free + self.h * (force @ self.W) / self.mass
        if rest.any():
            W = self.W[rest]
            inverse = self._inverse(rest, W)
            needed = -inverse @ (W @ v)
            if np.any(needed < low[rest]) or np.any(needed > high[rest]):
                return None
            v = v + self.h * (needed @ W) / self.mass
        speed = self.W @ v
        if np.any(speed * sense < 0) or np.any((np.abs(speed) < REST) & ~rest):
            return None
        return v, sense

    def _inverse(self, rest, W):
        key = rest.tobytes()
        if self.last is None or self.last[0] != key:
            self.last = (key, np.linalg.pinv(self.h * (W / self.mass) @ W.T, rcond=1e-9))
        return self.last[1]

    def _solve(self, free, low, high):
        found = lsq_linear(
            self.half, -self.root_mass * free, (low, high), method="bvls", tol=1e-14, max_iter=200
        )
        v = free + self.h * (found.x @ self.W) / self.mass
        speed = self.W @ v
        sense = np.where(np.abs(speed) < REST, 0, np.sign(speed))
        return v, sense

    def run(self, t1: float, every: int):
        """Times, positions [n, 4], velocities [n, 4] and senses [n, 8] every so many steps."""
        steps = round(t1 / self.h)
        v, position, sense = np.zeros(4), np.zeros(4), np.zeros(8)
        rows = [(0.0, position, v, sense)]
        for k in range(steps):
            new, sense = self.step(k * self.h, v, sense)
            position = position + 0.5 * self.h * (v + new)
            v = new
            if (k + 1) % every == 0:
                rows.append(((k + 1) * self.h, position, v, sense))
        return [np.array(column) for column in zip(*rows, strict=True)]
