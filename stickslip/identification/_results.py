"""How fits end."""

import equinox as eqx
from jaxtyping import Array, Int

from .._outcome import in_words
from ..hybrid.status import item_of


@in_words
class RESULTS(eqx.Enumeration):  # pyright: ignore[reportGeneralTypeIssues]
    """Outcome of a fit; `RESULTS[fit.result]` is the message."""

    successful = ""
    max_steps_reached = (
        "The fit, not a run, took all its steps before it converged. Give more to the method, as "
        "`LevenbergMarquardt(max_steps=...)`; start nearer, or see `fit.sensitivity` for combinations "
        "that the data do not see."
    )
    start_not_finite = (
        "The residual at the start is not finite: the run from there failed. Begin elsewhere."
    )
    step_not_finite = "A step could not be computed: the Jacobian is not finite."
    far_from_minimum = (
        "The optimiser took its steps, and the minimum is further away than `tolerance` standard "
        "errors. Give it more steps or another rate."
    )


CODES = ("successful", "max_steps_reached", "start_not_finite", "step_not_finite", "far_from_minimum")
CODE = {name: number for number, name in enumerate(CODES)}


def to_result(code: Int[Array, "*batch"]) -> RESULTS:  # pyright: ignore[reportInvalidTypeForm]
    """`RESULTS` item of a code."""
    return item_of(RESULTS, CODES, code)
