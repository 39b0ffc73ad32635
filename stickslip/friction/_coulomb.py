"""Coulomb's law."""

from typing import ClassVar

from jaxtyping import Array, Float

from stickslip._argument_checks import or_none, parameters
from stickslip._fastmath import where
from stickslip.friction.law import AbstractDryFrictionLaw, Number, in_dtype_of, shaped_like


class Coulomb(AbstractDryFrictionLaw):
    r"""Constant kinetic friction with a static threshold of its own.

    $$\mu(v) = \mu_k\,\mathrm{sgn}\,v \quad (v \ne 0), \qquad |\mu(0)| \le \max(\mu_s, \mu_k)$$

    - At rest: the interval $[-\mu_s, \mu_s]$, or $[-\mu_k, \mu_k]$ where $\mu_s < \mu_k$.
      At $\mu_s = \mu_k$ derivatives are those of $\mu_s \ge \mu_k$, without a flag.
    - Limits: $\mu(0^\pm) = \mu(\pm\infty) = \pm\mu_k$.
    - Set-valued, odd, dissipative.

    **Arguments:**

    - `mu_s`: static coefficient [-], not negative.
    - `mu_k`: kinetic coefficient [-], not negative; equal to `mu_s` if left out.

    ??? cite "Reference"

        C.-A. Coulomb, *Théorie des machines simples*, 1785; the threshold for $\mu_s < \mu_k$ is
        the sliding mode of A. F. Filippov, *Differential Equations with Discontinuous Righthand
        Sides*, Kluwer, 1988.
    """

    mu_s: Float[Array, "..."]
    mu_k: Float[Array, "..."]

    parameter_units: ClassVar = {"mu_s": "1", "mu_k": "1"}

    set_valued: ClassVar[bool] = True
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    @parameters(mu_s="not negative", mu_k=or_none("not negative"))
    def __init__(self, mu_s: Number, mu_k: Number | None = None):
        if mu_k is None:
            self.mu_k = self.mu_s

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense, mu_k = in_dtype_of(v, sense, self.mu_k)
        return shaped_like(v, sense * mu_k)

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return where(self.mu_k > self.mu_s, self.mu_k, self.mu_s)

    def set_valued_limit(self) -> "Coulomb":
        return self
