"""How well a sweep tells the belts: a linear machine of its own, symmetry, directions."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import corexy_jax as cx
from corexy_jax.elastic import (
    Belts,
    ElasticCoreXY,
    Frame,
    Stepper,
    desktop_printer,
    expected_errors,
    resonance_sweep,
)

R = 0.00637
RATE, WINDOW, NOISE = 3200.0, 8, 0.1


def speeds(path, EA_1, EA_2, tau, h, count):
    """Speeds of the head by Runge and Kutta, of the linear machine in the middle of its frame."""
    elastic = np.zeros((4, 4))
    for EA, row in ((EA_1, [-1.0, -1.0, 1.0, 0.0]), (EA_2, [-1.0, 1.0, 0.0, 1.0])):
        elastic += EA * (1 / 0.4 + 1 / 1.2) * np.outer(row, row)
    field = np.diag([0.0, 0.0, 1.0, 1.0]) / R**2
    mass = np.array([0.35 + 8 * 2e-7 / R**2, 0.6 + 4 * 2e-7 / R**2, 8e-6 / R**2, 8e-6 / R**2])
    rates = np.zeros((8, 8))
    rates[:4, 4:] = np.eye(4)
    rates[4:, :4] = -(elastic + 150.0 * field) / mass[:, None]
    rates[4:, 4:] = -(tau * elastic + 1e-3 * field) / mass[:, None]
    times, begins = np.asarray(path.times), np.asarray(path.positions)
    t = 0.5 * h * np.arange(2 * count + 1)
    piece = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(begins) - 1)
    since = np.clip(t - times[piece], 0.0, np.diff(times)[piece])[:, None]
    v, a = np.asarray(path.velocities)[piece], np.asarray(path.accelerations)[piece]
    place = begins[piece] + since * (v + 0.5 * since * a)
    push = np.zeros((len(t), 8))
    push[:, 6:] = 150.0 / R**2 / mass[2:] * (place @ np.array([[1.0, 1.0], [1.0, -1.0]]))
    z, found = np.zeros(8), [np.zeros(2)]
    for i in range(0, 2 * count, 2):
        k1 = rates @ z + push[i]
        k2 = rates @ (z + 0.5 * h * k1) + push[i + 1]
        k3 = rates @ (z + 0.5 * h * k2) + push[i + 1]
        k4 = rates @ (z + h * k3) + push[i + 2]
        z = z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        found.append(z[4:6])
    return np.array(found)


def test_errors_are_those_of_a_machine_of_its_own():
    """Without friction, but for the least that is fitted; slopes by differences."""
    path = resonance_sweep((1.0, 1.0), 50.0, 80.0, 150.0, 0.06)
    p = cx.CoreXYParameters(
        m=0.35, M=0.25, J=8e-6, J_passive=2e-7, r=R, r_f=0.002, mu_s=0.0, mu_k=0.0, P1=1e-3, P2=1e-3
    )
    values = np.array([9e3, 1.05e4, 3e-4])
    drive = Stepper(path, 3.0, R, damping=1e-3)
    found = expected_errors(ElasticCoreXY(p, Belts(Frame(0.4, 0.4), *values), drive), path)
    size = int(RATE * (float(path.duration) + 0.1))
    edges = (np.arange(WINDOW, size, WINDOW) - 0.5) / RATE
    h = 1.0 / RATE / 8.0
    grid = h * np.arange(8 * size + 1)

    def means(EA_1, EA_2, tau, begin):
        v = CubicSpline(grid, speeds(path, EA_1, EA_2, tau, h, 8 * size))(edges - begin)
        rows = np.diff(v, axis=0) / np.diff(edges)[:, None]
        return (rows - rows.mean(axis=0)).ravel()

    at, steps = np.append(values, 0.0), np.array([9.0, 10.0, 1e-6, 1e-6])
    columns = [
        (means(*(at + step)) - means(*(at - step))) / (2.0 * np.max(step)) for step in np.diag(steps)
    ]
    slopes = np.stack(columns, axis=1) / (NOISE / WINDOW**0.5)
    expected = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    # Friction is one more unknown there, which costs a little.
    for k, name in enumerate(("EA_1", "EA_2")):
        assert 0.999 < found[name] / expected[k] < 1.05
    assert found["retardation"] > 0.999 * expected[2]


@pytest.mark.more
def test_sweeps_that_mirror_each_other_tell_the_same():
    printer = desktop_printer()
    p = cx.with_values(printer.parameters, {"mu_s": 0.015, "mu_k": 0.015})
    found = {}
    for direction in ((1, 1), (1, -1), (1, 0), (0, 1)):
        path = resonance_sweep(direction, 55.0, 95.0, 150.0, 0.06)
        drive = Stepper(path, printer.torque, p.r, damping=1e-3)
        found[direction] = expected_errors(ElasticCoreXY(p, printer.belts, drive), path)
    one, other = found[1, 1], found[1, -1]
    # But for the order in which the contacts are looked at.
    assert one["EA_1"] == pytest.approx(other["EA_2"], rel=1e-3)
    assert one["EA_2"] == pytest.approx(other["EA_1"], rel=1e-3)
    assert one["mu"] == pytest.approx(other["mu"], rel=1e-3)
    # Along an axis both belts are stretched alike.
    for along in ((1, 0), (0, 1)):
        assert min(found[along]["EA_1"], found[along]["EA_2"]) > 1e3 * max(one["EA_1"], one["EA_2"])
