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


def empty_rows(plan: Plan, theta: PyTree, lane: Lane, t1: Any, outputs: Any, size: int, dump) -> PyTree:
    """Room for `size` dumped attempts."""

    def one(lane):
        after, outcome = attempt(plan, theta, lane, t1, outputs)
        return dump(lane, after, outcome)

    shapes = jax.eval_shape(one, lane)
    return jax.tree.map(lambda s: jnp.zeros((size, *s.shape), s.dtype), shapes)


def run_block(
    plan: Plan,
    theta: PyTree,
    lane: Lane,
    t1: Any,
    outputs: Any,
    rows: PyTree,
    dump: Callable[[Lane, Lane, Outcome], PyTree],
) -> tuple[Lane, PyTree, Any]:
    """As many attempts as `rows` has room for, `dump(before, after, outcome)` of each written there.

    Returns the lane, the rows and the number of attempts made; rows past it keep their content.
    """
    size = jax.tree.leaves(rows)[0].shape[0]

    def whole(theta, lane, t1, outputs, rows):
        def cond(carry):
            count, lane, _ = carry
            return (count < size) & running(lane)

        def body(carry):
            count, before, rows = carry
            lane, outcome = attempt(plan, theta, before, t1, outputs)
            rows = jax.tree.map(
                lambda buffer, r: jax.lax.dynamic_update_index_in_dim(buffer, r, count, 0),
                rows,
                dump(before, lane, outcome),
            )
            return count + 1, lane, rows

        return jax.lax.while_loop(cond, body, (jnp.zeros((), jnp.int32), lane, rows))

    count, lane, rows = plan.execute.loop(whole, theta, lane, t1, outputs, rows)
    return lane, rows, count
