"""DMN1-4 against the printed equations and against Lagrange's equations with the belt constraint."""

import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
from tests.corexy_jax._random import frictions, machine

AS_PRINTED, CORRECTED = cx.Errata(), cx.Errata.corrected()
ROLLS = {1: (1, 1), 2: (0, 1), 3: (1, 0), 4: (0, 0)}


def printed(number, p, f, torques):
    """Eqs. (38)-(40), (47)-(49), (56)-(58), (65)-(67), written out one by one."""
    m, M, J, Jp, r = (float(a) for a in (p.m, p.M, p.J, p.J_passive, p.r))
    t = {name: float(value) for name, value in f.pulleys._asdict().items()}
    t11, t12, t13, t14 = (t[f"theta_1_{i}"] for i in (1, 2, 3, 4))
    t21, t22, t23, t24 = (t[f"theta_2_{i}"] for i in (1, 2, 3, 4))
    t10, t20, fx, fy = (float(a) for a in (f.tau_1_0, f.tau_2_0, f.f_x, f.f_y))
    f1, f2, (e1, e2) = float(f.f_1_b), float(f.f_2_b), torques
    if number == 1:
        matrix = [[m * r + 8 * Jp / r + 2 * J / r, 0], [0, (M + m) * r + 4 * Jp / r + 2 * J / r]]
        b = [t10 + t11 + t12 + t13 + t14 + t20 + t21 + t22 + t23 + t24 + fx * r,
             t10 + t12 + t13 - t20 - t22 - t23 + fy * r]  # fmt: skip
        tau = [e1 + e2, e1 - e2]
    elif number == 2:
        matrix = [
            [m * r + 8 * Jp / r + J / r, -J / r], [-J / r, (M + m) * r + 4 * Jp / r + J / r]
        ]  # fmt: skip
        b = [t11 + t12 + t13 + t14 + t20 + t21 + t22 + t23 + t24 + fx * r,
             t12 + t13 - t20 - t22 - t23 + fy * r]  # fmt: skip
        tau = [f1 * r + e2, f1 * r - e2]
    elif number == 3:
        matrix = [
            [m * r + 8 * Jp / r + J / r, J / r], [J / r, (M + m) * r + 4 * Jp / r + J / r]
        ]  # fmt: skip
        b = [t10 + t11 + t12 + t13 + t14 + t21 + t22 + t23 + t24 + fx * r,
             t10 + t12 + t13 - t22 - t23 + fy * r]  # fmt: skip
        tau = [e1 + f2 * r, e1 - f2 * r]
    else:
        matrix = [[m * r + 8 * Jp / r, 0], [0, (M + m) * r + 4 * Jp / r]]
        b = [t11 + t12 + t13 + t14 + t21 + t22 + t23 + t24 + fx * r, t12 + t13 - t22 - t23 + fy * r]
        tau = [f1 * r + f2 * r, f1 * r - f2 * r]
    return matrix, b, tau


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_every_entry_is_the_printed_one(number):
    torques = (jnp.asarray(1.3), jnp.asarray(-0.7))
    for seed in range(3):
        p, f = machine(seed), frictions(seed)
        model = cx.dynamic_model(number, p, f, torques)
        direct = (cx.dmn_1, cx.dmn_2, cx.dmn_3, cx.dmn_4)[number - 1](p, f, torques, AS_PRINTED)
        for name, expected in zip(("M", "b", "tau"), printed(number, p, f, (1.3, -0.7)), strict=True):
            np.testing.assert_allclose(getattr(model, name), expected, rtol=1e-13, atol=1e-15)
            np.testing.assert_allclose(getattr(direct, name), expected, rtol=1e-13, atol=1e-15)


def lagrange(number, p, f, torques):
    """Equations of motion from energy and virtual work with the belt as the only constraint.

    Generalised speeds: x, y and those of the slipping motor pulleys. Every part's friction does work
    on that part's own motion; a slipping belt feels the opposite of what it does to the pulley.
    """
    r = float(p.r)

    def speeds(v):
        vx, vy, w1, w2 = v
        u, w = (vx + vy) / r, (vx - vy) / r
        passive = np.array([-vx / r, u, u, vx / r, -vx / r, w, w, vx / r])
        motors = np.where(ROLLS[number], [u, w], [w1, w2])
        return passive, motors, np.array([u, w])

    def energy(v):
        passive, motors, _ = speeds(v)
        return 0.5 * (
            p.m * (v[0] ** 2 + v[1] ** 2) + p.M * v[1] ** 2
            + p.J_passive * np.sum(passive**2) + p.J * np.sum(motors**2)
        )  # fmt: skip

    def power(v):
        passive, motors, virtual = speeds(v)
        belts = np.array([f.f_1_b, f.f_2_b]) * r * (motors - virtual)
        drives = (np.array([f.tau_1_0, f.tau_2_0]) + torques) * motors
        return f.f_x * v[0] + f.f_y * v[1] + np.sum(passive * f.pulleys) + np.sum(belts + drives)

    # The energy is quadratic and the power linear in the speeds: these differences are exact.
    unit = np.eye(4)
    matrix = [[energy(a + b) - energy(a) - energy(b) for b in unit] for a in unit]
    return np.array(matrix, float), np.array([power(a) for a in unit], float)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_corrected_models_are_lagranges(number):
    torques = np.array([1.3, -0.7])
    p, f = machine(number), frictions(number)
    matrix, right = lagrange(number, p, f, torques)
    model = cx.dynamic_model(number, p, f, tuple(map(jnp.asarray, torques)), CORRECTED)
    np.testing.assert_allclose(model.M, matrix[:2, :2] * p.r, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(model.b + model.tau, right[:2] * p.r, rtol=1e-12)
    slipping = [
        cx.slipping_motor(p, torques[0], f.tau_1_0, f.f_1_b),
        cx.slipping_motor(p, torques[1], f.tau_2_0, f.f_2_b),
    ]
    for i in range(2):
        assert (matrix[2 + i, 2 + i] == 0) == bool(ROLLS[number][i])
        if not ROLLS[number][i]:
            np.testing.assert_allclose(slipping[i], right[2 + i] / matrix[2 + i, 2 + i], rtol=1e-12)


@pytest.mark.parametrize("erratum", ["A1", "A2"])
def test_each_erratum_changes_the_models(erratum):
    p, f = machine(0), frictions(0)
    wrong = cx.Errata.corrected(**{erratum: False})
    torques = (jnp.asarray(1.0), jnp.asarray(2.0))
    for number, model in enumerate((cx.dmn_1, cx.dmn_2, cx.dmn_3, cx.dmn_4), start=1):
        printed_one, right = model(p, f, torques, wrong), model(p, f, torques, CORRECTED)
        gap = float(jnp.max(jnp.abs(printed_one.b + printed_one.tau - right.b - right.tau)))
        assert (gap > 1e-3) == (erratum == "A1" or number > 1)


def test_printed_belt_reaction_creates_energy_and_the_corrected_one_does_not():
    p = machine(3)
    f_1, f_2 = cx.belt_friction(p, jnp.asarray(1.0), jnp.asarray(-1.0))
    # Pulleys faster and slower than belts that run at 5 and 4 rad/s, far from standing.
    omega, virtual = np.array([5.5, 3.5]), np.array([5.0, 4.0])
    f = frictions(0)._replace(f_1_b=f_1, f_2_b=f_2)
    zero = (jnp.asarray(0.0),) * 2
    torque = np.array([float(f_1), float(f_2)]) * float(p.r)
    carriage = np.array([virtual.sum(), virtual[0] - virtual[1]]) / 2
    power = {}
    for name, errata in (("printed", AS_PRINTED), ("corrected", CORRECTED)):
        rows = np.asarray(cx.dynamic_model(4, p, f, zero, errata).tau)
        power[name] = rows @ carriage + torque @ omega
    np.testing.assert_allclose(power["corrected"], torque @ (omega - virtual), rtol=1e-12)
    np.testing.assert_allclose(power["printed"], torque @ (omega + virtual), rtol=1e-12)
    assert power["corrected"] < 0
    # Belt 2 drags its pulley forward and, as printed, is itself pushed forward too.
    assert float(f_2) * (omega[1] + virtual[1]) > 0
