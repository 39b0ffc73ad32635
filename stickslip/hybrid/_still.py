r"""A run in which nothing moves enough for the tolerance to see: were its steps short all the same?

Step lengths follow the error of the motion. At an equilibrium there is none, steps grow without bound,
and the derivative of the end by the start, $e^{A(t_1 - t_0)}$ of the linearised field $A$, is that of a
few huge steps. The motion is right; its derivative is flagged where the mean step is long against one
over the rate of the linearised field.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._lane import Plan
from ._tolerance import ROUNDING, SMALLEST

UNSEEN = 1e7  # a motion of fewer tolerances than this does not set the length of its steps
# A step times the rate of the field, to the power of the order: derivatives may be 1e-4 off beyond it.
LONGEST = 1e-3
BEGINNING = 10  # steps in which the length may have grown from that of the first to that of the run


def too_still(
    plan: Plan, field: Callable, t: Any, lasts: Any, steps: Any, y0: PyTree, y1: PyTree
) -> Any:
    """Whether a run from `y0` to `y1` moved too little for its derivative to be right.

    `lasts` and `steps`: its length [s] and the number of its steps, none of which met an event.
    """
    rule: Any = plan.step_size
    mean_step = lasts / jnp.maximum(steps - BEGINNING, 1).astype(jnp.float64)
    leaves0, leaves1 = map(jax.tree.leaves, jax.lax.stop_gradient((y0, y1)))
    sizes = [jnp.maximum(jnp.abs(a), jnp.abs(b)) for a, b in zip(leaves0, leaves1, strict=True)]
    most: Any = 0.0
    for size in sizes:
        most = jnp.maximum(most, jnp.max(size))
    still = jnp.ones_like(t) > 0
    terms = jax.tree.leaves(plan.noise.terms)
    for a, b, size, atol, term in zip(leaves0, leaves1, sizes, plan.atols, terms, strict=True):
        seen = rule.rtol * jnp.maximum(size, SMALLEST * most)
        seen = seen + (ROUNDING * term * mean_step if atol is None else atol)
        still = still & jnp.all(jnp.abs(b - a) <= UNSEEN * seen)
    longest = LONGEST ** (1.0 / plan.stepper.order())
    rate = _rate(field, t, y0)
    # A run shorter than one over the rate is right even in one step.
    return still & (lasts * rate > 1.0) & (mean_step * rate > longest)


def _rate(field: Callable, t: Any, y: PyTree) -> Any:
    """Rate of the linearised field [1/s]: twice applied, so that units of the state cancel."""
    y = jax.lax.stop_gradient(y)

    def applied(direction):
        return jax.jvp(lambda y: field(t, y), (y,), (direction,))[1]

    twice = applied(applied(jax.tree.map(jnp.ones_like, y)))
    largest: Any = 0.0
    for leaf in jax.tree.leaves(twice):
        largest = jnp.maximum(largest, jnp.max(jnp.abs(leaf)))
    return jax.lax.stop_gradient(jnp.sqrt(largest))
