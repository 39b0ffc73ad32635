"""Checks of arguments: what is wrong, which value was given and what is allowed.

Every check returns its value unchanged, so it can stand where the value is used, and raises
`ValueError` (`TypeError` for what is no number) with the argument's name first:

>>> check_positive("mass", 2.0)
2.0
>>> check_positive("mass", [1.0, -2.0])
Traceback (most recent call last):
    ...
ValueError: mass[1] = -2.0: it must be finite and positive.

Values are Python numbers, NumPy or JAX arrays; every element is looked at. Values known only at run
time (tracers under `jit`, `vmap`, `grad`) pass unread: a constructor runs at trace time, where they
have no number yet. `as_parameter` then makes the float64 array that a module stores.
"""

import reprlib
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

T = TypeVar("T")
MOST = 2**31 - 1  # what an index of an array can count
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


def is_concrete(value: Any) -> bool:
    """Whether all array leaves of `value` hold numbers that can be read now."""
    return not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(value))


def _numbers(name: str, value: Any) -> np.ndarray:
    try:
        array = np.asarray(value)
        if array.dtype.kind in "biuf":
            return array
    except (TypeError, ValueError):
        pass
    raise TypeError(f"{name} = {value!r}: it must be a real number or an array of real numbers.")


def check_that(
    name: str, value: T, holds: Callable[[np.ndarray], np.ndarray | bool], allowed: str
) -> T:
    """Refuse `value` unless `holds(value)` is true in every element.

    **Arguments:**

    - `name`: the argument as the caller wrote it; first word of the message.
    - `value`: number or array; tracers pass unread.
    - `holds`: elementwise condition on the NumPy array of the value.
    - `allowed`: what is allowed, in the words that complete "it must be".
    """
    if not is_concrete(value):
        return value
    array = _numbers(name, value)
    good = np.broadcast_to(holds(array), array.shape)
    if not good.all():
        where = tuple(int(i) for i in np.argwhere(~good)[0])
        element = f"{name}[{', '.join(map(str, where))}]" if where else name
        raise ValueError(f"{element} = {array[where].item()}: it must be {allowed}.")
    return value


def check_finite(name: str, value: T) -> T:
    """Neither infinite nor NaN."""
    return check_that(name, value, np.isfinite, "finite")


def check_positive(name: str, value: T) -> T:
    """Finite and greater than zero."""
    return check_that(name, value, lambda x: np.isfinite(x) & (x > 0), "finite and positive")


def check_nonnegative(name: str, value: T) -> T:
    """Finite and not less than zero."""
    return check_that(name, value, lambda x: np.isfinite(x) & (x >= 0), "finite and not negative")


def check_between(name: str, value: T, low: float, high: float) -> T:
    """In the closed interval from `low` to `high`; an infinite bound is no bound."""
    return check_that(
        name, value, lambda x: (x >= low) & (x <= high), f"between {low} and {high} inclusive"
    )


def check_at_least(name: str, value: T, bound_name: str, bound: Any) -> T:
    """Not less than another argument, as in `check_at_least("t1", t1, "t0", t0)`."""
    if not (is_concrete(value) and is_concrete(bound)):
        return value
    array, limit = np.broadcast_arrays(_numbers(name, value), _numbers(bound_name, bound))
    good = array >= limit
    if not good.all():
        where = tuple(int(i) for i in np.argwhere(~good)[0])
        element = f"{name}[{', '.join(map(str, where))}]" if where else name
        raise ValueError(
            f"{element} = {array[where].item()}: it must be at least {bound_name} = "
            f"{limit[where].item()}."
        )
    return value


def one_number(name: str, value: Any, kind: str = "finite") -> Any:
    """A single finite, positive or not negative number, traced or not."""
    check = {"finite": check_finite, "positive": check_positive, "not negative": check_nonnegative}
    check[kind](name, value)
    if np.shape(value) != ():
        raise ValueError(f"{name} has the shape {np.shape(value)}: it must be one number.")
    return value


def check_in(name: str, value: T, allowed: Collection[T]) -> T:
    """One of `allowed`: for words and other discrete choices, which are never traced."""
    # An array has no single answer to whether it is in a collection.
    if not any(isinstance(value, type(choice)) and value == choice for choice in allowed):
        choices = ", ".join(repr(choice) for choice in allowed)
        raise ValueError(f"{name} = {value!r}: it must be one of {choices}.")
    return value


def check_type(name: str, value: T, expected: Any, allowed: str) -> T:
    """An instance of `expected`, a class or a union; `allowed` completes "it must be"."""
    if not isinstance(value, expected):
        raise TypeError(f"{name} = {_SHORT.repr(value)}: it must be {allowed}.")
    return value


def check_flag(name: str, value: T) -> T:
    """True or False, not a number or an array that counts as one of them."""
    return check_type(name, value, bool, "True or False")


def check_count(name: str, value: T, low: int) -> T:
    """An integer of at least `low`; sizes of arrays, which are never traced."""
    if not isinstance(value, int) or isinstance(value, bool) or value < low:
        raise ValueError(f"{name} = {value!r}: it must be an integer of at least {low}.")
    if value > MOST:
        raise ValueError(f"{name} = {value!r}: it must be at most {MOST}.")
    return value


def check_mapping(name: str, value: Any) -> dict[str, Any]:
    """A mapping from names, as a new dictionary; empty for `None`."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise TypeError(f"{name} = {value!r}: it must be a mapping from names.")
    return dict(value)


def as_parameter(value: Any) -> Float[Array, "..."]:
    """The float64 array a module stores, so that every leaf can be traced and batched."""
    return jnp.asarray(value, dtype=jnp.float64)
