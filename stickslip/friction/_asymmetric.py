"""Different friction in the two directions."""

from jaxtyping import Array, Float

from stickslip._fastmath import where
from stickslip.friction._law import AbstractFrictionLaw, AbstractMemorylessLaw, Number, in_dtype_of


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
            if law.num_states > 0:
                raise ValueError(
                    f"{name} = {type(law).__name__}: it must be a law without internal state. Wrap "
                    f"the asymmetric law in the bristle law instead."
                )
        if forward.set_valued != backward.set_valued:
            kinds = {True: "set-valued", False: "smooth"}
            raise ValueError(
                f"backward = {type(backward).__name__} is {kinds[backward.set_valued]}: it must be "
                f"{kinds[forward.set_valued]} as forward = {type(forward).__name__} is."
            )
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

    def drag(self, v: Number) -> Float[Array, "..."]:
        (v,) = in_dtype_of(v)
        return where(v < 0, self.backward.drag(v), self.forward.drag(v))

    def set_valued_limit(self) -> "Asymmetric":
        return Asymmetric(self.forward.set_valued_limit(), self.backward.set_valued_limit())
