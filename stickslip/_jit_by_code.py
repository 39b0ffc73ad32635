"""`equinox.filter_jit` whose programs are kept by the code of their arguments too."""

import dataclasses
import functools
import types
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
from equinox.internal import nondifferentiable

from ._blas import one_thread
from ._code import code_and_traced
from ._types import Given
from ._validation import check_type, is_concrete
from .progress import begin_first_call, end_first_call, is_showing, ready

_CLOSED_OVER = (
    "stickslip: a function or a class closes over a number that is differentiated. There are no "
    "derivatives by it: make it a field of the system, or of an `equinox.Module` in place of the "
    "function, or hand it on in `args`."
)


def jit_by_code(function: Given[Callable]) -> Callable:
    """`equinox.filter_jit` whose programs are those of the code that its arguments have now.

    A class or a function among the arguments, or within them, may read globals and call helper
    functions. Where one of these was edited since, as in the cell of a notebook, `function` is traced
    again.

    **Errors** `TypeError` unless `function` is a function.
    """
    check_type("function", function, types.FunctionType, "a function")
    return compiled_by_code(function)


def compiled_by_code(
    function: Callable, options_of: Callable[[list], dict[str, Any] | None] = lambda operands: None
) -> Callable:
    """The same with options of the compiler, as `jax.jit` takes them, by the arrays of a call."""

    def of_code(static: tuple, operands: list) -> tuple[list, _Constants]:
        begin_first_call()  # this is called where the program is made, and never again
        _, form, others, _ = static
        args, named = jax.tree.unflatten(form, _all_leaves(operands, others))
        found, constants = _arrays_and_rest(function(*args, **named))
        return found, _Constants(constants)

    of_code.__name__ = of_code.__qualname__ = function.__name__

    def again(key: tuple, args: tuple, named: dict[str, Any]) -> Any:
        return function(*args, **named)

    @functools.cache
    def programs(**options: Any) -> tuple[Callable, Callable]:
        given: Any = {"compiler_options": options or None}
        return jax.jit(of_code, static_argnums=0, **given), eqx.filter_jit(again, **given)

    @functools.wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        operands, (form, others) = _arrays_and_rest((args, named))
        code, traced = code_and_traced(args, named)
        if traced:
            # A program has no derivatives by them: they would be zero, in silence.
            nondifferentiable(traced, msg=_CLOSED_OVER)
        inside = is_showing()
        program, worded = programs(**(options_of(operands) or {}))
        try:
            # `equinox.filter_jit` does the same in six times the time, a fifth of a millisecond.
            with one_thread:
                found, constants = program((code, form, others, told_apart(others)), operands)
                if found and isinstance(found[0], jax.Array) and is_concrete(found[0]):
                    found[0].block_until_ready()
        except (jax.errors.JaxRuntimeError, ValueError) as error:
            if "EquinoxRuntimeError" not in str(error):
                raise
            # An error of `equinox.error_if`, which Equinox words with the place where it was raised.
            return worded((code, told_apart(others)), args, named)
        finally:
            if not inside:
                end_first_call()
        if inside and is_concrete(found[:1]):
            ready()
        form, others = constants.value
        return jax.tree.unflatten(form, _all_leaves(found, others))

    return call


@jax.tree_util.register_static
@dataclasses.dataclass(frozen=True)
class _Constants:
    """What of a result is no array: it is part of the program."""

    value: tuple[Any, tuple]


_OPERAND = object()  # in the place of an array


def told_apart(constants: tuple) -> tuple:
    """What tells constants from those that Python takes for equal: 1, 1.0 and True; 0.0 and -0.0."""
    return tuple((type(x), x.hex() if type(x) is float else None) for x in constants)


def _arrays_and_rest(tree: Any) -> tuple[list, tuple[Any, tuple]]:
    """Arrays of a pytree; its form and everything else in it."""
    leaves, form = jax.tree.flatten(tree)
    arrays, others = [], []
    for leaf in leaves:
        if eqx.is_array(leaf):
            arrays.append(leaf)
            leaf = _OPERAND
        others.append(leaf)
    return arrays, (form, tuple(others))


def _all_leaves(arrays: list, others: tuple) -> list:
    given = iter(arrays)
    return [next(given) if other is _OPERAND else other for other in others]
