"""Friction that falls from the static to the kinetic level as the square of a hyperbolic tangent."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip.checks import Numeric, as_parameter, check_nonnegative, check_positive
from stickslip.fastmath import tanh
from stickslip.friction import AbstractDryFrictionLaw


class TanhWeakening(AbstractDryFrictionLaw):
    r"""$\mu(v) = [\mu_k + (\mu_s - \mu_k)(1 - \tanh^2(v/v_s))]\,\mathrm{sgn}\,v$.

    Set-valued, odd, dissipative.

    **Arguments:** `mu_s`, `mu_k` [-], not negative; `v_s` [m/s], positive.
    """

    mu_s: Float[Array, "..."]
    mu_k: Float[Array, "..."]
    v_s: Float[Array, "..."]

    parameter_units: ClassVar = {"mu_s": "1", "mu_k": "1", "v_s": "m/s"}

    set_valued: ClassVar[bool] = True
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    def __init__(self, mu_s: Numeric, mu_k: Numeric, v_s: Numeric):
        self.mu_s = as_parameter(check_nonnegative("mu_s", mu_s))
        self.mu_k = as_parameter(check_nonnegative("mu_k", mu_k))
        self.v_s = as_parameter(check_positive("v_s", v_s))

    def kinetic(self, v, sense):
        share = tanh(jnp.asarray(v / self.v_s))
        return sense * (self.mu_k + (self.mu_s - self.mu_k) * (1.0 - share * share))

    def static_coefficient(self, sense=1):
        return self.mu_s

    def set_valued_limit(self):
        return self
