"""The friction law of the jointed beam with the sign error of its paper."""

from typing import ClassVar

from jaxtyping import Array, Float

from ..friction.law import AbstractDryFrictionLaw, Number


class PrintedWeakening(AbstractDryFrictionLaw):
    r"""Hyperbolic weakening as Eq. (2.8) prints it, $\mu_s/(1 + \gamma V)\,\mathrm{sgn}\,V$ (C-E2).

    It has a pole at $V = -1/\gamma$, and beyond it drives.
    """

    mu_s: Float[Array, "..."]
    gamma: Float[Array, "..."]

    parameter_units: ClassVar = {"mu_s": "1", "gamma": "s/m"}

    set_valued: ClassVar[bool] = True
    is_odd: ClassVar[bool] = False
    is_dissipative: ClassVar[bool] = False

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        return self.mu_s * sense / (1.0 + self.gamma * v)

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return self.mu_s

    def set_valued_limit(self) -> "PrintedWeakening":
        return self
