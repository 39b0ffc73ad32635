"""Each law against its formula, written once more in NumPy, and derivatives against differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.friction import (
    Asymmetric,
    Coulomb,
    HyperbolicWeakening,
    Regularised,
    SmoothHyperbolicWeakening,
    Stribeck,
    Sum,
    ViscousDamping,
    ViscousFriction,
)

SPEEDS = np.geomspace(1e-7, 30.0, 60)
V = np.concatenate([-SPEEDS[::-1], SPEEDS])
MU_0, ALPHA, BETA, GAMMA = 0.26, 190.0, 0.9, 1.75


def smooth_hyperbolic(v, alpha=ALPHA):
    x = np.clip(alpha * v, -300, 300)
    return MU_0 / (1 + GAMMA * abs(v)) * (1 + BETA / np.cosh(x)) * np.tanh(x)


def simscape(v, breakaway, coulomb, v_brk):
    stribeck, narrow = v_brk * np.sqrt(2), v_brk / 10
    bump = np.sqrt(2 * np.e) * (breakaway - coulomb) * np.exp(-((v / stribeck) ** 2)) * v / stribeck
    return bump + coulomb * np.tanh(v / narrow)


def asymmetric(v):
    return np.where(v > 0, 0.3, -(0.2 + 0.3 * np.exp(-((v / 0.1) ** 2))))


FORMULAS = {
    "coulomb": (Coulomb(0.4, 0.3), lambda v: 0.3 * np.sign(v)),
    "coulomb, default": (Coulomb(0.4), lambda v: 0.4 * np.sign(v)),
    "stribeck": (
        Stribeck(0.4, 0.3, 0.02),
        lambda v: np.sign(v) * (0.3 + 0.1 * np.exp(-((v / 0.02) ** 2))),
    ),
    "stribeck, exponent 1/2": (
        Stribeck(0.4, 0.3, 0.02, 0.5),
        lambda v: np.sign(v) * (0.3 + 0.1 * np.exp(-np.sqrt(abs(v) / 0.02))),
    ),
    "stribeck, exponent array": (
        Stribeck(0.4, 0.3, 0.02, jnp.array(1.3)),
        lambda v: np.sign(v) * (0.3 + 0.1 * np.exp(-((abs(v) / 0.02) ** 1.3))),
    ),
    "beam, Eq. (2.16)": (
        HyperbolicWeakening(0.3, 10.0),
        lambda v: 0.3 / (1 + 10 * abs(v)) * np.sign(v),
    ),
    "hyperbolic, breakaway": (
        HyperbolicWeakening(0.4, 10.0, mu_k=0.3),
        lambda v: 0.3 / (1 + 10 * abs(v)) * np.sign(v),
    ),
    "block on belt, Eq. (12)": (
        SmoothHyperbolicWeakening(MU_0, ALPHA, BETA, GAMMA),
        smooth_hyperbolic,
    ),
    "viscous friction": (ViscousFriction(0.2), lambda v: 0.2 * v),
    "viscous damping": (ViscousDamping(3.0), lambda v: 0.0 * v),
    "asymmetric": (Asymmetric(Coulomb(0.4, 0.3), Stribeck(0.5, 0.2, 0.1)), asymmetric),
    "sum": (
        Sum(Coulomb(0.4, 0.3), ViscousFriction(0.2), ViscousDamping(3.0)),
        lambda v: 0.3 * np.sign(v) + 0.2 * v,
    ),
    "simscape": (
        Regularised(Coulomb(0.4, 0.3), v_reg=1e-3),
        lambda v: simscape(v, 0.4, 0.3, 1e-2),
    ),
    "arctan": (
        Regularised(Coulomb(0.3), 1e-3, "arctan"),
        lambda v: 0.3 * 2 / np.pi * np.arctan(np.pi / 2 * v / 1e-3),
    ),
    "sqrt": (
        Regularised(HyperbolicWeakening(0.3, 10.0), 1e-3, "sqrt"),
        lambda v: 0.3 / (1 + 10 * abs(v)) * v / np.sqrt(v**2 + 1e-6),
    ),
}
every_formula = pytest.mark.parametrize(("law", "formula"), FORMULAS.values(), ids=FORMULAS.keys())


@every_formula
def test_coefficient(law, formula):
    np.testing.assert_allclose(law.coefficient(V), formula(V), rtol=2e-15, atol=5e-16)


@pytest.mark.more
@every_formula
def test_derivative_away_from_rest(law, formula):
    # Nearer to rest the differences lose their digits, even in extended precision.
    v = V[np.abs(V) > 1e-4].astype(np.longdouble)
    step = 1e-5 * np.abs(v)
    expected = (formula(v + step) - formula(v - step)) / (2 * step)
    slope = jax.jit(jax.vmap(jax.grad(lambda v: law.coefficient(v))))(v.astype(float))
    np.testing.assert_allclose(slope, expected.astype(float), rtol=1e-7, atol=1e-9)


def test_drag_does_not_depend_on_the_normal_force():
    law = Sum(Coulomb(0.4, 0.3), ViscousDamping(3.0))
    np.testing.assert_allclose(law.force(V, 0.0), -3.0 * V)
    np.testing.assert_allclose(law.force(V, 2.0), -3.0 * V - 0.6 * np.sign(V))
    one_way = Asymmetric(ViscousDamping(3.0), ViscousFriction(0.2))
    np.testing.assert_allclose(one_way.force(V, 2.0), np.where(V > 0, -3.0 * V, -0.4 * V))


@pytest.mark.more
@pytest.mark.parametrize(
    ("law", "branch"),
    [
        (Coulomb(0.4, 0.3), lambda s: 0.3 + 0 * s),
        (HyperbolicWeakening(0.3, 10.0), lambda s: 0.3 / (1 + 10 * s)),
        (Stribeck(0.4, 0.3, 0.02), lambda s: 0.3 + 0.1 * np.exp(-((s / 0.02) ** 2))),
        (Stribeck(0.4, 0.3, 0.02, 1), lambda s: 0.3 + 0.1 * np.exp(-s / 0.02)),
        (
            Stribeck(0.4, 0.3, 0.02, jnp.array(3.0)),
            lambda s: 0.3 + 0.1 * np.exp(-((s / 0.02) ** 3)),
        ),
    ],
)
@pytest.mark.parametrize("sense", [1, -1])
def test_branches_are_the_analytic_continuation_through_rest(law, branch, sense):
    speed = np.linspace(-0.015, 0.015, 31)
    np.testing.assert_allclose(law.kinetic(sense * speed, sense), sense * branch(speed), rtol=1e-15)


def test_slopes_of_the_branches_at_rest():
    """Exactly where a slip mode ends, tangent dynamics needs the slope of the branch."""
    at_rest = lambda law: float(jax.grad(lambda v: law.kinetic(v, 1))(0.0))  # noqa: E731
    assert at_rest(HyperbolicWeakening(0.3, 10.0)) == -3.0
    assert at_rest(Stribeck(0.4, 0.3, 0.02)) == 0.0
    np.testing.assert_allclose(at_rest(Stribeck(0.4, 0.3, 0.02, 1)), -5.0, rtol=1e-15)
    np.testing.assert_allclose(at_rest(Stribeck(0.4, 0.3, 0.02, jnp.array(1.0))), -5.0, rtol=1e-15)


class TestBlockOnBelt:
    law = SmoothHyperbolicWeakening(MU_0, ALPHA, BETA, GAMMA)

    def test_rest(self):
        slope = MU_0 * ALPHA * (1 + BETA)
        assert self.law.coefficient(0.0) == 0.0
        mu = self.law.coefficient
        for first in (jax.grad(mu), jax.jacfwd(mu)):
            np.testing.assert_allclose(jax.jit(first)(0.0), slope, rtol=1e-15)
        # Weakening with |v| leaves a jump in the curvature; the derivative is the limit from above.
        for second in (jax.jacfwd(jax.jacfwd(mu)), jax.hessian(mu)):
            np.testing.assert_allclose(jax.jit(second)(0.0), -2 * GAMMA * slope, rtol=1e-12)

    def test_accuracy_against_extended_precision(self):
        random = np.random.default_rng(1)
        v = np.concatenate([s * 10 ** random.uniform(-12, 3, 50_000) for s in (-1, 1)])
        value = np.asarray(jax.jit(lambda v: self.law.coefficient(v))(v))
        error = np.abs(value - smooth_hyperbolic(v.astype(np.longdouble)))
        assert error.max() < 5e-16 * MU_0 * (1 + BETA)

    @pytest.mark.parametrize("v", [1e3, 1e10, 1e200, 1e300])
    def test_far_from_rest(self, v):
        value, slope = jax.value_and_grad(self.law.coefficient)(v)
        np.testing.assert_allclose(value, MU_0 / (1 + GAMMA * v), rtol=1e-15)
        np.testing.assert_allclose(slope, -value * (GAMMA / (1 + GAMMA * v)), rtol=1e-14, atol=1e-300)
        of_parameters = jax.grad(lambda law: law.coefficient(v))(self.law)
        assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(of_parameters))

    def test_second_derivatives_in_every_mode(self):
        v = np.array([-0.3, -0.004, 0.004, 0.02, 1.0])
        step = 1e-4 * np.abs(v)
        exact = v.astype(np.longdouble)
        expected = (
            smooth_hyperbolic(exact + step)
            - 2 * smooth_hyperbolic(exact)
            + smooth_hyperbolic(exact - step)
        ) / step**2
        mu = self.law.coefficient
        for second in (
            jax.jacfwd(jax.jacfwd(mu)),
            jax.jacfwd(jax.jacrev(mu)),
            jax.jacrev(jax.jacfwd(mu)),
        ):
            np.testing.assert_allclose(jax.jit(jax.vmap(second))(v), expected.astype(float), rtol=1e-5)

    def test_derivatives_by_the_parameters(self):
        def formula(mu_0, alpha, beta, gamma, v):
            x = alpha * v
            return mu_0 / (1 + gamma * abs(v)) * (1 + beta / np.cosh(x)) * np.tanh(x)

        v = 0.004
        gradient = jax.grad(lambda law: law.coefficient(v))(self.law)
        point = np.array([MU_0, ALPHA, BETA, GAMMA], dtype=np.longdouble)
        for i, value in enumerate((gradient.mu_0, gradient.alpha, gradient.beta, gradient.gamma)):
            step = np.zeros(4, dtype=np.longdouble)
            step[i] = 1e-6 * point[i]
            expected = (formula(*(point + step), v) - formula(*(point - step), v)) / (2 * step[i])
            np.testing.assert_allclose(value, float(expected), rtol=1e-9)
