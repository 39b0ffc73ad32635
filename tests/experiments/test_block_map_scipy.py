"""Points of the map's curve of doublings against returns computed with SciPy and differences alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments._experiment import chosen, load
from experiments.block._branches import precise
from experiments.block._map import system_at
from stickslip.continuation import Follow, Shooting, continue_orbit, continue_point, orbit_guess
from stickslip.systems import BlockState

# Set A as its page prints it.
m, M, r, g = 0.20, 0.21, 0.25, 9.81
J, Q = 3.0 * M * r**2, -0.75 * M * g * r
k1, k2, c1, c2 = 17.0, 11.0, 0.9965, 0.035
mu0, alpha, beta, gamma = 0.26, 190.0, 0.9, 1.75
H = 2e-5  # m and m/s: differences of four points, so that their error is some H**4
SOON = 0.3  # s after a maximum of x the next one has not come


def rates(t, s, k3, belt):
    """Eqs. (8) to (12) of the paper, from its page, for the state x, x', y, y'."""
    x, xd, y, yd = s
    stretch = k3 * (y + x * x / (2.0 * r))
    weight = M * g * 0.75 * (1.0 + y / r - y**2 / (2.0 * r**2) - y**3 / (6.0 * r**3))
    normal = m * g + weight - stretch - c2 * yd
    V = xd - belt
    bump = beta / np.cosh(min(alpha * abs(V), 300.0))
    friction = mu0 / (1.0 + gamma * abs(V)) * (1.0 + bump) * np.tanh(alpha * V) * normal
    xdd = (-friction - c1 * (xd + yd) - (k1 + k2) * x - k2 * y - x / r * stretch) / m
    left = c1 * (xd + yd) + c2 * yd + k2 * (x + y) + stretch + weight + Q / r
    return xd, xdd, yd, -left * r * r / J


def maximum(t, s, *_):
    return s[1]


maximum.direction = -1.0
maximum.terminal = True


def back(z, k3, belt):
    """From a maximum of x, given by x, y and y', to the next one; the time with it."""
    settings = {"args": (k3, belt), "method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    away = solve_ivp(rates, (0.0, SOON), [z[0], 0.0, z[1], z[2]], **settings)
    there = solve_ivp(rates, (SOON, 5.0), away.y[:, -1], events=maximum, **settings)
    assert there.status == 1
    return there.y_events[0][0][[0, 2, 3]], there.t_events[0][0]


def slopes(z, k3, belt):
    """Derivative of the return, by differences."""
    columns = []
    for e in np.eye(3):
        f = {k: back(z + k * H * e, k3, belt)[0] for k in (-2, -1, 1, 2)}
        columns.append((f[-2] - 8.0 * f[-1] + 8.0 * f[1] - f[2]) / (12.0 * H))
    return np.stack(columns, axis=1)


def orbit(z, k3, belt):
    """Newton's method; the maximum that returns, its period, multipliers."""
    jacobian = slopes(z, k3, belt)
    for _ in range(30):
        end, period = back(z, k3, belt)
        step = np.linalg.solve(jacobian - np.eye(3), z - end)
        z = z + step
        if np.abs(step).max() < 1e-11:
            return z, period, np.linalg.eigvals(slopes(z, k3, belt))
    raise AssertionError("no orbit")


def doubling(z, k3, belt):
    """k3 at which a multiplier is -1, by secants, and the period there."""
    a, b = k3 + 0.2, k3 - 0.1
    values = {}
    for _ in range(8):
        for k in (a, b):
            if k not in values:
                z, period, found = orbit(z, k, belt)
                values[k] = float(found[np.argmin(np.abs(found + 1.0))].real) + 1.0
        if abs(a - b) < 1e-7:
            break
        a, b = b, b - values[b] * (b - a) / (values[b] - values[a])
    return b, period


@pytest.mark.slow
def test_three_points_of_the_curve_are_doublings_of_returns_with_scipy():
    parameters = chosen(load()["block-map"], False, [])
    exact = precise(parameters)
    system = system_at("smooth", 72.0, 0.1)
    guess = orbit_guess(system, BlockState(0.0, 0.0, 0.0, 0.0), transient=60.0, max_period=2.0)
    branch = continue_orbit(
        system,
        guess,
        "k3",
        (54.0, 126.0),
        follow=Follow(step=0.02),
        shooting=Shooting(integrator=exact),
    )
    (first, *_) = branch["PD"]
    curve = continue_point(
        system_at("smooth", first.value, 0.1),
        first,
        ("k3", "V_b"),
        ((60.0, 116.0), (0.05, 0.18)),
        follow=Follow(step=0.04, max_points=100),
        shooting=Shooting(integrator=exact),
    )
    # On the left, past the top and on the lower side, none of them where the curve begins.
    speeds = curve.values[:, 1]
    top = int(np.argmax(speeds))
    picked = [top // 3, top + 3, len(curve) - 3]
    assert min(abs(curve.values[i, 0] - first.value) for i in picked) > 1.0
    for i in picked:
        k3, belt = curve.values[i]
        start = [float(np.asarray(leaf)[i]) for leaf in curve.orbits.y0]
        to_it = solve_ivp(
            rates, (0.0, 5.0), start, "DOP853", events=maximum, args=(k3, belt), rtol=1e-12, atol=1e-14
        )
        found, period = doubling(to_it.y_events[0][0][[0, 2, 3]], k3, belt)
        assert found == pytest.approx(k3, abs=1e-5)
        assert period == pytest.approx(float(curve.orbits.period[i]), abs=1e-7)
