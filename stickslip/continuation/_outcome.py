"""Outcomes of the search for a periodic orbit."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp

from .._outcome import in_words
from ..hybrid.status import item_of


@in_words
class ORBITS(eqx.Enumeration):  # pyright: ignore[reportGeneralTypeIssues]
    """Outcome of `periodic_orbit`, per element of a batch.

    `str` of an item is its name, of a batch of them how many there are of each; `ORBITS[item]` says
    what it means and what to do.
    """

    successful = ""
    guess_failed = (
        "The motion from the guess could not be simulated over one period; `simulation` says why."
    )
    not_converged = (
        "Newton's method did not reach the tolerance in the `max_steps` evaluations of "
        "`periodic_orbit` (a run has those of its `Integrator`). Start nearer, or with more `segments`."
    )
    stalled = (
        "No step of Newton's method makes the residual smaller: there is no orbit near the guess, or "
        "it grazes. Start elsewhere, or with more `segments`."
    )
    singular = "The derivative of the return map is not finite: the motion grazes a guard."
    at_rest = "The motion has shrunk to an equilibrium, or its period to nothing."
    mode_differs = "The state returns, but in another mode than it began with."
    not_reproduced = (
        "Simulated once more, in the mode that the system itself gives to the state, the motion does "
        "not return: a guard is violated at the start, or the orbit is too unstable for its accuracy."
    )
    grazes = (
        "Simulated once more, the motion has other events than that whose derivative was taken: it "
        "touches a guard, to rounding, and the derivative may be that of either side. Move a parameter."
    )
    period_differs = (
        "The state returns, but what acts on the system is not what it was a period before: the period "
        "is no multiple of the forcing's, give one that is; or something is not periodic in an angle "
        "of the system's `periods`."
    )


NAMES = tuple(ORBITS._name_to_item)
NUMBER = {name: number for number, name in enumerate(NAMES)}


def first_of(*cases: tuple[Any, str]) -> Any:
    """`ORBITS` item of the first condition that holds, `successful` if none does."""
    # From the last to the first, so that the first that holds is what is left.
    code = jnp.zeros((), jnp.int32)
    for condition, name in reversed(cases):
        code = jnp.where(condition, NUMBER[name], code)
    return item_of(ORBITS, NAMES, code)
