"""The time loop: attempts until every lane has ended, plain or in blocks that are dumped."""

from collections.abc import Callable
from typing import Any

import equinox.internal as eqxi
import jax
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
) -> tuple[Lane, PyTree]:
    """`size` attempts with `dump(before, after, outcome)` of each, stacked.

    A scan and not a loop that ends early: what it stacks lies with the lanes side by side, so that
    writing a row is one contiguous store. A lane that has ended holds still.
    """

    def whole(theta, lane, t1, outputs):
        def body(before, _):
            after, outcome = attempt(plan, theta, before, t1, outputs)
            return after, dump(before, after, outcome)

        return jax.lax.scan(body, lane, None, length=size)

    return plan.execute.loop(whole, theta, lane, t1, outputs)
