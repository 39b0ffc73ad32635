"""DMN1-4 against the printed equations and against Lagrange's equations with the belt constraint."""

import jax.numpy as jnp
import numpy as np
import pytest
import sympy as sp

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
            np.testing.assert_array_equal(getattr(direct, name), getattr(model, name))


def lagrange(number):
    """Equations of motion from energy and virtual work, by SymPy, the belt as the only constraint.

    Generalised speeds: x, y and those of the slipping motor pulleys. Every part's friction does work
    on that part's own motion; a slipping belt feels the opposite of what it does to the pulley.
    """
    vx, vy, w1, w2, ax, ay = sp.symbols("vx vy w1 w2 ax ay")
    m, M, J, Jp, r, fx, fy, t10, t20, e1, e2, f1, f2 = sp.symbols(
        "m M J Jp r fx fy t10 t20 e1 e2 f1 f2"
    )
    tau = sp.symbols("t11 t12 t13 t14 t21 t22 t23 t24")
    # Belt speed over each pulley, turning senses as in Fig. 2.
    u, w = (vx + vy) / r, (vx - vy) / r
    passive = [-vx / r, u, u, vx / r, -vx / r, w, w, vx / r]
    rolls = ROLLS[number]
    motors = [u if rolls[0] else w1, w if rolls[1] else w2]
    energy = sp.Rational(1, 2) * (
        m * (vx**2 + vy**2)
        + M * vy**2
        + Jp * sum(s**2 for s in passive)
        + J * sum(s**2 for s in motors)
    )
    power = fx * vx + fy * vy + sum(t * s for t, s in zip(tau, passive, strict=True))
    power += (t10 + e1) * motors[0] + (t20 + e2) * motors[1]
    power += sum(
        f * (r * speed - r * virtual) * (1 - rolled)
        for f, speed, virtual, rolled in zip((f1, f2), motors, (u, w), rolls, strict=True)
    )
    rows = []
    for v in (vx, vy):
        momentum = sp.diff(energy, v)
        rate = sp.diff(momentum, vx) * ax + sp.diff(momentum, vy) * ay
        rows.append((sp.expand(rate * r), sp.expand(sp.diff(power, v) * r)))
    symbols = (m, M, J, Jp, r, fx, fy, *tau, t10, t20, e1, e2, f1, f2)
    matrix = [[sp.diff(row[0], a) for a in (ax, ay)] for row in rows]
    right = [row[1] for row in rows]
    alpha = [sp.expand(sp.diff(power, w_i) / J) for w_i in (w1, w2)]
    return sp.lambdify(symbols, (matrix, right, alpha), "numpy")


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_corrected_models_are_lagranges(number):
    equations = lagrange(number)
    torques = (1.3, -0.7)
    p, f = machine(number), frictions(number)
    matrix, right, alpha = equations(
        *(float(a) for a in (p.m, p.M, p.J, p.J_passive, p.r, f.f_x, f.f_y, *f.pulleys)),
        *(float(a) for a in (f.tau_1_0, f.tau_2_0)),
        *torques,
        *(float(a) for a in (f.f_1_b, f.f_2_b)),
    )
    model = cx.dynamic_model(number, p, f, tuple(map(jnp.asarray, torques)), CORRECTED)
    np.testing.assert_allclose(model.M, matrix, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(model.b + model.tau, right, rtol=1e-12)
    slipping = [
        cx.slipping_motor(p, torques[0], f.tau_1_0, f.f_1_b),
        cx.slipping_motor(p, torques[1], f.tau_2_0, f.f_2_b),
    ]
    for i in range(2):
        if not ROLLS[number][i]:
            np.testing.assert_allclose(slipping[i], alpha[i], rtol=1e-12)


@pytest.mark.parametrize("erratum", ["A1", "A2"])
def test_each_erratum_changes_the_models(erratum):
    p, f = machine(0), frictions(0)
    wrong = cx.Errata.corrected(**{erratum: False})
    for number in (1, 2, 3, 4):
        torques = (jnp.asarray(1.0), jnp.asarray(2.0))
        printed_one = cx.dynamic_model(number, p, f, torques, wrong)
        right = cx.dynamic_model(number, p, f, torques, CORRECTED)
        gap = float(jnp.max(jnp.abs(printed_one.b + printed_one.tau - right.b - right.tau)))
        assert (gap > 1e-3) == (erratum == "A1" or number > 1)


def test_printed_belt_reaction_creates_energy_and_the_corrected_one_does_not():
    p = machine(3)
    f_1, f_2 = cx.belt_friction(p, jnp.asarray(1.0), jnp.asarray(-1.0))
    # Pulleys faster and slower than belts that run at 5 and 4 rad/s, both far from standing.
    omega, virtual = np.array([5.5, 3.5]), np.array([5.0, 4.0])
    f = frictions(0)._replace(f_1_b=f_1, f_2_b=f_2)
    zero = (jnp.asarray(0.0),) * 2
    forces = np.array([float(f_1), float(f_2)]) * float(p.r)
    velocity = np.array([virtual.sum(), virtual[0] - virtual[1]]) * float(p.r) / 2
    for errata, sign in ((AS_PRINTED, 1.0), (CORRECTED, -1.0)):
        rows = np.asarray(cx.dynamic_model(4, p, f, zero, errata).tau) / float(p.r)
        power = rows @ velocity + forces @ omega
        np.testing.assert_allclose(power, forces @ (omega + sign * virtual), rtol=1e-12)
    assert forces @ (omega - virtual) < 0
    slower = np.array([-1.0, -1.0]) * np.abs(forces) @ (np.array([0.2, 0.2]) - 1.0)
    assert slower > 0
