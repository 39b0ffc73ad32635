"""Bristle laws: steady state, relaxation against closed forms, energy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip.friction import (
    Asymmetric,
    Coulomb,
    Dahl,
    HyperbolicWeakening,
    LuGre,
    Stribeck,
)

SIGMA_0 = 1e3


@eqx.filter_jit
def rate_of(law, v, z):
    return law.state_rate(v, (z,))[0]


def integrated(law, velocity, times, z0=0.0):
    """Deflection at `times`, by SciPy's eighth-order method."""
    solution = solve_ivp(
        lambda t, z: [float(rate_of(law, jnp.asarray(velocity(t)), jnp.asarray(z[0])))],
        (0.0, times[-1]),
        [z0],
        method="DOP853",
        t_eval=times,
        rtol=1e-11,
        atol=1e-16,
    )
    return solution.y[0]


@pytest.mark.more
@pytest.mark.parametrize("v", [0.05, -0.02])
@pytest.mark.parametrize(
    "law",
    [
        Dahl(Coulomb(0.3), SIGMA_0),
        Dahl(Stribeck(0.4, 0.3, 0.02), SIGMA_0),
        LuGre(HyperbolicWeakening(0.3, 10.0), SIGMA_0),
        LuGre(Asymmetric(Coulomb(0.3), Coulomb(0.5)), SIGMA_0),
    ],
    ids=["dahl", "dahl, stribeck", "lugre", "lugre, asymmetric"],
)
def test_relaxation_at_constant_velocity_is_exponential(law, v):
    magnitude = abs(float(law.law.coefficient(v)))
    times = np.linspace(0.0, 6 * magnitude / (SIGMA_0 * abs(v)), 13)
    steady = np.sign(v) * magnitude / SIGMA_0
    for z0 in (0.0, -0.5 * steady):
        expected = steady + (z0 - steady) * np.exp(-SIGMA_0 * abs(v) * times / magnitude)
        found = integrated(law, lambda t: v, times, z0)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * abs(steady))


@pytest.mark.parametrize("v", [0.05, -0.02])
def test_relaxation_of_dahl_with_other_exponents(v):
    """r' = -k r^i with r(0) = 1: hyperbolic for i = 2, parabolic and finite for i = 1/2."""
    mu = 0.3
    k = SIGMA_0 * abs(v) / mu
    times = np.linspace(0.0, 1.8 / k, 10)
    for exponent, rest in ((2, 1 / (1 + k * times)), (0.5, (1 - k * times / 2) ** 2)):
        z = integrated(Dahl(Coulomb(mu), SIGMA_0, exponent), lambda t: v, times)
        np.testing.assert_allclose(z, np.sign(v) * mu / SIGMA_0 * (1 - rest), rtol=1e-8, atol=1e-15)


def test_bristle_damping_and_viscous_friction_enter_the_coefficient():
    law = LuGre(Coulomb(0.3), SIGMA_0, sigma_1=2.0, sigma_2=0.1)
    v, z = 0.05, 1e-4
    rate = v - SIGMA_0 * v * z / 0.3
    np.testing.assert_allclose(rate_of(law, v, z), rate, rtol=1e-15)
    expected = SIGMA_0 * z + 2.0 * rate + 0.1 * v
    np.testing.assert_allclose(law.coefficient_from_state(v, (z,)), expected, rtol=1e-15)
    np.testing.assert_allclose(law.force_from_state(v, 2.0, (z,)), -2.0 * expected, rtol=1e-15)


def test_steady_state_equals_the_wrapped_law():
    v = np.concatenate([-np.geomspace(1e-9, 10, 30), np.geomspace(1e-9, 10, 30)])
    for law in (Coulomb(0.3), Stribeck(0.4, 0.3, 0.02), HyperbolicWeakening(0.3, 10.0)):
        for bristles in (Dahl(law, SIGMA_0), LuGre(law, SIGMA_0, 2.0)):
            found = bristles.coefficient_from_state(v, bristles.steady_state(v))
            np.testing.assert_allclose(found, law.coefficient(v), rtol=1e-13)


def test_excess_of_static_friction_is_the_published_law():
    """g = F_C + (F_S - F_C) exp(-(v/v_s)^2), written with Coulomb's law or with Stribeck's."""
    v = np.linspace(-0.2, 0.2, 81)
    through_coulomb = LuGre(Coulomb(0.4, 0.3), SIGMA_0, v_s=0.02)
    through_stribeck = LuGre(Stribeck(0.4, 0.3, 0.02), SIGMA_0)
    np.testing.assert_allclose(
        through_coulomb.coefficient(v), through_stribeck.coefficient(v), rtol=1e-15
    )
    assert through_coulomb.kinetic_limit() == through_coulomb.static_coefficient()


def test_rest_is_an_equilibrium_for_any_deflection():
    z = np.linspace(-3e-4, 3e-4, 7)
    for law in (Dahl(Coulomb(0.3), SIGMA_0), LuGre(Stribeck(0.4, 0.3, 0.02), SIGMA_0, 2.0)):
        np.testing.assert_array_equal(law.state_rate(np.zeros(7), (z,))[0], 0.0)
        np.testing.assert_allclose(law.coefficient_from_state(np.zeros(7), (z,)), SIGMA_0 * z)
        assert law.steady_state(0.0) == (0.0,)
        assert law.coefficient(0.0) == 0.0
        slope = jax.grad(lambda v, law=law: law.coefficient_from_state(v, (1e-4,)))(0.0)
        assert np.isfinite(slope)


@pytest.mark.parametrize(
    "law",
    [
        Dahl(Coulomb(0.3), SIGMA_0),
        Dahl(Stribeck(0.4, 0.3, 0.02), SIGMA_0, exponent=0.5),
        Dahl(Asymmetric(Coulomb(0.3), Coulomb(0.5)), SIGMA_0, exponent=3),
        LuGre(Stribeck(0.4, 0.2, 0.02), SIGMA_0, sigma_1=2.0, sigma_2=2.0),
    ],
    ids=["dahl", "dahl, 1/2", "dahl, 3", "lugre at the bound"],
)
def test_bristles_return_no_more_than_they_store(law):
    """Power into the contact less the rate of sigma_0 z^2 / 2 is never negative."""
    v, share = np.meshgrid(
        np.concatenate([-np.geomspace(1e-6, 1, 15), np.geomspace(1e-6, 1, 15)]),
        np.linspace(-1, 1, 21),
    )
    z = share * float(law.static_coefficient()) / SIGMA_0
    (rate,) = law.state_rate(v, (z,))
    loss = law.coefficient_from_state(v, (z,)) * v - SIGMA_0 * z * rate
    assert (loss >= -1e-15).all()


def test_the_passivity_bound_is_needed():
    """Below it, bristles bent to the static limit and then swept fast give energy away."""
    law = LuGre(Stribeck(0.4, 0.2, 0.02), SIGMA_0, sigma_1=2.0, sigma_2=1.0)
    z, v = 0.4 / SIGMA_0, 1.0
    (rate,) = law.state_rate(v, (z,))
    assert law.coefficient_from_state(v, (z,)) * v - SIGMA_0 * z * rate < 0.0


@pytest.mark.more
def test_presliding_loop_closes():
    """Dahl's law under a periodic displacement settles on a hysteresis loop that dissipates."""
    law, amplitude = Dahl(Coulomb(0.3), SIGMA_0), 5e-4
    times = np.linspace(0.0, 3.0, 3001)
    velocity = lambda t: amplitude * 2 * np.pi * np.cos(2 * np.pi * t)  # noqa: E731
    coefficient = SIGMA_0 * integrated(law, velocity, times)
    last, before = coefficient[2000:], coefficient[1000:2001]
    np.testing.assert_allclose(last, before, atol=5e-4)
    assert np.trapezoid(last * velocity(times[2000:]), times[2000:]) > 0.0
