"""A function with several results as pieces of a fused program: what they share is computed once.

Within one call the compiler computes for every result all that it depends on. Expensive values
that several results need become calls of their own here.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
from jaxtyping import PyTree

from .._jaxpr import LITERAL, bound, spelled_out
from .accuracy import ACCURACY
from .executor import Executor, closed_jaxpr

_FREE = {"broadcast_in_dim", "convert_element_type", "copy", "reshape", "squeeze", "neg", "pjit"}
_DEAR = {
    "acos", "asin", "atan", "atan2", "cbrt", "cos", "cosh", "div", "erf", "exp", "exp2", "expm1", "log",
    "log1p", "pow", "rem", "rsqrt", "sin", "sinh", "sqrt", "tan", "tanh",
}  # fmt: skip
_INLINED = ("jit", "pjit", "closed_call", "custom_jvp_call")


def in_pieces(execute: Executor, function: Callable) -> Callable:
    """`function` as boundaries, traced once for all calls with operands of one form.

    To be called where it was made, and not to be differentiated: derivatives that a function defines
    of itself are gone. In a portable program it is `function`.
    """
    if not execute.fused:
        return execute.trace_once(function)
    known: dict = {}

    def call(*operands: PyTree) -> Any:
        leaves, form = jax.tree.flatten(operands)
        key = (form, *map(jax.typeof, leaves))
        if key not in known:
            known[key] = _Pieces(execute, function, operands)
        return known[key](leaves)

    return call


class _Pieces:
    """A traced function cut where several of its results want the same."""

    def __init__(self, execute: Executor, function: Callable, operands: tuple):
        jaxpr, self.consts, self.form = closed_jaxpr(function, operands)
        closed = _flat(jaxpr)
        self.jaxpr = closed.jaxpr
        self.consts = [*self.consts]
        self.fixed = closed.consts
        equations = self.jaxpr.eqns
        made_by = {var: i for i, eqn in enumerate(equations) for var in eqn.outvars}
        results = [v for v in _variables(self.jaxpr.outvars) if v in made_by]
        cuts = worthwhile_pieces(equations, [made_by[var] for var in results])
        # In the order in which they are made, so that each finds those before it.
        targets = [equations[i].outvars for i in sorted(cuts)]
        self.steps = []
        at_hand = [*self.jaxpr.constvars, *self.jaxpr.invars]
        for wanted in [*targets, results]:
            inputs, program = _part(equations, made_by, at_hand, wanted)
            if wanted:
                self.steps.append((execute.trace_once(program), inputs, wanted))
            at_hand += wanted

    def __call__(self, leaves: Sequence) -> Any:
        given = [*self.fixed, *self.consts, *leaves]
        values = dict(zip([*self.jaxpr.constvars, *self.jaxpr.invars], given, strict=True))
        for program, inputs, wanted in self.steps:
            values.update(zip(wanted, program(*(values[var] for var in inputs)), strict=True))
        out = [v.val if isinstance(v, LITERAL) else values[v] for v in self.jaxpr.outvars]
        return jax.tree.unflatten(self.form, out)


def worthwhile_pieces(equations: Sequence, results: Sequence[int]) -> set[int]:
    """Numbers of the equations whose results are worth a call of their own.

    `results`: numbers of the equations that make the results of the whole. One after the other, the cut
    is taken that saves most operations, until none saves enough.
    """
    made_by = {var: i for i, eqn in enumerate(equations) for var in eqn.outvars}
    parents = [{made_by[v] for v in _variables(eqn.invars) if v in made_by} for eqn in equations]
    cost = [_cost(eqn) for eqn in equations]
    cuts: set[int] = set()
    while True:
        behind, ahead = _behind(parents, cuts), _ahead(parents, cuts, set(results))
        best, most = None, ACCURACY.worth_a_call
        for i in range(len(equations)):
            if i in cuts or ahead[i].bit_count() < 2:
                continue
            own = sum(cost[j] for j in _members(behind[i]))
            saved = own * (ahead[i].bit_count() - 1)
            if saved > most:
                best, most = i, saved
        if best is None:
            return cuts
        cuts.add(best)


def _behind(parents: list[set[int]], cuts: set[int]) -> list[int]:
    """For each equation, as a set of bits: itself and those it needs, up to the cuts."""
    found: list[int] = []
    for i, needs in enumerate(parents):
        bits = 1 << i
        for j in needs - cuts:
            bits |= found[j]
        found.append(bits)
    return found


def _ahead(parents: list[set[int]], cuts: set[int], results: set[int]) -> list[int]:
    """For each equation: the cuts and results that need it without a cut between."""
    found = [0] * len(parents)
    for i in reversed(range(len(parents))):
        own = 1 << i if i in cuts or i in results else 0
        if i in results:
            found[i] |= own
        # A cut piece is computed once for all its readers.
        handed = own if i in cuts else found[i]
        for j in parents[i]:
            found[j] |= handed
    return found


def _members(bits: int) -> list[int]:
    return [i for i, digit in enumerate(reversed(bin(bits)[2:])) if digit == "1"]


def _cost(eqn: Any) -> int:
    name = eqn.primitive.name
    return 0 if name in _FREE else 10 if name in _DEAR else 1


def _variables(atoms: Sequence) -> list:
    return [atom for atom in atoms if not isinstance(atom, LITERAL)]


def _part(equations, made_by, at_hand, wanted) -> tuple[list, Callable]:
    """Variables `at_hand` that are needed for those `wanted`, and the program that makes these."""
    available, needed, inputs = set(at_hand), set(), []
    stack = [var for var in wanted if var not in available]
    while stack:
        number = made_by[stack.pop()]
        if number in needed:
            continue
        needed.add(number)
        for var in _variables(equations[number].invars):
            if var not in available:
                stack.append(var)
            elif var not in inputs:
                inputs.append(var)
    inputs += [var for var in wanted if var in available and var not in inputs]
    order = sorted(needed)

    def program(*operands):
        values = dict(zip(inputs, operands, strict=True))
        for number in order:
            eqn = equations[number]
            given = [a.val if isinstance(a, LITERAL) else values[a] for a in eqn.invars]
            values.update(zip(eqn.outvars, bound(eqn, given), strict=True))
        return [values[var] for var in wanted]

    return inputs, program


def _flat(jaxpr: Any) -> Any:
    """The same with the functions called inside spelled out."""

    def run(*operands):
        return spelled_out(jaxpr, (), operands, _INLINED)

    shapes = [jax.ShapeDtypeStruct(v.aval.shape, v.aval.dtype) for v in jaxpr.invars]
    return jax.make_jaxpr(run)(*shapes)
