"""Checks of arguments, one way for all: which argument, its value, and what is allowed.

Every check returns its value unchanged, so it can stand where the value is used, and raises
`ValueError` (`TypeError` for a value of the wrong kind) in one form of words, the argument first:

>>> check_positive("mass", 2.0)
2.0
>>> check_positive("mass", [1.0, -2.0])
Traceback (most recent call last):
    ...
ValueError: mass[1] = -2.0: it must be finite and positive.

A check that has no function here raises what `refusal` makes, in the same words:

>>> raise refusal("n", 7, "an even number")
Traceback (most recent call last):
    ...
ValueError: n = 7: it must be an even number.

Numbers are Python numbers, NumPy or JAX arrays, or lists of them; every element is checked. True and
False are not numbers, nor is anything NumPy could only guess at: texts, masked arrays, tables.
Values known only at run time (tracers under `jit`, `vmap`, `grad`) pass unread: a constructor runs
at trace time, where they have no number yet. `as_parameter` then makes the float64 array that a
module stores.
"""

import contextlib
import inspect
import math
import operator
import re
import reprlib
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ._one_function import first_alike

T = TypeVar("T")
MOST = int(np.iinfo(np.int32).max)  # what an index of an array can count
MOST_NUMBERED = 2**62  # places or modes that one integer of 64 bits tells apart, and can add
REAL = "a real number or an array of real numbers"
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
_SHORT.maxlevel = 3


def shown_value(value: Any) -> str:
    """`value` as messages show it: short, on one line, whatever its own `repr` does."""
    if isinstance(value, eqx.Module):
        return type(value).__name__
    if isinstance(value, np.ndarray | jax.Array) and value.ndim == 0 and is_concrete(value):
        with contextlib.suppress(Exception):  # keys of random numbers have no item
            value = value.item()
    try:
        # Of a number that is not known yet its type: "float64[]" for "JitTracer(float64[])".
        return re.sub(r"\w*Tracer\((\w+\[[\d,]*\])\)", r"\1", " ".join(_SHORT.repr(value).split()))
    except Exception:  # e.g. an integer of too many digits
        return f"<{type(value).__name__}>"


class DeclarationError(ValueError):
    """A system declares what cannot be; found while tracing, and no fault of the state it was given."""


def refusal(
    name: str, value: Any, allowed: str, kind: type[Exception] = ValueError, *, but: str = ""
) -> Exception:
    """The error to raise for a wrong argument: `<name> = <value>: it must be <allowed>.`

    **Arguments:**

    - `name`: the argument as the caller wrote it; first word of the message.
    - `allowed`: what is allowed, in the words that complete "it must be".
    - `kind`: `ValueError`, or `TypeError` for a value of the wrong kind, whatever its number.
    - `but`: what about the value is wrong, where it does not show it, such as its shape.
    """
    return kind(f"{name} = {shown_value(value)}{but and ', '}{but}: it must be {allowed}.")


def shape_refusal(name: str, value: Any, allowed: str) -> Exception:
    """The refusal of an array for its shape."""
    return refusal(name, value, allowed, but=f"of shape {np.shape(value)}")


def is_concrete(value: Any) -> bool:
    """Whether all array leaves of `value` hold numbers that can be read now."""
    try:
        return not any(isinstance(a, Tracer) for a in jax.tree.leaves(value))
    except (ValueError, TypeError):
        return True  # no pytree; the check that follows says so


def leaves_of(name: str, tree: Any) -> list[tuple[str, Any]]:
    """Leaves of a pytree with their paths as a caller writes them, `y0.x` or `inputs['a'][0]`."""
    try:
        found = jax.tree_util.tree_leaves_with_path(tree)
    except (ValueError, TypeError):
        allowed = "a pytree, its dictionaries with keys that can be sorted"
        raise refusal(name, tree, allowed, TypeError) from None
    return [(name + jax.tree_util.keystr(path), leaf) for path, leaf in found]


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray | jax.Array) and not isinstance(value, np.ma.MaskedArray)


def _could_be_numbers(value: Any) -> bool:
    """Whether `value` is a number, an array, or a list of them; `numpy.asarray` takes far more."""
    if isinstance(value, list | tuple):
        return all(_could_be_numbers(item) for item in value)
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    return number or _is_array(value)


def numbers(name: str, value: Any, allowed: str = REAL) -> np.ndarray:
    """The NumPy array of real numbers that a concrete `value` is; `TypeError` if it is not one."""
    if isinstance(value, int) and abs(value) >= 2**63:
        raise refusal(name, value, "a float where an integer of 64 bits does not hold it")
    try:
        if _could_be_numbers(value):
            array = np.asarray(value)
            if array.dtype.kind in "iuf" or jnp.issubdtype(array.dtype, jnp.floating):
                return array
    except (TypeError, ValueError, OverflowError):
        pass
    raise refusal(name, value, allowed, TypeError)


def check_that(
    name: str, value: T, holds: Callable[[np.ndarray], np.ndarray | bool], allowed: str
) -> T:
    """Raise unless `holds(value)` is true in every element of `value`, and there is an element.

    **Arguments:**

    - `name`: the argument as the caller wrote it; first word of the message.
    - `value`: number or array; tracers pass unread.
    - `holds`: elementwise condition on the NumPy array of the value.
    - `allowed`: what is allowed, in the words that complete "it must be".
    """
    if not is_concrete(value):
        return value
    array = numbers(name, value)
    if array.size == 0:
        raise shape_refusal(name, value, f"{allowed}, with at least one element")
    good = np.broadcast_to(holds(array), array.shape)
    if not good.all():
        raise _element(name, array, good, allowed)
    return value


def _element(name: str, array: np.ndarray, good: np.ndarray, allowed: str) -> Exception:
    """The refusal of the first element that is not good."""
    where = tuple(int(i) for i in np.argwhere(~good)[0])
    element = f"{name}[{', '.join(map(str, where))}]" if where else name
    return refusal(element, array[where].item(), allowed)


def check_finite(name: str, value: T) -> T:
    """Neither infinite nor NaN."""
    return check_that(name, value, np.isfinite, "finite")


def check_positive(name: str, value: T) -> T:
    """Finite and greater than zero."""
    return check_that(name, value, lambda x: np.isfinite(x) & (x > 0), "finite and positive")


def check_nonnegative(name: str, value: T) -> T:
    """Finite and not less than zero."""
    return check_that(name, value, lambda x: np.isfinite(x) & (x >= 0), "finite and not negative")


def check_between(name: str, value: T, low: float | int, high: float | int) -> T:
    """In the closed interval from `low` to `high`; an infinite bound is not a bound."""
    return check_that(
        name, value, lambda x: (x >= low) & (x <= high), f"between {low} and {high} inclusive"
    )


def check_at_least(name: str, value: T, bound_name: str, bound: Any) -> T:
    """Not less than another argument, as in `check_at_least("t1", t1, "t0", t0)`."""
    if not (is_concrete(value) and is_concrete(bound)):
        return value
    array, limit = numbers(name, value), numbers(bound_name, bound)
    if not array.shape and not limit.shape and array >= limit:
        return value
    check_broadcast(name, value, bound_name, bound)
    array, limit = np.broadcast_arrays(array, limit)
    good = np.asarray(array >= limit)
    if not good.all():
        where = tuple(int(i) for i in np.argwhere(~good)[0])
        raise _element(name, array, good, f"at least {bound_name} = {limit[where].item()}")
    return value


def check_above(name: str, value: T, bound_name: str, bound: Any) -> T:
    """Greater than another argument, in every element."""
    check_at_least(name, value, bound_name, bound)
    if is_concrete(value) and is_concrete(bound) and np.any(np.asarray(value) == np.asarray(bound)):
        raise refusal(name, value, f"above {bound_name} = {shown_value(bound)}")
    return value


def check_broadcast(name: str, value: T, other_name: str, other: Any) -> T:
    """Of a shape that broadcasts with that of another argument."""
    try:
        shape: Any = value
        np.broadcast_shapes(np.shape(shape), np.shape(other))
    except ValueError:
        allowed = f"of a shape that broadcasts with {np.shape(other)}, that of {other_name}"
        raise shape_refusal(name, value, allowed) from None
    return value


KINDS: dict[str, Callable] = {
    "any": lambda name, value: check_that(name, value, lambda x: ~np.isnan(x), "a number"),
    "finite": check_finite,
    "positive": check_positive,
    "not negative": check_nonnegative,
}


def one_number(name: str, value: Any, kind: str = "finite") -> Any:
    """A single finite, positive or not negative number, traced or not."""
    KINDS[kind](name, value)
    if np.shape(value) != ():
        raise shape_refusal(name, value, "one number")
    return value


def check_known(name: str, value: T) -> T:
    """What holds numbers that can be read now, none of them traced."""
    if not is_concrete(value):
        raise refusal(name, value, "known: call this outside of jit and vmap", TypeError)
    return value


def one_concrete(name: str, value: Any, kind: str = "finite") -> Any:
    """One number that is known now, not traced."""
    return one_number(name, check_known(name, value), kind)


def one_static(name: str, value: Any, kind: str = "finite") -> Any:
    """A number of Python, part of the program: never traced, no array."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise refusal(name, value, "a number of Python", TypeError)
    return KINDS[kind](name, value)


def one_row(name: str, value: Any, kind: str = "finite", least: int = 1) -> Any:
    """A vector of such numbers, at least so many; traced or not."""
    KINDS[kind](name, value)
    shape = np.shape(value)
    if len(shape) != 1 or shape[0] < least:
        raise shape_refusal(name, value, f"one row of at least {least}")
    return value


def check_increasing(name: str, value: T, *, equal: bool = False) -> T:
    """A row, checked before, each number of which is above the one before it, or `equal` to it."""
    if is_concrete(value):
        array = np.asarray(value)
        steps = np.diff(array)
        falls = np.flatnonzero(steps < 0 if equal else steps <= 0)
        if falls.size:
            at = int(falls[0]) + 1
            place, rule = ("at or above", "not decrease") if equal else ("above", "increase")
            allowed = f"{place} the one before it, {array[at - 1].item()}: they must {rule}"
            raise refusal(f"{name}[{at}]", array[at].item(), allowed)
    return value


def check_in(name: str, value: T, allowed: Collection[T]) -> T:
    """One of `allowed`: for words and other discrete choices, which are never traced."""
    # An array has no single answer to whether it is in a collection.
    if not any(isinstance(value, type(choice)) and value == choice for choice in allowed):
        raise refusal(name, value, f"one of {', '.join(repr(choice) for choice in allowed)}")
    return value


def check_type(name: str, value: T, expected: Any, allowed: str) -> T:
    """An instance of `expected`, a class or a union; `allowed` completes "it must be"."""
    if not isinstance(value, expected):
        raise refusal(name, value, allowed, TypeError)
    return value


def check_callable(name: str, value: T, call: str, *arguments: Any, **named: Any) -> T:
    """Something that can be called as `call` shows: with such `arguments`, by its signature.

    Of functions that are written alike it is always the first one: they have one program.
    """
    allowed = f"callable as {call}"
    if not callable(value):
        raise refusal(name, value, allowed, TypeError)
    if arguments or named:
        try:
            signature = inspect.signature(value)
        except (TypeError, ValueError):
            # Some built-in ones have no signature; of them, classes such as `dict` compute nothing.
            if isinstance(value, type):
                raise refusal(name, value, allowed, TypeError) from None
            return value
        try:
            signature.bind(*arguments, **named)
        except TypeError:
            raise refusal(name, value, allowed, TypeError) from None
    return first_alike(value)


def check_text(name: str, value: T, allowed: str = "a text") -> T:
    """A text that is not empty."""
    check_type(name, value, str, allowed)
    if not value:
        raise refusal(name, value, f"{allowed} that is not empty")
    return value


def check_flag(name: str, value: T) -> T:
    """True or False, not a number or an array that counts as one of them."""
    return check_type(name, value, bool, "True or False")


def check_count(name: str, value: T, low: int, high: int = MOST) -> T:
    """An integer from `low` to `high`; sizes of arrays, which are never traced."""
    allowed = f"an integer of at least {low}"
    if not isinstance(value, int) or isinstance(value, bool) or value < low:
        raise refusal(name, value, allowed)
    if value > high:
        raise refusal(name, value, f"at most {high}")
    return value


def whole_number(name: str, value: T, low: int, high: int) -> T:
    """An integer from `low` to `high` that may be traced, or a scalar array of one."""
    allowed = f"an integer from {low} to {high}"
    given: Any = value
    array = isinstance(value, np.ndarray | np.integer | jax.Array) and given.shape == ()
    whole = isinstance(value, int) and not isinstance(value, bool)
    if not (whole or (array and jnp.issubdtype(given.dtype, jnp.integer))):
        raise refusal(name, value, allowed, TypeError)
    if is_concrete(value) and not low <= operator.index(given) <= high:
        raise refusal(name, value, allowed)
    return value


def check_mapping(name: str, value: Any, allowed: str = "a mapping from names") -> dict[str, Any]:
    """A mapping from names, as a new dictionary; empty for `None`."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise refusal(name, value, allowed, TypeError)
    return dict(value)


def check_handed_on(name: str, tree: T) -> T:
    """A pytree of what JAX can trace, and of objects that can be hashed, which are constants of a
    program: what is handed unread to functions of the user."""
    for where, leaf in leaves_of(name, tree):
        array = isinstance(leaf, np.ndarray)
        good = not array or (leaf.dtype.kind in "biufc" and not isinstance(leaf, np.ma.MaskedArray))
        if not array and not isinstance(leaf, jax.Array):
            try:
                hash(leaf)
            except TypeError:
                good = False
        if not good:
            allowed = "an array of numbers or an object that can be hashed"
            raise refusal(where, leaf, allowed, TypeError)
    return tree


def as_float64(name: str, tree: Any) -> Any:
    """A pytree of finite real numbers with float64 arrays as leaves, for states and times.

    Single numbers become arrays of NumPy: to hand one to a device takes twenty microseconds.

    Raises `TypeError` for leaves that are not real numbers and `ValueError` for leaves that are
    float32 arrays, whose digits were lost before, or not finite.
    """
    if type(tree) is float and math.isfinite(tree):
        return np.asarray(tree)
    leaves = [_float64(where, leaf) for where, leaf in leaves_of(name, tree)]
    return jax.tree.unflatten(jax.tree.structure(tree), leaves)


def _float64(name: str, leaf: Any) -> Array | np.ndarray:
    if type(leaf) is float and math.isfinite(leaf):
        return np.asarray(leaf)
    array = check_float64(name, leaf)
    if isinstance(leaf, jax.Array) or array.shape:
        return as_parameter(leaf if isinstance(leaf, jax.Array) else array)
    return np.asarray(array, np.float64)


def check_float64(name: str, leaf: Any) -> Any:
    """One leaf of what `as_float64` takes: the traced array, or the array of NumPy that it is."""
    if isinstance(leaf, Tracer):
        array: Any = leaf
        real = jnp.issubdtype(array.dtype, jnp.floating) or jnp.issubdtype(array.dtype, jnp.integer)
        if not real:
            raise refusal(name, leaf, REAL, TypeError)
    else:
        array = numbers(name, leaf)
        good = np.asarray(np.isfinite(array))
        if not good.all():
            raise _element(name, array, good, "finite")
    if jnp.issubdtype(array.dtype, jnp.floating) and array.dtype.itemsize < 8:
        raise refusal(
            name, leaf, "of float64 (convert it with jnp.asarray(..., dtype=jnp.float64) if the lost "
            "digits do not matter)", but=f"of dtype {array.dtype}",
        )  # fmt: skip
    return array


def as_parameter(value: Any) -> Float[Array, "..."]:
    """The float64 array a module stores, so that every leaf can be traced and batched."""
    # A copy of what is one already costs as much as all its checks.
    kept = isinstance(value, jax.Array) and not isinstance(value, Tracer)
    if kept and value.dtype == jnp.float64 and not value.weak_type:
        return value
    return jnp.asarray(value, dtype=jnp.float64)
