"""Smooth laws tend to the set-valued ones they name, at the order they state."""

import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.friction import (
    Coulomb,
    HyperbolicWeakening,
    LuGre,
    Regularised,
    SmoothHyperbolicWeakening,
    Stribeck,
    Sum,
    ViscousDamping,
)

V = jnp.array([-2.0, -0.3, 0.2, 1.0])
MU_0, BETA, GAMMA = 0.26, 0.9, 1.75


def errors(family, law, widths):
    return np.array([np.max(np.abs(family(w).coefficient(V) - law.coefficient(V))) for w in widths])


@pytest.mark.more
@pytest.mark.parametrize(("kind", "order"), [("arctan", 1), ("sqrt", 2)])
@pytest.mark.parametrize(
    "law",
    [Coulomb(0.4, 0.3), Stribeck(0.4, 0.3, 0.02), HyperbolicWeakening(0.4, GAMMA, mu_k=MU_0)],
    ids=["coulomb", "stribeck", "hyperbolic"],
)
def test_algebraic_kinds_converge_at_their_order(law, kind, order):
    widths = 1e-3 * 0.5 ** np.arange(5)
    error = errors(lambda w: Regularised(law, w, kind), law, widths)
    measured = np.log2(error[:-1] / error[1:])
    np.testing.assert_allclose(measured, order, atol=0.01)


def test_tanh_converges_exponentially():
    law = Coulomb(0.3)
    widths = 1.0 / np.arange(10, 40, 5)
    error = errors(lambda w: Regularised(law, w), law, widths)
    # The slowest point is the slowest speed, 0.2, with 1 - tanh u = 2 exp(-2 u).
    np.testing.assert_allclose(error, 0.3 * 2 * np.exp(-0.4 / widths), rtol=0.02)


@pytest.mark.more
@pytest.mark.parametrize(
    ("kind", "ratio", "missed"),
    [("tanh", 10, 4.2e-9), ("sqrt", 100, 5e-5), ("arctan", 1e4, 4.1e-5)],
)
def test_breakaway_peak_is_kept(kind, ratio, missed):
    law, v_reg = Coulomb(0.4, 0.3), 1e-3
    smooth = Regularised(law, v_reg, kind, v_brk=ratio * v_reg)
    v = ratio * v_reg * np.linspace(0.9, 1.1, 20_001)
    peak = float(np.max(smooth.coefficient(v)))
    np.testing.assert_allclose(peak, 0.4 - 0.3 * missed, rtol=0, atol=0.3 * missed * 0.1)
    assert smooth.static_coefficient() == law.static_coefficient()


def test_default_is_the_form_of_simscape():
    law = Regularised(Coulomb(0.4, 0.3), 1e-3)
    assert law.v_brk == 10 * law.v_reg
    assert law.set_valued_limit() == law.law


def test_rounding_without_breakaway_has_no_bump():
    smooth = Regularised(Coulomb(0.3), 1e-3)
    v = np.linspace(-0.1, 0.1, 1001)
    np.testing.assert_allclose(smooth.coefficient(v), 0.3 * np.tanh(v / 1e-3), rtol=0, atol=2e-16)


@pytest.mark.parametrize("beta", [0.0, 1e-9, 0.1, 0.9, 5.0, 1e4, 1e9])
def test_static_limit_of_the_block_on_belt_is_the_peak(beta):
    static = SmoothHyperbolicWeakening(MU_0, 100.0, beta, GAMMA).static_coefficient()
    s = np.linspace(0.0, 40.0, 400_001)
    peak = MU_0 * np.max((1 + beta / np.cosh(s)) * np.tanh(s))
    np.testing.assert_allclose(static, peak, rtol=3e-9)
    assert static >= peak * (1 - 1e-15)


@pytest.mark.more
def test_block_on_belt_tends_to_its_limit():
    def law(alpha):
        return SmoothHyperbolicWeakening(MU_0, alpha, BETA, GAMMA)

    limit = law(1.0).set_valued_limit()
    assert isinstance(limit, HyperbolicWeakening)
    assert (limit.mu_k, limit.gamma) == (MU_0, GAMMA)

    # At fixed v: sech decays last, as 2 exp(-alpha |v|), seen at the slowest speed 0.2.
    alphas = np.array([60.0, 80.0, 100.0])
    error = errors(law, limit, alphas)
    leading = MU_0 / (1 + 0.2 * GAMMA) * 2 * BETA * np.exp(-0.2 * alphas)
    np.testing.assert_allclose(error, leading, rtol=1e-3)

    # The peak: first order in 1/alpha, with the factor of the docstring.
    static = float(limit.static_coefficient())
    at_peak = np.arccosh((1 + np.sqrt(1 + 8 * BETA**2)) / (2 * BETA))
    for alpha in (1e3, 1e4, 1e5):
        v = at_peak / alpha * np.linspace(0.5, 1.5, 100_001)
        lost = 1 - float(np.max(law(alpha).coefficient(v))) / static
        np.testing.assert_allclose(lost, GAMMA * at_peak / alpha, rtol=20 / alpha)


def test_stiff_bristles_tend_to_the_law_with_viscous_friction():
    dry = Sum(Coulomb(0.4, 0.3), ViscousDamping(3.0))
    law = LuGre(dry, sigma_0=1e4, sigma_2=0.2, v_s=1e-3)
    limit = law.set_valued_limit()
    assert limit.set_valued
    np.testing.assert_allclose(law.coefficient(V), limit.coefficient(V), rtol=1e-15)
    np.testing.assert_allclose(law.force(V, 2.0), limit.force(V, 2.0), rtol=1e-15)


def test_static_coefficient_below_kinetic_sticks_up_to_the_kinetic_one():
    for law in (Coulomb(0.001, 0.2), HyperbolicWeakening(0.001, GAMMA, mu_k=0.2)):
        assert law.static_coefficient() == 0.2
        assert law.static_interval() == (-0.2, 0.2)


def test_static_interval_of_an_asymmetric_law():
    from stickslip.friction import Asymmetric

    law = Asymmetric(Coulomb(0.4, 0.3), Coulomb(0.6, 0.5))
    assert law.static_interval() == (-0.6, 0.4)
    assert (law.kinetic_limit(1), law.kinetic_limit(-1)) == (0.3, 0.5)
    np.testing.assert_allclose([law.breakaway_jump(1), law.breakaway_jump(-1)], 0.1)
