"""How the results of a function depend on its operands, read off its jaxpr while tracing.

Two questions about a system are answered before it runs: does its motion depend on the time itself
(then a rest may end without the state having changed), and which event functions are straight lines
along a cubic (then the cubic through their ends is exact, and there is nothing to check).
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax

from .._fastmath import SMOOTH
from .._jaxpr import PROGRAMS, called_program, walk

NONE, AFFINE, OTHER = range(3)  # degree of a result in the operands asked about

_LINEAR = {
    "add", "add_any", "sub", "neg", "copy", "copy_p", "convert_element_type", "broadcast_in_dim",
    "reshape", "squeeze", "expand_dims", "slice", "concatenate", "reduce_sum", "transpose", "cumsum",
    "rev", "split", "stack", "unstack", "real", "optimization_barrier",
}  # fmt: skip
_BILINEAR = {"mul", "dot_general"}
_INDEXED = {"gather", "dynamic_slice"}  # linear in the first operand if the others are constant
_STEPS = {"sign", "floor", "ceil", "round", "rem"}
# Functions that have a pole, a cut or the end of where they have a value, or level off.
_SUDDEN = {
    "acos", "acosh", "asin", "atan", "atan2", "atanh", "cbrt", "erf", "exp", "log", "log1p", "logistic",
    "pow", "rsqrt", "sqrt", "tan", "tanh",
}  # fmt: skip


def degrees(function: Callable, operands: tuple, asked: Sequence[bool]) -> list[int]:
    """Degree of each leaf of `function(*operands)` in the operands that are `asked` about.

    `NONE`: independent of them. `AFFINE`: affine in them. `OTHER`: anything else, or unknown.
    """
    flags = [
        wanted
        for operand, wanted in zip(operands, asked, strict=True)
        for _ in jax.tree.leaves(operand)
    ]
    return degrees_in(jax.make_jaxpr(function)(*operands), flags)


def degrees_in(closed: Any, asked: Sequence[bool]) -> list[int]:
    """`degrees` of each result of a program in those of its operands that are `asked` about."""
    return _walk(closed.jaxpr, [AFFINE if wanted else NONE for wanted in asked])


def may_jump(function: Callable, operands: tuple) -> bool:
    """Whether `function` compares or rounds what depends on its operands.

    A function with a derivative of its own making (`jax.custom_jvp`) is taken as smooth.
    """
    return _any(function, operands, _compares_or_rounds)


def may_change_suddenly(function: Callable, operands: tuple) -> bool:
    """Whether `function` divides by what depends on its operands, or has a function of it with a pole,
    a cut, or that levels off: `x / sqrt(x * x)` jumps without a comparison.

    A function that is declared smooth does not count.
    """
    return _any(function, operands, _divides)


def _compares_or_rounds(eqn: Any, inputs: list[int]) -> bool:
    return eqn.primitive.name in _STEPS or not all(map(_is_real, eqn.outvars))


def _divides(eqn: Any, inputs: list[int]) -> bool:
    name = eqn.primitive.name
    found = name in _SUDDEN or (name == "div" and inputs[1] != NONE) or eqn.params.get("y", 0) < 0
    return found and SMOOTH not in str(eqn.source_info.name_stack)


def _any(function: Callable, operands: tuple, is_one: Callable) -> bool:
    closed = jax.make_jaxpr(function)(*operands)
    return _finds(closed.jaxpr, [AFFINE] * len(closed.jaxpr.invars), is_one)


def _finds(jaxpr: Any, given: Sequence[int], is_one: Callable) -> bool:
    found = []

    def rule(eqn: Any, inputs: list[int]) -> list[int]:
        name = eqn.primitive.name
        if max(inputs, default=NONE) != NONE and not name.startswith("custom_jvp"):
            found.append(is_one(eqn, inputs))
            if name == "cond":
                found.extend(_finds(b.jaxpr, inputs[1:], is_one) for b in eqn.params["branches"])
            elif not PROGRAMS.isdisjoint(eqn.params):
                inner = called_program(eqn)  # None: a loop, which may do anything
                found.append(inner is None or _finds(inner[0], inputs, is_one))
        return _equation(eqn, inputs)

    walk(jaxpr, given, rule, _constant)
    return any(found)


def _walk(jaxpr: Any, given: Sequence[int]) -> list[int]:
    return walk(jaxpr, given, _equation, _constant)


def _constant(variable: Any, number: Any) -> int:
    return NONE


def _equation(eqn: Any, given: list[int]) -> list[int]:
    name, count = eqn.primitive.name, len(eqn.outvars)
    most = max(given, default=NONE)
    if most == NONE:
        return [NONE] * count
    if name in _LINEAR:
        # A conversion to an integer or a truth value is a step function.
        smooth = all(_is_real(v) for v in eqn.outvars)
        return [most if smooth else OTHER] * count
    if name in _BILINEAR:
        return [AFFINE if sum(given) == AFFINE else OTHER] * count
    if name == "div":
        return [most if given[1] == NONE else OTHER]
    if name == "select_n" or name in _INDEXED:
        fixed = given[:1] if name == "select_n" else given[1:]
        return [most if max(fixed, default=NONE) == NONE else OTHER] * count
    if name == "cond" and given[0] == NONE:
        branches = [_walk(b.jaxpr, given[1:]) for b in eqn.params["branches"]]
        return [max(column) for column in zip(*branches, strict=True)]
    inner = called_program(eqn)
    return [OTHER] * count if inner is None else _walk(inner[0], given)


def _is_real(var: Any) -> bool:
    return jax.numpy.issubdtype(var.aval.dtype, jax.numpy.floating)
