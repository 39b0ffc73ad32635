"""Numbers that a declaration gives for known operands, without a program of their own.

JAX compiles a program for every operation on arrays outside of one. So a declaration is traced
once, and the arithmetic of what it traced to is done by NumPy.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from stickslip._code import code_key
from stickslip._jaxpr import called_program, equations, nowhere, walk
from stickslip._jit_by_code import told_apart

_OPERATIONS: dict[str, Callable] = {
    "add": np.add, "add_any": np.add, "sub": np.subtract, "mul": np.multiply, "neg": np.negative,
    "max": np.maximum, "min": np.minimum, "abs": np.abs, "sign": np.sign, "square": np.square,
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "tanh": np.tanh, "pow": np.power, "copy": np.positive,
    "stop_gradient": np.positive, "gt": np.greater, "ge": np.greater_equal,
    "and": np.bitwise_and, "shift_right_arithmetic": np.right_shift,
    "lt": np.less, "le": np.less_equal, "eq": np.equal, "ne": np.not_equal,
    "rem": np.fmod, "shift_left": np.left_shift, "clamp": lambda low, x, high: np.clip(x, low, high),
}  # fmt: skip


FLOAT = np.dtype(float)


class NotArithmetic(Exception):
    """An operation other than arithmetic on numbers."""


def numbers_known(function: Callable, *operands: Any) -> list[Any] | None:
    """Leaves of `function(*operands)`, numbers of NumPy; None where they are more than arithmetic."""
    program, numbers = kept_trace(function, *operands)
    if not all(isinstance(getattr(x, "dtype", FLOAT), np.dtype) for x in numbers):
        return None  # random keys are arrays, but not of numbers
    return numbers_from(program, [np.asarray(x) for x in numbers])


def kept_trace(function: Callable, *operands: Any) -> tuple[Any, list[Any]]:
    """A function as a program of the floats and arrays among its operands, and those, in its order.

    Kept for operands of the same form and code, so `function` must have a name: a lambda has none.
    """
    leaves, form = jax.tree.flatten(operands)
    arrays = [isinstance(x, jax.Array | np.ndarray | float) for x in leaves]
    rest = tuple(x for x, array in zip(leaves, arrays, strict=True) if not array)
    numbers = [x for x, array in zip(leaves, arrays, strict=True) if array]
    shapes = tuple((np.shape(x), getattr(x, "dtype", FLOAT)) for x in numbers)
    code = (code_key(operands), told_apart(rest))
    key = (function, form, tuple(arrays), rest, shapes, code)
    try:
        hash(key)
    except TypeError:
        return _trace_of.__wrapped__(*key), numbers
    return _trace_of(*key), numbers


def numbers_from(closed: Any, numbers: list[Any]) -> list[Any] | None:
    """Results of a traced function, numbers of NumPy; None where they are more than arithmetic."""
    try:
        return _numbers(closed.jaxpr, closed.consts, numbers)
    except NotArithmetic:
        return None


@functools.lru_cache(maxsize=128)
def _trace_of(
    function: Callable, form: Any, arrays: tuple, rest: tuple, shapes: tuple, code: tuple
) -> Any:
    def of(numbers):
        given, others = iter(numbers), iter(rest)
        leaves = [next(given) if array else next(others) for array in arrays]
        return function(*jax.tree.unflatten(form, leaves))

    return jax.make_jaxpr(of)([jax.ShapeDtypeStruct(*shape) for shape in shapes])


def _numbers(jaxpr: Any, consts: Any, operands: Any) -> list[Any]:
    found = walk(jaxpr, operands, result_of, lambda _, number: number, consts, _needed_equations(jaxpr))
    return [np.asarray(x) for x in found]


@functools.lru_cache(maxsize=256)
def _needed_equations(jaxpr: Any) -> list[Any]:
    """The equations that the results come from: a contact declares more than its normal force."""
    sought, found = set(map(id, jaxpr.outvars)), []
    for eqn in reversed([*equations(jaxpr, nowhere)]):
        if any(id(var) in sought for var in eqn.outvars):
            sought.update(map(id, eqn.invars))
            found.append(eqn)
    return found[::-1]


def result_of(eqn: Any, given: list[Any]) -> list[Any]:
    """Results of one equation; raises `NotArithmetic`."""
    name = eqn.primitive.name
    inner = called_program(eqn) if name in ("jit", "pjit", "custom_jvp_call", "closed_call") else None
    if inner is not None:
        return _numbers(*inner, given)
    if name == "convert_element_type":
        return [np.asarray(given[0]).astype(eqn.params["new_dtype"])]
    if any(np.ndim(x) for x in given):
        raise NotArithmetic
    with np.errstate(all="ignore"):
        if name == "integer_pow":
            return [np.asarray(given[0]) ** float(eqn.params["y"])]
        if name == "div" and np.asarray(given[0]).dtype.kind == "f":
            return [np.true_divide(*given)]
        if name == "round" and eqn.params["rounding_method"] == jax.lax.RoundingMethod.TO_NEAREST_EVEN:
            return [np.rint(given[0])]
        if name == "bitcast_convert_type":
            return [np.asarray(given[0]).view(eqn.params["new_dtype"])]
        if name == "select_n":
            return [given[1 + int(given[0])]]
        if name in _OPERATIONS:
            return [_OPERATIONS[name](*given)]
    raise NotArithmetic
