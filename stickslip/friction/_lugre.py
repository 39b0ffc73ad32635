"""The LuGre bristle law."""

from typing import ClassVar

from jaxtyping import Array, Float

from stickslip import _fastmath as fast
from stickslip._argument_checks import or_none, parameters
from stickslip._validation import refusal, shown_value
from stickslip.friction._bristle import AbstractBristleLaw, check_steady_law, has_breakaway_jump
from stickslip.friction._sum import Sum
from stickslip.friction._viscous import ViscousFriction
from stickslip.friction.law import AbstractFrictionLaw, GivenState, Number, State, in_dtype_of, jump_in


class LuGre(AbstractBristleLaw):
    r"""Bristles with stiffness and damping whose steady sliding follows `law`.

    $$\dot z = v - \sigma_0\frac{|v|}{g(v)}z, \qquad
    \mu = \sigma_0 z + \sigma_1\dot z + \sigma_2 v$$

    $$g(v) = |\mu_\mathrm{law}(v)| + \left(\mu_s - |\mu_\mathrm{law}(0^\pm)|\right)e^{-(v/v_s)^2}$$

    - At rest: any deflection is an equilibrium; one within $\sigma_0|z| \le \max g$ stays there.
    - Steady sliding: $g(v)\,\mathrm{sgn}\,v + \sigma_2 v$. Without `v_s` the bristles follow the
      wrapped law exactly, with it far above $v_s$. At constant $v$, $z$ relaxes exponentially over
      the sliding distance $g/\sigma_0$.
    - Limits: those of the wrapped law plus $\sigma_2 v$, but $|\mu(0^\pm)| = \mu_s$. For
      $\sigma_0 \to \infty$ the bristles are rigid and the law is the wrapped one plus
      $\sigma_2 v$.
    - Odd and dissipative in steady sliding if the wrapped law is. Under a constant normal force
      the map from v to the force is passive if
      $\sigma_2 \ge \sigma_1(\max g - \min g)/\min g$.

    The law as published is `LuGre(Stribeck(mu_s, mu_k, v_s), ...)`, or the same written
    `LuGre(Coulomb(mu_s, mu_k), ..., v_s=v_s)`: a law whose static coefficient exceeds the kinetic
    one needs the velocity `v_s` over which bristles pass from one to the other.

    **Arguments:**

    - `law`: set-valued, without internal state, with a positive coefficient at rest.
    - `sigma_0`: stiffness per normal force [1/m], positive.
    - `sigma_1`: bristle damping per normal force [s/m], not negative. A mass $m$ under the normal force
      $N$ comes to rest on its bristles without ringing at $2\sqrt{\sigma_0 m/N}$; much more makes the
      friction of slow slips too large.
    - `sigma_2`: viscous friction per normal force [s/m], not negative.
    - `v_s`: Stribeck velocity of the excess of static friction [m/s], positive; left out where the
      law has no such excess.

    ??? cite "Reference"

        C. Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, *A new model for control of
        systems with friction*, IEEE Transactions on Automatic Control 40, 1995; per normal force:
        C. Canudas de Wit and P. Tsiotras, IEEE Conference on Decision and Control, 1999; passivity:
        N. Barabanov and R. Ortega, IEEE Transactions on Automatic Control 45, 2000.
    """

    law: AbstractFrictionLaw
    sigma_0: Float[Array, "..."]
    sigma_1: Float[Array, "..."]
    sigma_2: Float[Array, "..."]
    v_s: Float[Array, "..."] | None

    parameter_units: ClassVar = {"sigma_0": "1/m", "sigma_1": "s/m", "sigma_2": "s/m", "v_s": "m/s"}

    @parameters(
        sigma_0="positive", sigma_1="not negative", sigma_2="not negative", v_s=or_none("positive"),
    )  # fmt: skip
    def __init__(
        self,
        law: AbstractFrictionLaw,
        sigma_0: Number,
        sigma_1: Number = 0.0,
        sigma_2: Number = 0.0,
        v_s: Number | None = None,
    ):
        check_steady_law(law)
        if v_s is None and has_breakaway_jump(law):
            why = f"law = {shown_value(law)} has a static coefficient above its kinetic one"
            raise refusal("v_s", None, f"a positive Stribeck velocity, because {why}")
        self.law = law

    def steady_magnitude(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense = in_dtype_of(v, sense)
        branch = sense * self.law.kinetic(v, sense)
        if self.v_s is None:
            return branch
        _, v_s, jump = in_dtype_of(v, self.v_s, jump_in(self.law, sense))
        u = v / v_s
        return branch + jump * fast.exp(-(u * u))

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense, sigma_2 = in_dtype_of(v, sense, self.sigma_2)
        return sense * self.steady_magnitude(v, sense) + sigma_2 * v

    def state_rate(self, v: Number, state: GivenState) -> State:
        v, z, sigma_0 = in_dtype_of(v, *state, self.sigma_0)
        side = fast.side_of(v)
        return (v - sigma_0 * (side * v) * z / self.steady_magnitude(v, side),)

    def coefficient_from_state(self, v: Number, state: GivenState) -> Float[Array, "..."]:
        v, z, sigma_0, sigma_1, sigma_2 = in_dtype_of(
            v, *state, self.sigma_0, self.sigma_1, self.sigma_2
        )
        (rate,) = self.state_rate(v, state)
        return sigma_0 * z + sigma_1 * rate + sigma_2 * v

    def set_valued_limit(self) -> AbstractFrictionLaw:
        return Sum(self.law, ViscousFriction(self.sigma_2))
