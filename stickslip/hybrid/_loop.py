"""The time loop: attempts until every lane has ended, plain or in blocks that are dumped."""

from collections.abc import Callable
from typing import Any

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._attempt import attempt
from ._lane import Lane, Outcome, Plan
from ._status import RUNNING


def running(lane: Lane) -> Any:
    """Whether any lane of the batch still runs; one unbatched flag, so that `vmap` adds no masks."""
    return eqxi.unvmap_any(lane.status == RUNNING)


def run(plan: Plan, theta: PyTree, lane: Lane, t1: Any, outputs: Any) -> Lane:
    """All attempts, nothing recorded."""

    def whole(theta, lane, t1, outputs):
        def cond(lane):
            return running(lane)

        def body(lane):
            return attempt(plan, theta, lane, t1, outputs)[0]

        return jax.lax.while_loop(cond, body, lane)

    return plan.execute.loop(whole, theta, lane, t1, outputs)


def run_block(
    plan: Plan,
    theta: PyTree,
    lane: Lane,
    t1: Any,
    outputs: Any,
    size: int,
    dump: Callable[[Lane, Lane, Outcome], PyTree],
) -> tuple[Lane, PyTree, Any]:
    """Up to `size` attempts with `dump(before, after, outcome)` of each, stacked, and their number.

    Rows past the number of attempts made are zero.
    """

    def whole(theta, lane, t1, outputs):
        def one(lane):
            after, outcome = attempt(plan, theta, lane, t1, outputs)
            return after, dump(lane, after, outcome)

        shapes = jax.eval_shape(one, lane)[1]
        rows = jax.tree.map(lambda s: jnp.zeros((size, *s.shape), s.dtype), shapes)

        def cond(carry):
            count, lane, _ = carry
            return (count < size) & running(lane)

        def body(carry):
            count, lane, rows = carry
            lane, row = one(lane)
            rows = jax.tree.map(
                lambda buffer, r: jax.lax.dynamic_update_index_in_dim(buffer, r, count, 0),
                rows,
                row,
            )
            return count + 1, lane, rows

        return jax.lax.while_loop(cond, body, (jnp.zeros((), jnp.int32), lane, rows))

    count, lane, rows = plan.execute.loop(whole, theta, lane, t1, outputs)
    return lane, rows, count
