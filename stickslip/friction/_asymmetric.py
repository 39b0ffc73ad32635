"""Different friction in the two directions."""

import jax
from jaxtyping import Array, Float

from stickslip._fastmath import SMOOTH, where
from stickslip._validation import refusal, shown_value
from stickslip.friction.law import (
    AbstractFrictionLaw,
    AbstractMemorylessLaw,
    Number,
    check_law,
    in_dtype_of,
)


class Asymmetric(AbstractMemorylessLaw):
    r"""One law for each direction of motion.

    $$\mu(v) = \begin{cases}\mu_{+}(v) & v > 0\\ \mu_{-}(v) & v < 0\end{cases}, \qquad
    -\mu_{s-} \le \mu(0) \le \mu_{s+}$$

    - At rest: the interval between the static coefficients of the two laws; 0 if they are smooth.
    - Limits: those of `forward` for $v \to 0^+$ and $+\infty$, of `backward` for the others.
    - Set-valued if both laws are; not odd; dissipative if both are.

    For a bristle form wrap the other way round: `LuGre(Asymmetric(...), ...)`.

    **Arguments:**

    - `forward`: law for v > 0, memoryless.
    - `backward`: law for v < 0, memoryless, set-valued if `forward` is.

    ??? cite "Reference"

        B. Armstrong-Hélouvry, *Control of Machines with Friction*, Kluwer, 1991, measures friction
        that depends on the direction.
    """

    forward: AbstractFrictionLaw
    backward: AbstractFrictionLaw

    def __init__(self, forward: AbstractFrictionLaw, backward: AbstractFrictionLaw):
        for name, law in (("forward", forward), ("backward", backward)):
            if check_law(name, law).num_states > 0:
                wrapped = "a law without internal state (wrap the asymmetric law in the bristle law)"
                raise refusal(name, law, wrapped)
        if forward.set_valued != backward.set_valued:
            kind = "set-valued" if forward.set_valued else "smooth"
            raise refusal("backward", backward, f"{kind}, as forward = {shown_value(forward)} is")
        self.forward = forward
        self.backward = backward

    @property
    def set_valued(self) -> bool:
        return self.forward.set_valued

    @property
    def is_odd(self) -> bool:
        return False

    @property
    def is_dissipative(self) -> bool:
        return self.forward.is_dissipative and self.backward.is_dissipative

    @jax.named_scope(SMOOTH)
    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense = in_dtype_of(v, sense)
        return where(sense < 0, self.backward.kinetic(v, sense), self.forward.kinetic(v, sense))

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        _, sense = in_dtype_of(0.0, sense)
        return where(
            sense < 0,
            self.backward.static_coefficient(sense),
            self.forward.static_coefficient(sense),
        )

    @jax.named_scope(SMOOTH)
    def drag(self, v: Number) -> Float[Array, "..."]:
        (v,) = in_dtype_of(v)
        return where(v < 0, self.backward.drag(v), self.forward.drag(v))

    def set_valued_limit(self) -> "Asymmetric":
        return Asymmetric(self.forward.set_valued_limit(), self.backward.set_valued_limit())
