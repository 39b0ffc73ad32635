"""The block on a belt and its drive in NumPy and SciPy, written from the equations without JAX."""

from dataclasses import dataclass, field
from math import cosh, sqrt, tanh

import numpy as np
from scipy.integrate import solve_ivp

G = 9.81


@dataclass
class Reference:
    """Eqs. (1)-(12) as printed, except for the two signs; `i` is the current, `w` the rotor's speed."""

    k3: float
    m: float = 0.20
    M: float = 0.21
    J: float = 0.039375
    k1: float = 17.0
    k2: float = 11.0
    c1: float = 0.9965
    c2: float = 0.035
    r: float = 0.25
    mu0: float = 0.26
    alpha: float = 190.0
    beta: float = 0.9
    gamma: float = 1.75
    V_b: float = 0.12
    Q: float = -0.75 * 0.21 * G * 0.25
    drive: dict = field(default_factory=dict)

    def lam(self, y):
        r, length = self.r, 3 * sqrt(2) / 4 * self.r
        return sqrt(2) * length / (2 * r) * (1 + y / r - y**2 / (2 * r**2) - y**3 / (6 * r**3))

    def normal(self, x, y, yd):
        stretch = y + x**2 / (2 * self.r)
        return self.m * G + self.M * G * self.lam(y) - self.k3 * stretch - self.c2 * yd

    def mu(self, v):
        bump = 1 + self.beta / cosh(min(abs(self.alpha * v), 700.0))
        return self.mu0 / (1 + self.gamma * abs(v)) * bump * tanh(self.alpha * v)

    def mu_slip(self, v, sense):
        return sense * self.mu0 / (1 + self.gamma * sense * v)

    def mu_static(self):
        s = np.linspace(0, 5, 2_000_001)
        return self.mu0 * np.max((1 + self.beta / np.cosh(s)) * np.tanh(s))

    def load_on_block(self, x, xd, y, yd):
        """Left-hand side of (8) without inertia."""
        r = self.r
        springs = (self.k1 + self.k2) * x + self.k2 * y + self.k3 * x / r * (y + x**2 / (2 * r))
        return (xd + yd) * self.c1 + springs

    def accelerations(self, x, xd, y, yd, T_s):
        r = self.r
        xdd = (-T_s - self.load_on_block(x, xd, y, yd)) / self.m
        forces = (xd + yd) * self.c1 + yd * self.c2 + self.k2 * (x + y)
        forces += self.k3 * (y + x**2 / (2 * r)) + self.M * G * self.lam(y)
        return xdd, (-self.Q / r - forces) / (self.J / r**2)

    def simplified(self, t, s):
        x, xd, y, yd = s
        T_s = self.mu(xd - self.V_b) * self.normal(x, y, yd)
        xdd, ydd = self.accelerations(x, xd, y, yd, T_s)
        return [xd, xdd, yd, ydd]

    def full(self, t, s, turning=1.0):
        x, xd, y, yd, w, i = s
        d = self.drive
        T_s = self.mu(xd - d["r_bp"] * w / d["rho"]) * self.normal(x, y, yd)
        xdd, ydd = self.accelerations(x, xd, y, yd, T_s)
        load = d["reaction"] * d["r_bp"] / (d["eta"] * d["rho"]) * T_s
        torque = d["k_m"] * i + load - d["b"] * w - d["friction"] * turning * d["T_k"]
        wd = torque / (d["J_dc"] + d["J_bp"] / (d["eta"] * d["rho"] ** 2))
        return [xd, xdd, yd, ydd, wd, (d["U_in"] - d["k_e"] * w - d["R_w"] * i) / d["L_w"]]


def drive_parameters(U_in, reaction=1.0, friction=1.0):
    """Constructed drive; the signs are +1 consistent, -1 as printed."""
    return {
        "L_w": 2e-3, "R_w": 2.0, "k_e": 0.05, "k_m": 0.05, "J_dc": 5e-5, "b": 2e-5, "T_k": 5e-3,
        "rho": 20.0, "eta": 0.6, "J_bp": 1e-4, "r_bp": 0.03, "U_in": U_in,
        "reaction": reaction, "friction": friction,
    }  # fmt: skip


def solve(rhs, s0, t_end, events=(), ts=None, tol=1e-12):
    """SciPy's DOP853 at its tightest useful tolerance."""
    out = solve_ivp(rhs, (0.0, t_end), s0, "DOP853", ts, events=events, rtol=tol, atol=tol)
    assert out.success
    return out


def poincare(model, rhs, s0, t_end):
    """Times and states where the acceleration of the block falls through zero, and the end state."""

    def acceleration(t, s):
        return rhs(t, s)[1]

    acceleration.direction = -1
    out = solve(rhs, s0, t_end, acceleration)
    return out.t_events[0], out.y_events[0], out.y[:, -1]


def set_valued(model, s0, t_end):
    """Stick and slip by hand on a belt of constant speed: events, Poincare points and the end state.

    Starts slipping backward. Returns `(event times, [(t, x)], end state)`.
    """
    mu_s, V_b = model.mu_static(), model.V_b
    t, s, sense = 0.0, np.array(s0, float), -1
    times, points = [], []

    def slip(sense):
        def rhs(t, s):
            x, xd, y, yd = s
            T_s = model.mu_slip(xd - V_b, sense) * model.normal(x, y, yd)
            xdd, ydd = model.accelerations(x, xd, y, yd, T_s)
            return [xd, xdd, yd, ydd]

        return rhs

    def stick(t, s):
        x, _, y, yd = s
        return [V_b, 0.0, yd, model.accelerations(x, V_b, y, yd, 0.0)[1]]

    def holding(s):
        return -model.load_on_block(s[0], V_b, s[2], s[3])

    while t < t_end:
        if sense:
            rhs = slip(sense)

            def ends(t, s, begun=t, sense=sense):
                # A slip begins at relative velocity zero.
                return 1.0 if t - begun < 1e-9 else sense * (s[1] - V_b)

            def falls(t, s, rhs=rhs):
                return rhs(t, s)[1]

            ends.terminal, ends.direction, falls.direction = True, -1, -1
            out = solve_ivp(rhs, (t, t_end), s, "DOP853", events=(ends, falls), rtol=1e-12, atol=1e-12)
            points += list(zip(out.t_events[1], [y[0] for y in out.y_events[1]], strict=True))
        else:

            def upper(t, s):
                return mu_s * model.normal(s[0], s[2], s[3]) - holding(s)

            def lower(t, s):
                return mu_s * model.normal(s[0], s[2], s[3]) + holding(s)

            upper.terminal = lower.terminal = True
            out = solve_ivp(
                stick, (t, t_end), s, "DOP853", events=(upper, lower), rtol=1e-12, atol=1e-12
            )
        t, s = out.t[-1], out.y[:, -1].copy()
        if out.status == 0:
            break
        times.append(t)
        if sense:
            before = slip(sense)(t, s)[1]
            s[1] = V_b
            load, limit = holding(s), mu_s * model.normal(s[0], s[2], s[3])
            sense = 1 if load > limit else -1 if load < -limit else 0
            after = slip(sense)(t, s)[1] if sense else 0.0
            if before > 0 and after <= 0:
                points.append((t, s[0]))
        else:
            sense = 1 if len(out.t_events[0]) else -1
    return np.array(times), points, s
