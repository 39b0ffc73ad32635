"""Sum of friction laws acting in one contact."""

import operator
from functools import reduce

from jaxtyping import Array, Float

from stickslip._validation import refusal
from stickslip.friction.law import (
    AbstractFrictionLaw,
    GivenState,
    Number,
    State,
    check_law,
    in_dtype_of,
)


class Sum(AbstractFrictionLaw):
    r"""Several laws side by side, for instance dry and viscous friction.

    $$\mu(v) = \sum_i \mu_i(v), \qquad d(v) = \sum_i d_i(v)$$

    - At rest: the sum of the intervals.
    - Limits: the sums of the limits.
    - Set-valued if one law is; odd and dissipative if all are; the internal states are those of the
      laws, one after the other.

    **Arguments:**

    - `laws`: at least one law.

    Errors: `TypeError` for a term that is not a friction law.

    ??? cite "Reference"

        B. Armstrong-Hélouvry, P. Dupont and C. Canudas de Wit, *A survey of models, analysis tools
        and compensation methods for the control of machines with friction*, Automatica 30, 1994.
    """

    laws: tuple[AbstractFrictionLaw, ...]

    def __init__(self, *laws: AbstractFrictionLaw):
        if not laws:
            raise refusal("laws", laws, "at least one friction law")
        for i, law in enumerate(laws):
            check_law(f"laws[{i}]", law)
        self.laws = laws

    @property
    def set_valued(self) -> bool:
        return any(law.set_valued for law in self.laws)

    @property
    def is_odd(self) -> bool:
        return all(law.is_odd for law in self.laws)

    @property
    def is_dissipative(self) -> bool:
        return all(law.is_dissipative for law in self.laws)

    @property
    def num_states(self) -> int:
        return sum(law.num_states for law in self.laws)

    def _with_states(self, state: GivenState) -> list[tuple[AbstractFrictionLaw, GivenState]]:
        pairs, start = [], 0
        for law in self.laws:
            pairs.append((law, state[start : start + law.num_states]))
            start += law.num_states
        return pairs

    def kinetic(self, v: Number, sense: Number) -> Float[Array, "..."]:
        v, sense = in_dtype_of(v, sense)
        return reduce(operator.add, (law.kinetic(v, sense) for law in self.laws))

    def static_coefficient(self, sense: Number = 1) -> Float[Array, "..."]:
        return reduce(operator.add, (law.static_coefficient(sense) for law in self.laws))

    def drag(self, v: Number) -> Float[Array, "..."]:
        return reduce(operator.add, (law.drag(v) for law in self.laws))

    def set_valued_limit(self) -> "Sum":
        return Sum(*(law.set_valued_limit() for law in self.laws))

    def steady_state(self, v: Number) -> State:
        return tuple(z for law in self.laws for z in law.steady_state(v))

    def state_rate(self, v: Number, state: GivenState) -> State:
        return tuple(rate for law, own in self._with_states(state) for rate in law.state_rate(v, own))

    def coefficient_from_state(self, v: Number, state: GivenState) -> Float[Array, "..."]:
        return reduce(
            operator.add,
            (law.coefficient_from_state(v, own) for law, own in self._with_states(state)),
        )
