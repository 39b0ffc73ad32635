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

from ._loop_state import Plan
from ._tolerance import largest_of_kinds, least_sizes
from .accuracy import ACCURACY


def too_still(
    plan: Plan, field: Callable, t: Any, lasts: Any, steps: Any, y0: PyTree, y1: PyTree, dy1: PyTree
) -> Any:
    """Whether a run from `y0` to `y1` moved too little for its derivative to be right.

    `lasts` and `steps`: its length [s] and the number of its steps, none of which met an event; `dy1`:
    the slope at its end. A motion that is back where it began has slopes there.
    """
    rule: Any = plan.step_size
    y0, y1, dy1 = jax.lax.stop_gradient((y0, y1, dy1))
    sizes = jax.tree.map(lambda a, b: jnp.maximum(jnp.abs(a), jnp.abs(b)), y0, y1)
    dy0, rate, driven = _start(field, t, y0, sizes)
    mean_step = lasts / jnp.maximum(steps - ACCURACY.still_beginning, 1).astype(jnp.float64)
    terms = jax.tree.leaves(plan.noise.terms)
    leaves = [jax.tree.leaves(tree) for tree in (y0, y1, dy0, dy1, sizes, driven)]
    least = least_sizes(plan.kinds, largest_of_kinds(plan.kinds, leaves[4]), plan.noise)
    still = jnp.ones_like(t) > 0
    rows = zip(*leaves, plan.atols, least, terms, strict=True)
    for a, b, da, db, size, by_others, atol, small, term in rows:
        seen = rule.rtol * jnp.maximum(size, small)
        seen = ACCURACY.unseen_motion * (
            seen + (ACCURACY.few_roundings * term * mean_step if atol is None else atol)
        )
        # A velocity is zero at rest: what it is seen against comes from the positions, in its own unit.
        seen = jnp.minimum(seen, ACCURACY.seen_motion * jnp.maximum(size, by_others))
        moved = jnp.maximum(jnp.abs(b - a), mean_step * jnp.maximum(jnp.abs(da), jnp.abs(db)))
        still = still & jnp.all(moved <= seen)
    longest = ACCURACY.loose ** (1.0 / plan.stepper.order())
    # A run shorter than one over the rate is right even in one step.
    return still & (lasts * rate > 1.0) & (mean_step * rate > longest)


def _start(field: Callable, t: Any, y: PyTree, sizes: PyTree) -> tuple[PyTree, Any, PyTree]:
    """Slope at the start, rate of the linearised field there, what `sizes` drive in one over it.

    The field is applied twice, so that the units of the state cancel.
    """

    def slope_along(direction):
        return jax.jvp(lambda y: field(t, y), (y,), (direction,))

    # Two directions in one batch: the field is in the program once for both.
    directions = jax.tree.map(lambda a, size: jnp.stack([jnp.ones_like(a), size]), y, sizes)
    slope, both = jax.vmap(slope_along, out_axes=(None, 0))(directions)
    largest: Any = 0.0
    for leaf in jax.tree.leaves(slope_along(jax.tree.map(lambda a: a[0], both))[1]):
        largest = jnp.maximum(largest, jnp.max(jnp.abs(leaf)))
    rate = jnp.sqrt(largest)
    time = jnp.where(rate > 0, 1.0 / jnp.where(rate > 0, rate, 1.0), 0.0)
    driven = jax.tree.map(lambda a: time * jnp.abs(a[1]), both)
    return jax.lax.stop_gradient((slope, rate, driven))
