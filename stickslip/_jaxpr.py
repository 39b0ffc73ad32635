"""The one walk over a traced program: what an equation makes of its operands is the reader's rule."""

import abc
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

import jax
import jax.extend.core

LITERAL = jax.extend.core.Literal
# Parameters that hold the program of a call, or of a loop.
PROGRAMS = {"jaxpr": None, "call_jaxpr": None, "fun_jaxpr": None, "body_jaxpr": None}.keys()
_NO_CALLS = ("while", "scan", "cond")  # which run theirs another number of times than once


def walk(
    jaxpr: Any,
    given: Sequence,
    rule: Callable[[Any, list], Sequence],
    constant: Callable[[Any, Any], Any],
    consts: Sequence | None = None,
    needed: Sequence | None = None,
) -> list:
    """Results of a program for the operands `given`, each equation by `rule(equation, operands)`.

    A rule returns one value for each result.
    `constant(variable, number)` stands for a number in the program, None where its `consts` are not
    given. `needed`: the equations that are, in their order; all if left out.
    """
    numbers = [None] * len(jaxpr.constvars) if consts is None else consts
    known: dict[Any, Any] = {v: constant(v, x) for v, x in zip(jaxpr.constvars, numbers, strict=True)}
    known.update(zip(jaxpr.invars, given, strict=True))

    def of(atom: Any) -> Any:
        return constant(atom, atom.val) if isinstance(atom, LITERAL) else known[atom]

    for eqn in equations(jaxpr, nowhere) if needed is None else needed:
        found = rule(eqn, [of(atom) for atom in eqn.invars])
        known.update(zip(eqn.outvars, found, strict=True))
    return [of(atom) for atom in jaxpr.outvars]


def nowhere(eqn: Any) -> bool:
    """For `equations` of a program without those of its parameters."""
    return False


class ProgramOnDemand(abc.ABC):
    """A parameter of an equation whose program is traced when somebody asks for it."""

    @abc.abstractmethod
    def program(self, *operands: Any) -> Any:
        """The program, for operands of these shapes and types."""


def equations(jaxpr: Any, enters: Callable[[Any], bool] = lambda eqn: True) -> Iterator[Any]:
    """Equations of a program and, where `enters(equation)`, of all programs in their parameters."""
    for eqn in jaxpr.eqns:
        yield eqn
        if enters(eqn):
            closed = [x for x in eqn.params.values() if isinstance(x, ProgramOnDemand)]
            opened = (x.program(*(var.aval for var in eqn.invars)) for x in closed)
            for inner in (*jax.extend.core.jaxprs_in_params(eqn.params), *opened):
                yield from equations(getattr(inner, "jaxpr", inner), enters)


def called_program(eqn: Any) -> tuple[Any, Sequence] | None:
    """The program that an equation runs once on its operands, and its constants; None without one."""
    if eqn.primitive.name in _NO_CALLS:
        return None
    for key in PROGRAMS:
        inner = eqn.params.get(key)
        if inner is not None:
            jaxpr, consts = getattr(inner, "jaxpr", inner), getattr(inner, "consts", ())
            if len(jaxpr.invars) == len(eqn.invars) and len(jaxpr.outvars) == len(eqn.outvars):
                return jaxpr, consts
    return None


def bound(eqn: Any, values: Sequence) -> list:
    """Results of an equation, computed or traced anew."""
    # Up to JAX 0.9 the callables of a primitive come apart from its parameters.
    found = eqn.primitive.get_bind_params(eqn.params)
    functions, params = found if isinstance(found, tuple) else ((), found)
    out = eqn.primitive.bind(*functions, *values, **params)
    return list(out) if eqn.primitive.multiple_results else [out]


def spelled_out(jaxpr: Any, consts: Sequence, operands: Sequence, names: Collection[str]) -> list:
    """Results of a program, with the calls of these `names` spelled out."""

    def rule(eqn: Any, values: list) -> list:
        inner = called_program(eqn) if eqn.primitive.name in names else None
        return bound(eqn, values) if inner is None else spelled_out(*inner, values, names)

    return walk(jaxpr, operands, rule, lambda _, number: number, consts)
