"""How the engine is handed to XLA: portable, or fused into one compiled call. All of it is here.

The parts of an attempt are marked where they are defined: `piece` for those that are differentiated,
`bookkeeping` for those that are not. In a fused program each is a call that the compiler keeps, so that
it is computed once, and yields few numbers, because what several results of one call share is computed
for each. In a portable program they do nothing; that of a time loop makes a single run one function.
"""

import contextlib
import contextvars
import functools
import os
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
from .one_call import BOUNDARY, OLDER, as_one_call, lanes_taken

ALONG_NAME = "stickslip_along"  # of the equation that has slopes of a run, in a traced program


@check_arguments(**dict.fromkeys(("fused", "single", "compact"), checked_by(check_flag)))
class Executor(eqx.Module):
    """Wraps the pieces of the integrator; the numbers are the same to rounding in all variants.

    `single`: a time loop that is one function for a single run and for a few, and portable for more.
    `compact`: the smallest program, whatever the batch.
    """

    fused: bool = eqx.field(static=True)
    single: bool = eqx.field(static=True, default=False)
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
                pieces[key] = _Piece(function, operands)
            return pieces[key](leaves)

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
    """Call `function`, a whole time loop, as one compiled function, or plainly (portable)."""
    if not (execute.fused or execute.single):
        return function(*operands)
    leaves, operand_form = jax.tree.flatten(operands)
    traced = [x for x in leaves if isinstance(x, jax.core.Tracer)]

    def of_traced(*traced):
        # Known numbers stay known: the functions of a system may ask in Python which one it has.
        values = iter(traced)
        known = (next(values) if isinstance(x, jax.core.Tracer) else x for x in leaves)
        return function(*jax.tree.unflatten(operand_form, known))

    jaxpr, consts, form = closed_jaxpr(of_traced, tuple(traced))
    given, lanes = [*consts, *traced], None
    if not execute.fused:
        lanes = lanes_taken(jaxpr)
        if lanes == 0:
            return jax.tree.unflatten(form, jax.core.eval_jaxpr(jaxpr, (), *given))
    return jax.tree.unflatten(form, as_one_call(jaxpr, given, lanes))


class _Piece:
    """A traced function and the compiled call that computes its results.

    Results that are operands stay outside the call, and operands that only such results need do too.
    """

    def __init__(self, function: Callable, operands: tuple):
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
        # A jitted helper traced where `inlineable="false"` is in force would become a call of its own.
        self.compiled = jax.jit(lambda *values: spelled_out(jaxpr, (), values, ("jit", "pjit")))

    def __call__(self, leaves: Sequence) -> Any:
        given = [*self.consts, *leaves]
        computed = iter(())
        if any(kind == "computed" for kind, _ in self.results):
            used = [x for x, wanted in zip(given, self.used, strict=True) if wanted]
            with set_xla_metadata(**BOUNDARY):
                computed = iter(self.compiled(*used))
        out = [
            next(computed) if kind == "computed" else given[what] if kind == "operand" else what
            for kind, what in self.results
        ]
        return jax.tree.unflatten(self.form, out)


PORTABLE = Executor(fused=False)
FUSED = Executor(fused=True)
SINGLE = Executor(fused=False, single=True)
COMPACT = Executor(fused=False, compact=True)
WISHES = ("auto", "fused", "portable")
_current: contextvars.ContextVar[Executor] = contextvars.ContextVar("executor", default=SINGLE)


def current_executor() -> Executor:
    """Executor that `simulate` uses where it is called (read while tracing)."""
    found = _current.get()
    plain = wished_executor() == "portable" or not OLDER
    return PORTABLE if found is SINGLE and plain else found


def wished_executor() -> str:
    """`STICKSLIP_EXECUTOR`, by default `"auto"`; `ValueError` for another word than an executor's."""
    given = os.environ.get("STICKSLIP_EXECUTOR", "")
    wish = given.strip().lower() or "auto"
    if wish not in WISHES:
        raise ValueError(
            f"STICKSLIP_EXECUTOR = {given!r}: it must be one of {', '.join(map(repr, WISHES))}."
        )
    return wish


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
