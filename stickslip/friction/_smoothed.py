"""Properties that laws without a jump take over from the set-valued law they are made of."""

import equinox as eqx
from jaxtyping import Array, Float

from stickslip.friction.law import AbstractFrictionLaw, Number


class AbstractSmoothedLaw(AbstractFrictionLaw):
    """A smooth stand-in for a set-valued law: its static coefficient, its drag, its symmetry."""

    law: eqx.AbstractVar[AbstractFrictionLaw]

    @property
    def set_valued(self) -> bool:
        return False

    @property
    def is_odd(self) -> bool:
        return self.law.is_odd

    @property
    def is_dissipative(self) -> bool:
        return self.law.is_dissipative

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return self.law.static_coefficient(sense)

    def drag(self, v: Number) -> Float[Array, "..."]:
        return self.law.drag(v)

    def set_valued_limit(self) -> AbstractFrictionLaw:
        return self.law
