"""Results of a function that are constant or affine in its operands, read off its jaxpr."""

from collections.abc import Callable
from typing import Any

import jax
import jax.core
import jax.extend.core
import numpy as np

from ._known import NotArithmetic, result_of

_LINEAR: dict[str, Callable] = {
    "neg": np.negative, "add": np.add, "add_any": np.add, "sub": np.subtract, "copy": np.asarray,
    "copy_p": np.asarray, "convert_element_type": np.asarray, "broadcast_in_dim": np.asarray,
    "reshape": np.asarray, "squeeze": np.asarray,
}  # fmt: skip
_CALLS = ("jaxpr", "call_jaxpr", "fun_jaxpr")


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


def folded(function: Callable, operands: Any) -> list[float | None]:
    """Every leaf of `function(*operands)`: its number if it is a constant, else None."""
    return [_constant(form) for form in affine_forms(function, operands)]


def _constant(form: Any) -> float | None:
    return None if form is None or form[1:].any() else float(form[0])


def _walk(jaxpr: Any, consts: Any, given: list, one: np.ndarray) -> list:
    known: dict[Any, Any] = dict(zip(jaxpr.invars, given, strict=True))

    def number(value: Any) -> Any:
        if isinstance(value, jax.core.Tracer) or np.ndim(value) or not np.isrealobj(value):
            return None
        return float(value) * one

    def of(atom: Any) -> Any:
        if isinstance(atom, jax.extend.core.Literal):
            return number(atom.val)
        return known.get(atom)

    known.update(zip(jaxpr.constvars, map(number, consts), strict=True))
    with np.errstate(all="ignore"):
        for eqn in jaxpr.eqns:
            found = _equation(eqn, [of(atom) for atom in eqn.invars], one)
            known.update(zip(eqn.outvars, found, strict=True))
    return [of(atom) for atom in jaxpr.outvars]


def _equation(eqn: Any, given: list, one: np.ndarray) -> list:
    name, scalars = eqn.primitive.name, all(not v.aval.shape for v in (*eqn.outvars, *eqn.invars))
    for key in _CALLS:
        inner = eqn.params.get(key)
        if inner is not None and name not in ("while", "scan", "cond"):
            consts, inner = getattr(inner, "consts", ()), getattr(inner, "jaxpr", inner)
            if len(inner.invars) == len(given) and len(inner.outvars) == len(eqn.outvars):
                return _walk(inner, consts, given, one)
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
        return [float(x) * one for x in result_of(eqn, constants)]
    except NotArithmetic:
        return unknown
