"""Dahl's bristle law."""

from typing import ClassVar

import equinox as eqx
from jax import lax
from jaxtyping import Array, Float

from stickslip import _fastmath as fast
from stickslip._argument_checks import check_arguments, parameters, static_number
from stickslip._validation import refusal
from stickslip.friction._bristle import AbstractBristleLaw, check_steady_law, has_breakaway_jump
from stickslip.friction.law import AbstractFrictionLaw, GivenState, Number, State, in_dtype_of


class Dahl(AbstractBristleLaw):
    r"""Elastic-plastic contact: stiff at first, sliding at the kinetic coefficient of `law`.

    $$\dot z = v\,|r|^{i}\,\mathrm{sgn}\,r, \qquad r = 1 - \frac{\sigma_0 z}{g(v)}\,\mathrm{sgn}\,v,
    \qquad \mu = \sigma_0 z, \qquad g(v) = |\mu_\mathrm{law}(v)|$$

    - At rest: any deflection with $\sigma_0|z| \le g(0^\pm)$ is an equilibrium; no breakaway peak.
    - Steady sliding: $\sigma_0 z = g(v)\,\mathrm{sgn}\,v$, the wrapped law exactly. At constant $v$
      and $i = 1$ the coefficient relaxes over the sliding distance $g/\sigma_0$ exponentially.
    - Limits: those of the wrapped law. For $\sigma_0 \to \infty$ the bristles are rigid and the law
      is the wrapped one.
    - Odd and dissipative in steady sliding if the wrapped law is. Under a constant normal force the
      map from v to the force is passive: bristles return no more than they store,
      $\sigma_0 z^2/2$ per normal force.

    For Dahl's own law wrap `Coulomb(mu)`; any other law makes its sliding friction depend on v.

    **Arguments:**

    - `law`: set-valued, without internal state, with equal static and kinetic coefficients at rest
      (for a breakaway peak take `LuGre`).
    - `sigma_0`: stiffness per normal force [1/m], positive.
    - `exponent`: $i$ [-], positive Python number; 1 for most materials, less for brittle and more
      for ductile ones.

    ??? cite "Reference"

        P. R. Dahl, *A solid friction model*, Aerospace Corporation report TOR-158(3107-18), 1968;
        *Solid friction damping of mechanical vibrations*, AIAA Journal 14, 1976.
    """

    law: AbstractFrictionLaw
    sigma_0: Float[Array, "..."]
    exponent: float = eqx.field(static=True)

    parameter_units: ClassVar = {"sigma_0": "1/m"}

    @check_arguments(exponent=static_number("positive"))
    @parameters(sigma_0="positive")
    def __init__(self, law: AbstractFrictionLaw, sigma_0: Number, exponent: float | int = 1):
        check_steady_law(law)
        if has_breakaway_jump(law):
            equal = "one whose static and kinetic coefficients are equal at rest (LuGre takes any)"
            raise refusal("law", law, equal)
        self.law = law
        self.exponent = float(exponent)

    def steady_magnitude(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense = in_dtype_of(v, sense)
        return sense * self.law.kinetic(v, sense)

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        return self.law.kinetic(v, sense)

    def state_rate(self, v: Number, state: GivenState) -> State:
        v, z, sigma_0 = in_dtype_of(v, *state, self.sigma_0)
        side = fast.side_of(v)
        rest = 1.0 - side * sigma_0 * z / self.steady_magnitude(v, side)
        if self.exponent != 1.0:
            odd = lax.full_like(rest, True, dtype=bool)
            rest = fast.power(rest, lax.full_like(rest, self.exponent), odd)
        return (v * rest,)

    def coefficient_from_state(self, v: Number, state: GivenState) -> Float[Array, "..."]:
        _, z, sigma_0 = in_dtype_of(v, *state, self.sigma_0)
        return sigma_0 * z
