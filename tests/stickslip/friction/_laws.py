"""Every law of the package once in each of its forms; a new law costs one line here."""

import jax.numpy as jnp

from stickslip.friction import (
    Asymmetric,
    Coulomb,
    Dahl,
    HyperbolicWeakening,
    LuGre,
    RateAndState,
    Regularised,
    SmoothHyperbolicWeakening,
    Stribeck,
    Sum,
    ViscousDamping,
    ViscousFriction,
)

COULOMB = Coulomb(0.4, 0.3)
STRIBECK = Stribeck(0.4, 0.3, v_s=0.02)
ASYMMETRIC = Asymmetric(COULOMB, Stribeck(0.5, 0.2, v_s=0.1))

LAWS = {
    "coulomb": COULOMB,
    "coulomb, static below kinetic": Coulomb(0.1, 0.3),
    "coulomb, one coefficient": Coulomb(0.3),
    "stribeck": STRIBECK,
    "stribeck, exponent 1": Stribeck(0.4, 0.3, v_s=0.02, exponent=1),
    "stribeck, exponent 1/2": Stribeck(0.4, 0.3, v_s=0.02, exponent=0.5),
    "hyperbolic": HyperbolicWeakening(0.3, gamma=10.0),
    "hyperbolic, breakaway": HyperbolicWeakening(0.4, gamma=1.75, mu_k=0.26),
    "smooth hyperbolic": SmoothHyperbolicWeakening(0.26, alpha=190.0, beta=0.9, gamma=1.75),
    "smooth hyperbolic, no peak": SmoothHyperbolicWeakening(0.26, 190.0, beta=0.0, gamma=0.0),
    "viscous friction": ViscousFriction(0.2),
    "viscous damping": ViscousDamping(3.0),
    "asymmetric": ASYMMETRIC,
    "asymmetric, smooth": Asymmetric(ViscousDamping(3.0), ViscousFriction(0.2)),
    "sum": Sum(COULOMB, ViscousFriction(0.2), ViscousDamping(3.0)),
    "sum with bristles": Sum(Dahl(Coulomb(0.3), 1e3), ViscousDamping(3.0), LuGre(STRIBECK, 1e4)),
    "tanh": Regularised(COULOMB, v_reg=1e-3),
    "arctan": Regularised(ASYMMETRIC, v_reg=1e-3, kind="arctan"),
    "sqrt": Regularised(Sum(STRIBECK, ViscousDamping(3.0)), v_reg=1e-3, kind="sqrt", v_brk=0.02),
    "dahl": Dahl(Coulomb(0.3), sigma_0=1e3),
    "dahl, exponent 2": Dahl(STRIBECK, sigma_0=1e3, exponent=2),
    "lugre": LuGre(STRIBECK, sigma_0=1e4, sigma_1=30.0, sigma_2=0.1),
    "lugre, breakaway": LuGre(ASYMMETRIC, sigma_0=1e4, v_s=0.01),
    "rate and state": RateAndState(0.6, 0.009, 0.0095, d_c=7e-6, v_0=3e-6),
    "rate and state, slip": RateAndState(0.6, 0.012, 0.008, 1e-5, 1e-6, evolution="slip"),
    # Exponents as arrays are leaves, and take the general power.
    "stribeck, free exponent 1/2": Stribeck(0.4, 0.3, 0.02, exponent=jnp.array(0.5)),
    "stribeck, free exponent 1": Stribeck(0.4, 0.3, 0.02, exponent=jnp.array(1.0)),
    "stribeck, free exponent 2": Stribeck(0.4, 0.3, 0.02, exponent=jnp.array(2.0)),
}
