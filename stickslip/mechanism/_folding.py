"""Results of a function that are constant or affine in its operands, read off its jaxpr."""

from collections.abc import Callable
from typing import Any

import jax
import jax.core
import numpy as np

from stickslip._jaxpr import called_program, walk

from ._known import NotArithmetic, operation_of

_LINEAR: dict[str, Callable] = {
    "neg": np.negative, "add": np.add, "add_any": np.add, "sub": np.subtract, "copy": np.asarray,
    "copy_p": np.asarray, "convert_element_type": np.asarray, "broadcast_in_dim": np.asarray,
    "reshape": np.asarray, "squeeze": np.asarray,
}  # fmt: skip


def affine_forms(function: Callable, operands: Any) -> list[np.ndarray | None]:
    """Leaves of `function(*operands)`: a constant, and a coefficient of each operand that is a number.

    None where it is not affine in them. Only scalars and the arithmetic of linear functions are
    followed, without compiling anything; a product with the constant 0 is 0 whatever the other factor.
    """
    closed = jax.make_jaxpr(function)(*operands)
    scalars = [not v.aval.shape for v in closed.jaxpr.invars]
    forms = np.eye(1 + sum(scalars))
    given = [forms[sum(scalars[: i + 1])] if one else None for i, one in enumerate(scalars)]
    return _walk(closed.jaxpr, closed.consts, given, forms[0])


def constants_of(function: Callable, operands: Any) -> list[float | None]:
    """Every leaf of `function(*operands)`: its number if it is a constant, else None."""
    return [_constant(form) for form in affine_forms(function, operands)]


def _constant(form: Any) -> float | None:
    return None if form is None or form[1:].any() else float(form[0])


def _walk(jaxpr: Any, consts: Any, given: list, one: np.ndarray) -> list:
    def constant(variable: Any, number: Any) -> Any:
        if isinstance(number, jax.core.Tracer) or np.ndim(number) or not np.isrealobj(number):
            return None
        return float(number) * one

    with np.errstate(all="ignore"):
        return walk(jaxpr, given, lambda eqn, forms: _equation(eqn, forms, one), constant, consts)


def _equation(eqn: Any, given: list, one: np.ndarray) -> list:
    name, scalars = eqn.primitive.name, all(not v.aval.shape for v in (*eqn.outvars, *eqn.invars))
    inner = called_program(eqn)
    if inner is not None:
        return _walk(*inner, given, one)
    unknown = [None] * len(eqn.outvars)
    if not (scalars and all(np.issubdtype(v.aval.dtype, np.floating) for v in eqn.outvars)):
        return unknown
    constants = [_constant(form) for form in given]
    if name == "mul":
        if 0.0 in constants:
            return [0.0 * one]
        for c, form in (constants[0], given[1]), (constants[1], given[0]):
            if c is not None and form is not None:
                return [c * form]
    elif name == "div" and constants[1] is not None and given[0] is not None:
        return [given[0] / constants[1]]
    elif name == "select_n" and all(form is not None for form in given[1:]):
        same = all(np.array_equal(form, given[1]) for form in given[1:])
        return [given[1]] if same else unknown
    elif name in _LINEAR and all(form is not None for form in given):
        return [_LINEAR[name](*given)]
    if None in constants:
        return unknown
    try:
        return [float(operation_of(eqn)(*constants)) * one]
    except NotArithmetic:
        return unknown
