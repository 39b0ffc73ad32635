"""Constructors name parameters that do not go together; `tests/house` feeds each one nonsense."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.friction import (
    Asymmetric,
    Coulomb,
    Dahl,
    HyperbolicWeakening,
    LuGre,
    Regularised,
    SmoothHyperbolicWeakening,
    Stribeck,
    Sum,
    ViscousDamping,
    ViscousFriction,
)

COULOMB = Coulomb(0.4, 0.3)
SMOOTH = SmoothHyperbolicWeakening(0.26, 190.0, 0.9, 1.75)


@pytest.mark.parametrize(
    ("construct", "message"),
    [
        (lambda: Stribeck(0.3, 0.4, 0.1), "mu_s = 0.3: it must be at least mu_k = 0.4."),
        (
            lambda: Regularised(SMOOTH, 1e-3),
            "law = SmoothHyperbolicWeakening: it must be a set-valued law without internal state",
        ),
        (lambda: Regularised(Dahl(Coulomb(0.3), 1e3), 1e-3), "law = Dahl: it must be a set-valued"),
        (
            lambda: Asymmetric(COULOMB, SMOOTH),
            "backward = SmoothHyperbolicWeakening: it must be set-valued, as forward = Coulomb is.",
        ),
        (
            lambda: Asymmetric(COULOMB, Dahl(Coulomb(0.3), 1e3)),
            "backward = Dahl: it must be a law without internal state (",
        ),
        (lambda: Sum(), "laws = (): it must be at least one friction law."),
        (lambda: Dahl(COULOMB, 1e3), "law = Coulomb: it must be one whose static and kinetic"),
        (lambda: Dahl(SMOOTH, 1e3), "law = SmoothHyperbolicWeakening: it must be a set-valued law"),
        (
            lambda: Dahl(Coulomb(0.0), 1e3),
            "law.kinetic_limit(1) = 0.0: it must be positive; bristles divide by it.",
        ),
        (
            lambda: LuGre(Asymmetric(Coulomb(0.3), Coulomb(0.0)), 1e3),
            "law.kinetic_limit(-1) = 0.0: it must be positive; bristles divide by it.",
        ),
        (lambda: LuGre(COULOMB, 1e3), "v_s = None: it must be a positive Stribeck velocity"),
    ],
)
def test_bad_parameters_are_named(construct, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        construct()


def build_everything(scale):
    coulomb = Coulomb(0.4 * scale, 0.3 * scale)
    stribeck = Stribeck(0.4 * scale, 0.3 * scale, 0.02 * scale, 2.0 * scale)
    return (
        coulomb,
        stribeck,
        HyperbolicWeakening(0.3 * scale, scale),
        SmoothHyperbolicWeakening(0.26 * scale, 190 * scale, 0.9 * scale, scale),
        Asymmetric(coulomb, stribeck),
        Sum(stribeck, ViscousFriction(scale), ViscousDamping(scale)),
        Regularised(coulomb, 1e-3 * scale),
        Dahl(stribeck, 1e3 * scale),
        LuGre(coulomb, 1e3 * scale, scale, scale, v_s=scale),
    )


def test_laws_are_built_under_every_transformation():
    """Tracers have no number to check: construction inside jit, vmap and grad just works."""

    def total(scale):
        return sum(law.force(0.01, 2.0) for law in build_everything(scale))

    values = jax.jit(jax.vmap(total))(jnp.array([1.0, 1.1]))
    np.testing.assert_allclose(values, [total(1.0), total(1.1)], rtol=1e-13)
    step = 1e-6
    difference = (total(1.1 + step) - total(1.1 - step)) / (2 * step)
    np.testing.assert_allclose(jax.jit(jax.grad(total))(1.1), difference, rtol=1e-7)


def test_numbers_known_at_trace_time_are_checked_there():
    with pytest.raises(ValueError, match=r"^mu_k = -0\.1"):
        jax.jit(lambda mu_s: Coulomb(mu_s, -0.1).coefficient(1.0))(0.4)
