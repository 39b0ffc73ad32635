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

    def joint(s):
        return k1 * (s[2] - phi @ s[4 : 4 + modes])

    def linear(phase):
        """Matrix of the phase without the friction: rows x', vx', y', vy', q', q''."""
        size = 4 + 2 * modes
        A = np.zeros((size, size))
        A[0, 1] = A[2, 3] = 1.0
        A[1, 0] = -(k2 + (0.0 if phase == "apart" else k3)) / m
        if phase != "stick":
            A[3, 2], A[3, 4 : 4 + modes] = -k1 / m, k1 * phi / m
        A[4 : 4 + modes, 4 + modes :] = np.eye(modes)
        A[4 + modes :, 2] = beam_stiffness * phi
        coupling = np.diag(phi * phi) if printed else np.outer(phi, phi)
        A[4 + modes :, 4 : 4 + modes] = -np.diag(omega2) - beam_stiffness * coupling
        return A

    matrices = {phase: linear(phase) for phase in ("stick", "forward", "backward", "apart")}

    def field(phase):
        A, sign = matrices[phase], {"forward": 1.0, "backward": -1.0}.get(phase, 0.0)

        def rhs(_, s):
            rate = A @ s
            if sign:
                V = s[3] - v
                rate[3] -= sign * mu * k3 * s[0] / (1 + gamma * (V if printed else sign * V)) / m
            return rate

        return rhs

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
            field(phase), (now, end), state, method="DOP853", rtol=tolerance, atol=tolerance * 1e-6,
            events=functions, dense_output=True, max_step=0.02,
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
