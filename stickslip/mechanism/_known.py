"""Numbers that a declaration gives for known operands, without a program of their own.

JAX compiles a program for every operation on arrays outside of one. So a declaration is traced
once, and the arithmetic of what it traced to is done by NumPy.
"""

import functools
import operator
from collections.abc import Callable
from typing import Any

import jax
import jax.core
import numpy as np

from stickslip._code import code_key
from stickslip._jaxpr import called_program, equations, nowhere, walk
from stickslip._jit_by_code import told_apart

# Between scalars of NumPy an operator takes a tenth of what its universal function does.
_OPERATIONS: dict[str, Callable] = {
    "add": operator.add, "add_any": operator.add, "sub": operator.sub, "mul": operator.mul,
    "neg": operator.neg, "abs": operator.abs,
    "max": np.maximum, "min": np.minimum, "sign": np.sign, "square": np.square,
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "tanh": np.tanh, "pow": np.power, "copy": operator.pos,
    "stop_gradient": operator.pos, "gt": operator.gt, "ge": operator.ge,
    "and": operator.and_, "shift_right_arithmetic": np.right_shift,
    "lt": operator.lt, "le": operator.le, "eq": operator.eq, "ne": operator.ne,
    "rem": np.fmod, "shift_left": np.left_shift, "clamp": lambda low, x, high: np.clip(x, low, high),
}  # fmt: skip


FLOAT = np.dtype(float)


class NotArithmetic(Exception):
    """An operation other than arithmetic on numbers."""


def numbers_known(function: Callable, *operands: Any) -> list[Any] | None:
    """Leaves of `function(*operands)`, numbers of NumPy; None where they are more than arithmetic."""
    program, numbers = kept_trace(function, *operands)
    for x in numbers:
        if type(x) is not np.ndarray and not isinstance(getattr(x, "dtype", FLOAT), np.dtype):
            return None  # random keys are arrays, but not of numbers
    return numbers_from(program, [np.asarray(x)[()] for x in numbers])


def kept_trace(function: Callable, *operands: Any) -> tuple[Any, list[Any]]:
    """A function as a program of the floats and arrays among its operands, and those, in its order.

    Kept for operands of the same form and code, so `function` must have a name: a lambda has none.
    """
    leaves, form = jax.tree.flatten(operands)
    # An array of NumPy first: whether something is one of JAX takes ten times as long to ask.
    arrays = [isinstance(x, np.ndarray | float) or isinstance(x, jax.Array) for x in leaves]
    rest = tuple([x for x, array in zip(leaves, arrays, strict=True) if not array])
    numbers = [x for x, array in zip(leaves, arrays, strict=True) if array]
    shapes = tuple([(getattr(x, "shape", ()), getattr(x, "dtype", FLOAT)) for x in numbers])
    code = (code_key(operands), told_apart(rest))
    key = (function, form, tuple(arrays), rest, shapes, code)
    try:
        hash(key)
    except TypeError:
        return _trace_of.__wrapped__(*key), numbers
    return _trace_of(*key), numbers


def numbers_from(closed: Any, numbers: list[Any]) -> list[Any] | None:
    """Results of a traced function, numbers of NumPy; None where they are more than arithmetic."""
    arithmetic = _arithmetic_of(closed)
    return None if arithmetic is None else arithmetic(numbers)


@functools.lru_cache(maxsize=128)
def _trace_of(
    function: Callable, form: Any, arrays: tuple, rest: tuple, shapes: tuple, code: tuple
) -> Any:
    def of(numbers):
        given, others = iter(numbers), iter(rest)
        leaves = [next(given) if array else next(others) for array in arrays]
        return function(*jax.tree.unflatten(form, leaves))

    return jax.make_jaxpr(of)([jax.ShapeDtypeStruct(*shape) for shape in shapes])


class _Arithmetic:
    """A traced program as operations of NumPy, one after the other; raises `NotArithmetic`."""

    def __init__(self, closed: Any):
        jaxpr = closed.jaxpr
        self.places: list[Any] = [None] * len(jaxpr.invars)  # operands, then constants and results
        self.operations: list[tuple[Callable, list[int], int]] = []
        self.results = self._walk(jaxpr, closed.consts, [*range(len(jaxpr.invars))])
        read = {i for _, operands, _ in self.operations for i in operands}.union(self.results)
        if any(isinstance(self.places[i], jax.core.Tracer) for i in read):
            raise NotArithmetic  # closed over a number that a trace around this one does not know

    def _walk(self, jaxpr: Any, consts: Any, operands: list[int]) -> list[int]:
        def place(_: Any, number: Any) -> int:
            of_numbers = isinstance(getattr(number, "dtype", FLOAT), np.dtype)  # not of random keys
            known = of_numbers and not isinstance(number, jax.core.Tracer)
            self.places.append(np.asarray(number)[()] if known else number)
            return len(self.places) - 1

        return walk(jaxpr, operands, self._rule, place, consts, _needed_equations(jaxpr))

    def _rule(self, eqn: Any, operands: list[int]) -> list[int]:
        called = eqn.primitive.name in ("jit", "pjit", "custom_jvp_call", "closed_call")
        inner = called_program(eqn) if called else None
        if inner is not None:
            return self._walk(*inner, operands)
        self.places.append(None)
        self.operations.append((operation_of(eqn), operands, len(self.places) - 1))
        return [len(self.places) - 1]

    def __call__(self, numbers: list[Any]) -> list[Any]:
        known = self.places.copy()
        known[: len(numbers)] = numbers
        with np.errstate(all="ignore"):
            for operation, operands, result in self.operations:
                known[result] = operation(*[known[i] for i in operands])
        return [np.asarray(known[i]) for i in self.results]


@functools.lru_cache(maxsize=256)
def _arithmetic_of(closed: Any) -> _Arithmetic | None:
    try:
        return _Arithmetic(closed)
    except NotArithmetic:
        return None


def _needed_equations(jaxpr: Any) -> list[Any]:
    """The equations that the results come from: a contact declares more than its normal force."""
    sought, found = set(map(id, jaxpr.outvars)), []
    for eqn in reversed([*equations(jaxpr, nowhere)]):
        if any(id(var) in sought for var in eqn.outvars):
            sought.update(map(id, eqn.invars))
            found.append(eqn)
    return found[::-1]


def operation_of(eqn: Any) -> Callable:
    """The function of NumPy that is the operation of an equation; raises `NotArithmetic`."""
    name, params = eqn.primitive.name, eqn.params
    if name == "convert_element_type":
        return lambda x: np.asarray(x).astype(params["new_dtype"])
    if any(var.aval.shape for var in eqn.invars):
        raise NotArithmetic
    if name == "integer_pow":
        exponent = float(params["y"])
        return lambda x: np.asarray(x) ** exponent
    if name == "div" and eqn.invars[0].aval.dtype.kind == "f":
        return np.true_divide
    if name == "round" and params["rounding_method"] == jax.lax.RoundingMethod.TO_NEAREST_EVEN:
        return np.rint
    if name == "bitcast_convert_type":
        return lambda x: np.asarray(x).view(params["new_dtype"])
    if name == "select_n":
        return lambda which, *cases: cases[int(which)]
    if name in _OPERATIONS:
        return _OPERATIONS[name]
    raise NotArithmetic
