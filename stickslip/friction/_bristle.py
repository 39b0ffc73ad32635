"""Shared by the bristle laws: a deflection that gives the contact a tangential stiffness."""

import abc

import equinox as eqx
import jax
from jax import lax
from jaxtyping import Array, Float

from stickslip._fastmath import side_of
from stickslip._validation import check_that, is_concrete
from stickslip.friction.law import (
    AbstractFrictionLaw,
    AbstractSmoothedLaw,
    Number,
    State,
    check_law,
    in_dtype_of,
)
from stickslip.hybrid.accuracy import ACCURACY as ENGINE


class AbstractBristleLaw(AbstractSmoothedLaw):
    """Friction carried by elastic bristles that break away one after the other.

    The one internal state is the mean deflection z [m]. The force depends on it, so there is no
    event and no set-valued coefficient: sticking is an elastic presliding displacement. Stiffness
    and damping are per normal force, after Canudas de Wit and Tsiotras (1999), so that the same
    parameters serve a normal force that varies.
    """

    sigma_0: eqx.AbstractVar[Float[Array, "..."]]

    @abc.abstractmethod
    def steady_magnitude(self, v: Number, sense: Number) -> Float[Array, "..."]:
        """Coefficient of steady sliding in `sense` that the bristles themselves carry, positive."""

    @property
    def num_states(self) -> int:
        return 1

    def steady_state(self, v: Number) -> State:
        (v,) = in_dtype_of(v)
        _, sigma_0 = in_dtype_of(v, self.sigma_0)
        return (lax.sign(v) * self.steady_magnitude(v, side_of(v)) / sigma_0,)


def check_steady_law(law: AbstractFrictionLaw) -> None:
    """Raise for laws at which bristles cannot settle: without a jump, or with none in one sense."""
    check_law("law", law, "set-valued")  # the bristles replace its jump
    for sense in (1, -1):
        check_that(
            f"law.kinetic_limit({sense})",
            law.kinetic_limit(sense),
            lambda x: x > 0,
            "positive; bristles divide by it",
        )


def has_breakaway_jump(law: AbstractFrictionLaw) -> bool:
    """Whether the static coefficient is known to exceed the kinetic one in either direction."""
    if not is_concrete(law):
        return False
    with jax.ensure_compile_time_eval():  # the law may be known where its stiffness is traced
        return any(
            # A law whose branch starts at its static coefficient may miss it by rounding.
            bool((law.breakaway_jump(sense) > ENGINE.slack * law.static_coefficient(sense)).any())
            for sense in (1, -1)
        )
