"""The jointed beam in plain NumPy and SciPy, from the paper's equations, for comparison.

Written apart from the package: dimensionless, one function a phase, phases joined by SciPy's events.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

PARAMETERS = dict(m=0.1, k1=0.25, k2=7.6, k3=22.8, mu_s=0.30, gamma=10.0, z_A=0.4)


class Run(NamedTuple):
    """States `[time, component]` in the order x, vx, y, vy, q..., p...; phases as (start, name)."""

    t: np.ndarray
    y: np.ndarray
    phases: list


def simulate(v, t, *, modes=5, x0=9.2e-4, printed=False, tolerance=1e-12, **changes) -> Run:
    """States at the times `t`, which start at 0."""
    p = {**PARAMETERS, **changes}
    m, k1, k2, k3, mu, gamma = (p[k] for k in ("m", "k1", "k2", "k3", "mu_s", "gamma"))
    i = np.arange(1, modes + 1)
    omega2 = (i * np.pi) ** 4
    phi = (1.0 if printed else np.sqrt(2.0)) * np.sin(i * np.pi * p["z_A"])
    beam_stiffness = k2 if printed else k1

    def parts(s):
        return s[0], s[1], s[2], s[3], s[4 : 4 + modes], s[4 + modes :]

    def joint(s):
        return k1 * (s[2] - phi @ s[4 : 4 + modes])

    def rhs(phase, s):
        x, vx, y, vy, q, qd = parts(s)
        N = 0.0 if phase == "apart" else k3 * x
        if phase == "stick":
            ay = 0.0
        elif phase == "apart":
            ay = -joint(s) / m
        else:
            V, sign = vy - v, 1.0 if phase == "forward" else -1.0
            weakening = 1 + gamma * (V if printed else sign * V)
            ay = (-joint(s) - sign * mu * N / weakening) / m
        pull = phi * (y - phi * q) if printed else phi * (y - phi @ q)
        qdd = -omega2 * q + beam_stiffness * pull
        return np.concatenate([[vx, -(k2 * x + N) / m, vy, ay], qd, qdd])

    def at_rest(s):
        limit = mu * k3 * s[0]
        return "stick" if abs(joint(s)) <= limit else ("backward" if joint(s) > 0 else "forward")

    def events(phase):
        """Functions that end the phase, all from positive to negative, and what they lead to."""
        if phase == "apart":
            return [(lambda s: -s[0], "contact")]
        found = [(lambda s: s[0], "apart")]
        if phase == "stick":
            found.append((lambda s: mu * k3 * s[0] - joint(s), "backward"))
            found.append((lambda s: mu * k3 * s[0] + joint(s), "forward"))
        else:
            sign = 1.0 if phase == "forward" else -1.0
            found.append((lambda s: sign * (s[3] - v), "rest"))
        return found

    state = np.zeros(4 + 2 * modes)
    state[0], state[3] = x0, v
    phase, now, end = at_rest(state), 0.0, float(t[-1])
    phases, rows = [(0.0, phase)], np.empty((len(t), state.size))
    done = 0
    while True:
        table = events(phase)
        functions = []
        for g, _ in table:

            def function(time, s, g=g, begin=now):
                # The event that began the phase is at zero there, to rounding.
                return g(s) if time > begin + 1e-9 else max(g(s), 1e-300)

            function.terminal, function.direction = True, -1.0
            functions.append(function)
        run = solve_ivp(
            lambda time, s, phase=phase: rhs(phase, s), (now, end), state, method="DOP853",
            rtol=tolerance, atol=tolerance * 1e-6, events=functions, dense_output=True, max_step=0.005,
        )  # fmt: skip
        inside = (t[done:] <= run.t[-1]).sum()
        if inside:
            rows[done : done + inside] = run.sol(t[done : done + inside]).T
        done += inside
        if run.status == 0:
            return Run(t, rows, phases)
        hit = next(k for k, times in enumerate(run.t_events) if times.size)
        now, state = float(run.t_events[hit][0]), run.y_events[hit][0].copy()
        leads_to = table[hit][1]
        if leads_to == "apart":
            state[0], phase = 0.0, "apart"
        elif leads_to == "contact":
            state[0], phase = 0.0, "forward" if state[3] > v else "backward"
        elif leads_to == "rest":
            state[3] = v
            phase = at_rest(state)
        else:
            state[3], phase = v, leads_to
        phases.append((now, phase))
