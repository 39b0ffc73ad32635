"""The time loop: attempts until every lane has ended, plain or in blocks that leave rows."""

from collections.abc import Callable
from typing import Any

import equinox.internal as eqxi
import jax
import jax.core
from jax.interpreters.partial_eval import dce_jaxpr
from jaxtyping import PyTree

from ._attempt import attempt
from ._loop_state import Lane, Outcome, Plan
from .executor import time_loop
from .status import RUNNING


def running(lane: Lane) -> Any:
    """Whether any lane of the batch still runs; one unbatched flag, so that `vmap` adds no masks."""
    return eqxi.unvmap_any(lane.status == RUNNING)


def run(plan: Plan, problem: PyTree, lane: Lane, t1: Any, outputs: Any) -> Lane:
    """All attempts, nothing recorded."""

    @time_loop
    def whole(plan, problem, lane, t1, outputs):
        def once(lane):
            return attempt(plan, problem, lane, t1, outputs)[0], None

        step, joined, changing = _changing(once, lane)
        end = jax.lax.while_loop(
            lambda carry: running(joined(carry)), lambda carry: step(carry)[0], changing
        )
        return joined(end)

    return whole(plan, problem, lane, t1, outputs)


def run_block(
    plan: Plan,
    problem: PyTree,
    lane: Lane,
    t1: Any,
    outputs: Any,
    size: int,
    row_of: Callable[[Lane, Lane, Outcome], PyTree],
) -> tuple[Lane, PyTree]:
    """`size` attempts with `row_of(before, after, outcome)` of each, stacked.

    A scan and not a loop that ends early: what it stacks lies with the lanes side by side, so that
    writing a row is one contiguous store. A lane that has ended holds still.
    """

    @time_loop
    def whole(plan, problem, lane, t1, outputs):
        def once(before):
            after, outcome = attempt(plan, problem, before, t1, outputs)
            return after, row_of(before, after, outcome)

        step, joined, changing = _changing(once, lane)
        end, rows = jax.lax.scan(lambda carry, _: step(carry), changing, None, length=size)
        return joined(end), rows

    return whole(plan, problem, lane, t1, outputs)


def _changing(once: Callable, lane: Lane) -> tuple[Callable, Callable, list]:
    """The part of `lane` that `once(lane) -> (lane, rest)` changes, and `once` on this part alone.

    Leaves that never change are closed over: XLA aborts on an operand of a fused loop that is carried
    and never read.

    Returns the step `changing -> (changing, rest)`, the lane of a changing part, and that of `lane`.
    """
    leaves, form = jax.tree.flatten(lane)
    rest_form: Any = None

    def flat(*leaves):
        nonlocal rest_form
        after, rest = once(jax.tree.unflatten(form, leaves))
        rest, rest_form = jax.tree.flatten(rest)
        return [*jax.tree.leaves(after), *rest]

    # A leaf is changed unless the program hands on the very variable it was given. That is asked of
    # the program, not of its author: which fields change depends on system, rule and logs.
    closed = jax.make_jaxpr(flat)(*leaves)
    number = len(leaves)
    changes = [
        out is not leaf
        for out, leaf in zip(closed.jaxpr.outvars[:number], closed.jaxpr.invars, strict=True)
    ]

    others = len(closed.jaxpr.outvars) - number
    # Equations that only served leaves that do not change go too. `instantiate` keeps all inputs, so
    # that they can be filled in by place.
    jaxpr, _ = dce_jaxpr(closed.jaxpr, [*changes, *[True] * others], instantiate=True)

    def changing_of(leaves):
        return [leaf for leaf, changed in zip(leaves, changes, strict=True) if changed]

    def fill_constants(carry):
        carry = iter(carry)
        return [next(carry) if changed else leaf for leaf, changed in zip(leaves, changes, strict=True)]

    def step(carry):
        out = jax.core.eval_jaxpr(jaxpr, closed.consts, *fill_constants(carry))
        changed, rest = out[: sum(changes)], out[sum(changes) :]
        return changed, jax.tree.unflatten(rest_form, rest)

    return step, lambda carry: jax.tree.unflatten(form, fill_constants(carry)), changing_of(leaves)
