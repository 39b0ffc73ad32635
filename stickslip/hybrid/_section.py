"""Sections: crossings that are recorded, not acted upon (Poincaré sections)."""

from collections.abc import Callable

import equinox as eqx
import jax
from jax.interpreters.partial_eval import dce_jaxpr
from jaxtyping import PyTree

from .._argument_checks import callable_as, check_arguments, choice, flag, text
from .._one_function import first_alike
from .._types import Numeric, Whole
from .system import DIRECTIONS, AbstractHybridSystem

CALL = "f(system, t, y, dy, mode, args)"


@check_arguments(
    direction=choice(DIRECTIONS), terminal=flag, name=text(), function=callable_as(CALL, *range(6))
)
class Section(eqx.Module):
    """A scalar function of the motion whose zero crossings are recorded.

    **Arguments**

    - `function(system, t, y, dy, mode, args)`: scalar; `system` is the simulated one, so that its
      parameters are those of the run; `dy` is the time derivative of the state, so that an acceleration
      is `dy.v`.
    - `direction`: `"rising"` (from negative to positive), `"falling"`, or `"both"`.
    - `terminal`: whether the motion ends at the first crossing.
    - `name`: label in logs and datasets.

    A crossing belongs to the half-open interval `(t0, t1]`. A value that starts at zero counts only
    after it has left zero; a jump over zero at an event counts at the time of the event, and a zero
    that coincides with an event, as the speed of a body that comes to rest, counts once. Recorded
    sections do not change the motion: a crossing is a change of sign over a step, located after the run
    by repeating this step shorter, to rounding. Where the value does not depend on `dy`, adaptive steps
    are short enough to know it between their ends (`Integrator.detect_dips`). Otherwise, of crossings
    closer together than a step, two are found if the value is convex over the step, of three or more
    one; `AdaptiveStep(dtmax=...)` bounds the step.

    Errors: `ValueError` for an unknown direction, `TypeError` if `function` is not callable.
    """

    function: Callable = eqx.field(static=True, converter=first_alike)
    direction: str = eqx.field(static=True, default="falling")
    terminal: bool = eqx.field(static=True, default=False)
    name: str = eqx.field(static=True, default="section")

    def uses_slope(
        self, system: AbstractHybridSystem, t: Numeric, y: PyTree, dy: PyTree, mode: Whole, args: PyTree
    ) -> bool:
        """Whether the value depends on `dy`; then its rate costs a derivative of the field."""

        def of_slope(dy):
            return self.function(system, t, y, dy, mode, args)

        jaxpr = jax.make_jaxpr(of_slope)(dy).jaxpr
        _, used = dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars))
        return any(used)
