"""Friction that weakens hyperbolically with the slip velocity."""

from typing import ClassVar

import jax
from jax import lax
from jaxtyping import Array, Float

from stickslip._argument_checks import or_none, parameters
from stickslip._fastmath import SMOOTH, where
from stickslip.friction.law import AbstractDryFrictionLaw, Number, in_dtype_of


def weakening_factor(speed: Float[Array, "..."], gamma: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Denominator $1 + \gamma s$ of the hyperbolic laws, for slip speeds of both signs.

    Held at 1/2 beyond $s = -1/(2\gamma)$: the pole at $-1/\gamma$ is then out of reach of trial
    steps, while near $s = 0$, where events are located, nothing is changed.
    """
    factor = 1.0 + gamma * speed
    with jax.named_scope(SMOOTH):
        return lax.max(factor, lax.full_like(factor, 0.5))


class HyperbolicWeakening(AbstractDryFrictionLaw):
    r"""Kinetic friction that falls as the reciprocal of the slip velocity.

    $$\mu(v) = \frac{\mu_k}{1 + \gamma|v|}\,\mathrm{sgn}\,v \quad (v \ne 0), \qquad
    |\mu(0)| \le \max(\mu_s, \mu_k)$$

    - At rest: the interval $[-\mu_s, \mu_s]$, or $[-\mu_k, \mu_k]$ where $\mu_s < \mu_k$.
    - Limits: $\mu(0^\pm) = \pm\mu_k$ with slope $-\gamma\mu_k$, $\mu(\pm\infty) = 0$.
    - Set-valued, odd, dissipative.

    With `mu_k` left out it is the law of the beam jointed to an oscillator on a belt, printed there
    with $1 + \gamma v$, which has a pole. With $\mu_k = \mu_0$ and a greater $\mu_s$ it is what
    `SmoothHyperbolicWeakening` tends to.

    **Arguments:**

    - `mu_s`: static coefficient [-], not negative.
    - `gamma`: rate of weakening [s/m], not negative.
    - `mu_k`: kinetic coefficient as slip begins [-], not negative; equal to `mu_s` if left out.

    ??? cite "Reference"

        *Non-linear Dynamics of Jointed Systems Under Dry Friction Forces*, Eqs. (2.8) and (2.16).
    """

    mu_s: Float[Array, "..."]
    gamma: Float[Array, "..."]
    mu_k: Float[Array, "..."]

    parameter_units: ClassVar = {"mu_s": "1", "gamma": "s/m", "mu_k": "1"}

    set_valued: ClassVar[bool] = True
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    @parameters(mu_s="not negative", gamma="not negative", mu_k=or_none("not negative"))
    def __init__(self, mu_s: Number, gamma: Number, mu_k: Number | None = None):
        if mu_k is None:
            self.mu_k = self.mu_s

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense, mu_k, gamma = in_dtype_of(v, sense, self.mu_k, self.gamma)
        with jax.named_scope(SMOOTH):  # the denominator has a bound
            return sense * mu_k / weakening_factor(sense * v, gamma)

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return where(self.mu_k > self.mu_s, self.mu_k, self.mu_s)

    def set_valued_limit(self) -> "HyperbolicWeakening":
        return self
