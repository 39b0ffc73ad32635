"""Friction proportional to the velocity, with and without the normal force."""

from typing import ClassVar

from jax import lax
from jaxtyping import Array, Float

from stickslip._argument_checks import parameters
from stickslip.friction.law import (
    AbstractDryFrictionLaw,
    AbstractMemorylessLaw,
    Number,
    in_dtype_of,
    shaped_like,
)


class ViscousFriction(AbstractDryFrictionLaw):
    r"""Coefficient proportional to the velocity: the force grows with the normal force too.

    $$\mu(v) = \mu_v v, \qquad T = -\mu_v v N$$

    - At rest: 0, and no static friction.
    - Limits: $\mu(0^\pm) = 0$, $\mu(\pm\infty) = \pm\infty$.
    - Smooth, odd, dissipative. Its own set-valued limit.

    Added to a dry law by `Sum`. For a force that does not depend on the normal force, as in a
    lubricated guide or a bearing, take `ViscousDamping`.

    **Arguments:**

    - `mu_v`: slope of the coefficient [s/m], not negative.

    ??? cite "Reference"

        C. Canudas de Wit and P. Tsiotras, *Dynamic tire friction models for vehicle traction
        control*, IEEE Conference on Decision and Control, 1999 (the term $\sigma_2 v$).
    """

    mu_v: Float[Array, "..."]

    parameter_units: ClassVar = {"mu_v": "s/m"}

    set_valued: ClassVar[bool] = False
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    @parameters(mu_v="not negative")
    def __init__(self, mu_v: Number):
        pass

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense, mu_v = in_dtype_of(v, sense, self.mu_v)
        return shaped_like(sense, mu_v * v)

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return lax.full_like(self.mu_v, 0.0)

    def set_valued_limit(self) -> "ViscousFriction":
        return self


class ViscousDamping(AbstractMemorylessLaw):
    r"""Linear damping, whatever the normal force.

    $$\mu(v) = 0, \qquad T = -d(v) = -c\,v$$

    - At rest: 0, and no static friction.
    - Limits: $d(0^\pm) = 0$, $d(\pm\infty) = \pm\infty$.
    - Smooth, odd, dissipative. Its own set-valued limit.

    **Arguments:**

    - `c`: damping constant [N s/m], not negative.

    ??? cite "Reference"

        B. Armstrong-Hélouvry, P. Dupont and C. Canudas de Wit, *A survey of models, analysis tools
        and compensation methods for the control of machines with friction*, Automatica 30, 1994.
    """

    c: Float[Array, "..."]

    parameter_units: ClassVar = {"c": "N s/m"}

    set_valued: ClassVar[bool] = False
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    @parameters(c="not negative")
    def __init__(self, c: Number):
        pass

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense = in_dtype_of(v, sense)
        return shaped_like(sense, lax.full_like(v, 0.0))

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return lax.full_like(self.c, 0.0)

    def drag(self, v: Number) -> Float[Array, "..."]:
        v, c = in_dtype_of(v, self.c)
        return c * v

    def set_valued_limit(self) -> "ViscousDamping":
        return self
