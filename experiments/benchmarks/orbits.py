"""Branch of the smooth block's periodic orbits with its first doubling, against SciPy and AUTO.

Set A, k3 from 78 N/m on. SciPy: DOP853, shooting with derivatives by central differences, one k3 after
the other, the doubling by Brent's method on the multiplier. AUTO: collocation, as `xpplab` carries it.
"""

import time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import Follow, OrbitGuess, Shooting, continue_orbit
from stickslip.systems import BlockState

from . import _orbits_auto
from ._diagram_job import Case, plain_field, set_a
from ._harness import absent

LOW, HIGH = 78.0, 85.0  # [N/m]
STEP = 0.35  # [N/m], of all three
TOLERANCE = 1e-11
SETTLED = 60.0  # [s]
BESIDE = 1e-5  # of the motion's size: half the distance of a difference
NEWTON, CLOSE = 12, 1e-10


def start(case: Case) -> tuple[np.ndarray, float]:
    """A state (x, y, vx, vy) at a maximum of x of the settled motion at `LOW`, and its period [s]."""
    field = plain_field(case)

    def top(t, s, k3):
        return s[2]

    top.direction = -1.0
    begin = np.array([*case.start, 0.0, 0.0])
    options: dict[str, Any] = {"args": (LOW,), "rtol": 1e-9, "atol": 1e-12}
    settled = solve_ivp(field, (0.0, SETTLED), begin, "LSODA", **options).y[:, -1]
    run = solve_ivp(field, (0.0, 2.0), settled, "LSODA", events=top, **options)
    times = run.t_events[0]
    return np.asarray(run.y_events[0][0]), float(times[1] - times[0])


def ours(case: Case, state: np.ndarray, period: float):
    """Orbits as rows (k3, period), doublings alike."""
    x, y, vx, vy = map(float, state)
    branch = continue_orbit(
        case.system(LOW),
        OrbitGuess(BlockState(x, vx, y, vy), period),
        "k3",
        (LOW - STEP, HIGH),
        follow=Follow(step=STEP / (HIGH - LOW + STEP), both=False),
        shooting=Shooting(integrator=ss.Integrator("tsit5", ss.AdaptiveStep(TOLERANCE))),
    )
    flips = [(p.value, float(p.orbit.period)) for p in branch["PD"]]
    return np.column_stack([branch.values, np.asarray(branch.orbits.period)]), np.array(flips)


def by_scipy(case: Case, state: np.ndarray, period: float):
    """The same by shooting."""
    field = plain_field(case)
    sizes = np.array([0.1, 0.1, 0.3, 0.3])

    def end(s, T, k3):
        options: dict[str, Any] = {"rtol": TOLERANCE, "atol": 0.01 * TOLERANCE}
        return solve_ivp(field, (0.0, T), s, "DOP853", args=(k3,), **options).y[:, -1]

    def monodromy(s, T, k3):
        moves = BESIDE * np.diag(sizes)
        ends = [end(s + d, T, k3) - end(s - d, T, k3) for d in moves]
        return np.transpose(ends) / (2.0 * BESIDE * sizes)

    def orbit(s, T, k3):
        begin, plane = s, np.array(field(0.0, s, k3))
        matrix = monodromy(s, T, k3)
        for _ in range(NEWTON):
            last = end(s, T, k3)
            left = np.zeros((5, 5))
            left[:4, :4], left[:4, 4] = matrix - np.eye(4), field(0.0, last, k3)
            left[4, :4] = plane
            move = np.linalg.solve(left, -np.append(last - s, plane @ (s - begin)))
            s, T = s + move[:4], T + move[4]
            if np.abs(move).max() < CLOSE:
                break
        return s, T

    rows, flips, before = [], [], None
    for k3 in np.arange(LOW, HIGH, STEP):
        state, period = orbit(state, period, k3)
        rows.append((k3, period))
        least = float(np.linalg.eigvals(monodromy(state, period, k3)).real.min()) + 1.0
        if before is not None and before * least < 0.0:

            def wrong(k3, s=state, T=period):
                s, T = orbit(s, T, k3)
                return float(np.linalg.eigvals(monodromy(s, T, k3)).real.min()) + 1.0

            at: Any = brentq(wrong, k3 - STEP, k3, xtol=1e-9)
            flips.append((float(at), orbit(state, period, float(at))[1]))
        before = least
    return np.array(rows), np.array(flips)


def compare(*, with_auto: bool = True) -> list[dict[str, Any]]:
    """A row for each: seconds of two calls, orbits, doubling, and by how much they differ from ours."""
    case = set_a()
    state, period = start(case)
    ways = {"stickslip": ours, "SciPy, differences": by_scipy}
    if with_auto:
        ways["AUTO (xpplab)"] = lambda case, s, T: _orbits_auto.branch(case, s, T, LOW, HIGH, STEP)
    rows: list[dict[str, Any]] = []
    reference = None
    for name, way in ways.items():
        laps = []
        for _ in range(2):
            begin = time.perf_counter()
            found, flips = way(case, state, period)
            laps.append(time.perf_counter() - begin)
        if reference is None:
            order = np.argsort(found[:, 0])
            reference = CubicSpline(found[order, 0], found[order, 1]), flips[0, 0]
        inside = (found[:, 0] >= LOW) & (found[:, 0] <= HIGH)
        off = np.abs(reference[0](found[inside, 0]) - found[inside, 1])
        rows.append({
            "name": name, "first": laps[0], "again": laps[1], "orbits": int(inside.sum()),
            "flip": float(flips[0, 0]), "off": float(flips[0, 0] - reference[1]),
            "period": float(off.max()),
        })  # fmt: skip
    return rows


def main(size: str = "normal") -> str:
    """Table of all that are there."""
    missing = absent("xpplab")
    lines = [
        f"Branch over k3 from {LOW:g} to {HIGH:g} N/m in steps of {STEP:g} N/m at most",
        f"  {'':24s} {'first s':>9s} {'again s':>9s} {'orbits':>7s} {'doubling':>15s} "
        f"{'- ours':>9s} {'period':>9s}",
    ]
    for row in compare(with_auto=not missing):
        lines.append(
            f"  {row['name']:24s} {row['first']:9.2f} {row['again']:9.2f} {row['orbits']:7d} "
            f"{row['flip']:15.8f} {row['off']:9.1e} {row['period']:9.1e}"
        )
    if missing:
        lines.append("  AUTO (xpplab): absent, not measured")
    return "\n".join(lines)
