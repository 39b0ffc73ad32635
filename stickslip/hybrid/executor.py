"""How the engine is handed to XLA: portable, or fused into one compiled call. All of it is here.

The parts of an attempt are marked where they are defined: `piece` for those that are differentiated,
`bookkeeping` for those that are not. In a fused program each is a call that the compiler keeps, so that
it is computed once, and yields few numbers, because what several results of one call share is computed
for each. In a portable program the marks do nothing.
"""

import contextlib
import contextvars
import functools
from collections.abc import Callable, Iterator, Sequence
from types import FunctionType
from typing import Any

import equinox as eqx
import jax
import jax.core
import jax.extend
from jax.experimental.xla_metadata import set_xla_metadata
from jax.interpreters.partial_eval import dce_jaxpr
from jaxtyping import PyTree

from .._argument_checks import check_arguments, checked_by
from .._jaxpr import spelled_out
from .._validation import check_flag, check_type

# Attributes XLA's CPU compiler reads on a call. `inlineable="false"` keeps a call a call, so that a
# stage sum is computed once instead of being recomputed by every later stage it is fused into;
# `xla_cpu_small_call` compiles the whole time loop to one function without a dispatch per operation.
# Both are internal to XLA: `_canary.py` proves in a subprocess that this jaxlib still honours them.
_BOUNDARY = {"inlineable": "false"}
_LOOP = {"inlineable": "false", "xla_cpu_small_call": "true"}
LOOP_NAME = "fused_time_loop"  # of the call that holds a whole time loop, in a traced program
ALONG_NAME = "stickslip_along"  # of the equation that has slopes of a run, in a traced program


@check_arguments(**dict.fromkeys(("fused", "compact"), checked_by(check_flag)))
class Executor(eqx.Module):
    """Wraps the pieces of the integrator; the numbers are the same to rounding in all variants.

    `compact`: the smallest program, whatever the batch.
    """

    fused: bool = eqx.field(static=True)
    compact: bool = eqx.field(static=True, default=False)

    @property
    def execute(self) -> "Executor":
        """Itself: what asks a plan for its executor may be given the executor alone."""
        return self

    def for_the_ends(self) -> "Executor":
        """For what is computed a few times after a run: then compiling costs more than running."""
        return self if self.fused else COMPACT

    def trace_once(self, function: Callable) -> Callable:
        """`function` as a boundary that is traced once for all calls with operands of one form.

        To be called where it was made: what the function closes over belongs to the trace around it.
        """
        if not self.fused:
            return jax.jit(function, inline=True)
        # Traced once per form of operands: the stages of a step call one field a dozen times.
        pieces: dict = {}

        def call(*operands):
            leaves, form = jax.tree.flatten(operands)
            key = (form, *map(jax.typeof, leaves))
            if key not in pieces:
                pieces[key] = _Piece(function, operands, _spelled_out)
            return pieces[key](leaves, _BOUNDARY)

        return call


def piece(function: Callable) -> Callable:
    """Mark `function(plan, *operands, **held)` as a part of an attempt that is computed once.

    `operands` are pytrees of arrays; `held`, such as the system with its arguments, may be
    anything. Below the attempt, where there is no plan, an `Executor` stands in its place; so it does
    in programs of authors, which need to know no more of compilers.

    >>> @piece
    ... def doubled(execute, x):
    ...     return x + x
    >>> float(doubled(PORTABLE, 1.0))
    2.0
    """
    check_type("function", function, FunctionType, "a function(execute, *operands, **held)")

    @functools.wraps(function)
    def call(plan: Any, *operands: Any, **held: Any) -> Any:
        return _computed_once(plan.execute, functools.partial(function, plan, **held), *operands)

    return call


def bookkeeping(function: Callable) -> Callable:
    """The same for a part that nothing is differentiated through: gradients end at its operands."""

    @functools.wraps(function)
    def call(plan: Any, *operands: Any, **held: Any) -> Any:
        operands = jax.lax.stop_gradient(operands)
        return _computed_once(plan.execute, functools.partial(function, plan, **held), *operands)

    return call


def time_loop(function: Callable) -> Callable:
    """Mark `function(plan, *operands, **held)` as a whole time loop: fused, one compiled function.

    Arguments as for `piece`. A scatter is not available inside.
    """
    check_type("function", function, FunctionType, "a function(execute, *operands, **held)")

    @functools.wraps(function)
    def call(plan: Any, *operands: Any, **held: Any) -> Any:
        return _as_one(plan.execute, functools.partial(function, plan, **held), *operands)

    return call


def _computed_once(execute: Executor, function: Callable, *operands: PyTree) -> Any:
    """Call `function` such that its result is computed once (fused) or plainly (portable)."""
    return execute.trace_once(function)(*operands) if execute.fused else function(*operands)


def _as_one(execute: Executor, function: Callable, *operands: PyTree) -> Any:
    """Call `function`, a whole time loop, as one compiled function (fused) or plainly."""
    if not execute.fused:
        return function(*operands)
    whole = _Piece(function, operands, _whole)
    # The compiler aborts on a fused call with an operand that nothing depends on. This barrier and
    # that of `_whole` keep it from making one: by moving a constant into the call, or by dropping
    # what the loop carries when its last value is not wanted.
    return whole(jax.tree.leaves(operands), _LOOP, jax.lax.optimization_barrier)


class _Piece:
    """A traced function and the compiled call that computes its results.

    The compiler aborts on a call that only hands its operands through, and on operands that nothing
    depends on. So results that are operands stay outside the call, and operands that only such
    results need do too; derivatives of the call then have none either.
    """

    def __init__(self, function: Callable, operands: tuple, evaluation: Callable):
        jaxpr, self.consts, self.form = closed_jaxpr(function, operands)
        places = {v: i for i, v in enumerate(jaxpr.invars)}
        literal = jax.extend.core.Literal
        # Per result: its value, the operand it is, or that it is computed.
        self.results: list[tuple[str, Any]] = [
            ("value", v.val) if isinstance(v, literal)
            else ("operand", places[v]) if v in places else ("computed", None)
            for v in jaxpr.outvars
        ]  # fmt: skip
        inside = [kind == "computed" for kind, _ in self.results]
        jaxpr, self.used = dce_jaxpr(jaxpr, inside)
        self.compiled = jax.jit(evaluation(jaxpr)) if any(inside) else None

    def __call__(
        self, leaves: Sequence, attributes: dict[str, str], prepare: Callable = lambda values: values
    ) -> Any:
        given = [*self.consts, *leaves]
        computed = iter(())
        if self.compiled is not None:
            with set_xla_metadata(**attributes):
                computed = iter(self.compiled(*prepare(_pick(given, self.used))))
        out = [
            next(computed) if kind == "computed" else given[what] if kind == "operand" else what
            for kind, what in self.results
        ]
        return jax.tree.unflatten(self.form, out)


def _spelled_out(jaxpr: Any) -> Callable:
    # A jitted helper traced where `inlineable="false"` is in force would become a call of its own.
    return lambda *values: spelled_out(jaxpr, (), values, ("jit", "pjit"))


def _whole(jaxpr: Any) -> Callable:
    function = jax.extend.core.jaxpr_as_fun(jax.extend.core.ClosedJaxpr(jaxpr, ()))

    def whole(*values):
        return jax.lax.optimization_barrier(function(*values))

    whole.__name__ = LOOP_NAME
    return whole


PORTABLE = Executor(fused=False)
FUSED = Executor(fused=True)
COMPACT = Executor(fused=False, compact=True)
_current: contextvars.ContextVar[Executor] = contextvars.ContextVar("executor", default=PORTABLE)


def current_executor() -> Executor:
    """Executor that `simulate` uses where it is called (read while tracing)."""
    return _current.get()


@contextlib.contextmanager
def use_executor(executor: Executor) -> Iterator[None]:
    """Have every `simulate` traced inside use `executor`; `TypeError` if it is not an `Executor`."""
    check_type("executor", executor, Executor, "an Executor, FUSED or PORTABLE")
    token = _current.set(executor)
    try:
        yield
    finally:
        _current.reset(token)


def closed_jaxpr(function: Callable, operands: tuple) -> tuple:
    """Jaxpr of `function` on the arrays it closes over and its operands, these arrays, its form."""
    leaves, treedef = jax.tree.flatten(operands)
    out_tree = None

    def flat(*flat_leaves):
        nonlocal out_tree
        out, out_tree = jax.tree.flatten(function(*jax.tree.unflatten(treedef, flat_leaves)))
        return out

    closed = jax.make_jaxpr(flat)(*leaves)
    consts = closed.consts
    # Constants of a jaxpr would be copied into every call; as operands they are handed over.
    if consts:

        def evaluate(*values):
            return jax.core.eval_jaxpr(closed.jaxpr, values[: len(consts)], *values[len(consts) :])

        jaxpr = jax.make_jaxpr(evaluate)(*consts, *leaves).jaxpr
    else:
        jaxpr = closed.jaxpr
    return jaxpr, consts, out_tree


def _pick(items: Sequence, chosen: Sequence[bool]) -> list:
    return [item for item, take in zip(items, chosen, strict=True) if take]
