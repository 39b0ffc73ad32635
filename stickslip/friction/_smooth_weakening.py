"""The smooth velocity-weakening law of the block on a belt."""

from typing import ClassVar

import jax
from jax import lax
from jaxtyping import Array, Float

from stickslip import _fastmath as fast
from stickslip._argument_checks import parameters
from stickslip.friction._weakening import HyperbolicWeakening, weakening_factor
from stickslip.friction.law import AbstractDryFrictionLaw, Number, in_dtype_of


class SmoothHyperbolicWeakening(AbstractDryFrictionLaw):
    r"""Hyperbolic weakening with a breakaway peak, smooth through rest.

    $$\mu(v) = \frac{\mu_0}{1 + \gamma|v|}\left(1 + \frac{\beta}{\cosh\alpha v}\right)
    \tanh\alpha v$$

    - At rest: 0, with slope $\mu_0\alpha(1 + \beta)$. A loaded contact creeps, it never sticks.
    - Limits: $\mu(0^\pm) = 0$, $\mu(\pm\infty) = 0$ ($\pm\mu_0$ for $\gamma = 0$).
    - Smooth (once differentiable at rest for $\gamma > 0$, else analytic), odd, dissipative.

    **Set-valued limit** $\alpha \to \infty$. For every $v \ne 0$ the curve tends to
    $\mu_0/(1 + \gamma|v|)\,\mathrm{sgn}\,v$. Stretched by $s = \alpha v$ it keeps the shape
    $\mu_0(1 + \beta\,\mathrm{sech}\,s)\tanh s$, whose maximum is the greatest load the contact
    carries while it creeps with vanishing speed: the static coefficient. With
    $c = \mathrm{sech}\,s$ one has to maximise $(1 + \beta c)\sqrt{1 - c^2}$; the derivative
    vanishes where $2\beta c^2 + c - \beta = 0$, so that

    $$c^* = \frac{2\beta}{1 + \sqrt{1 + 8\beta^2}}, \qquad
    \mu_s = \mu_0\,(1 + \beta c^*)\sqrt{1 - c^{*2}}$$

    ($c^* \le 1/\sqrt2$, no cancellation for any $\beta \ge 0$; $\beta = 0$ gives $\mu_s = \mu_0$).
    The peak lies at $|v^*| = \mathrm{arcosh}(1/c^*)/\alpha$ to first order in $1/\alpha$, and is
    lower than $\mu_s$ by the factor $1 - \gamma|v^*|$ to the same order.

    One exponential and one division: with $e = e^{-\alpha|v|}$,
    $\tanh\alpha|v| = (1 - e^2)/(1 + e^2)$ and $\mathrm{sech}\,\alpha v = 2e/(1 + e^2)$. The result
    differs from the formula as printed by at most a few units of rounding of $\mu_0(1 + \beta)$.

    **Arguments:**

    - `mu_0`: coefficient without weakening and peak [-], not negative.
    - `alpha`: steepness at rest [s/m], positive.
    - `beta`: height of the breakaway peak [-], not negative.
    - `gamma`: rate of weakening [s/m], not negative.

    ??? cite "Reference"

        *Influence of Frequency of Excitation on Bifurcational Behaviour of an Experimental 2-DoF
        Mechanical System with Stick-Slip Friction*, Eq. (12). The static limit is derived above.
    """

    mu_0: Float[Array, "..."]
    alpha: Float[Array, "..."]
    beta: Float[Array, "..."]
    gamma: Float[Array, "..."]

    parameter_units: ClassVar = {"mu_0": "1", "alpha": "s/m", "beta": "1", "gamma": "s/m"}

    set_valued: ClassVar[bool] = False
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    @parameters(mu_0="not negative", alpha="positive", beta="not negative", gamma="not negative")
    def __init__(self, mu_0: Number, alpha: Number, beta: Number, gamma: Number):
        pass

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense, mu_0, alpha, beta, gamma = in_dtype_of(
            v, sense, self.mu_0, self.alpha, self.beta, self.gamma
        )
        side = fast.side_of(v)
        e = fast.exp(-alpha * (side * v))
        e2 = e * e
        one = 1.0 + e2
        numerator = (side * mu_0) * (1.0 - e2) * (one + 2.0 * beta * e)
        with jax.named_scope(fast.SMOOTH):  # the denominator has a bound
            return numerator / (weakening_factor(sense * v, gamma) * one * one)

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        sech = 2.0 * self.beta / (1.0 + lax.sqrt(1.0 + 8.0 * self.beta * self.beta))
        return self.mu_0 * (1.0 + self.beta * sech) * lax.sqrt(1.0 - sech * sech)

    def set_valued_limit(self) -> HyperbolicWeakening:
        return HyperbolicWeakening(self.static_coefficient(), self.gamma, self.mu_0)
