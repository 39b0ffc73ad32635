"""Checks of what a run is given: times, initial state, mode, sections; before anything is compiled."""

import itertools
import weakref
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from .._jit_by_code import jit_by_code
from .._show import LISTED
from .._types import Given
from .._validation import (
    DeclarationError,
    as_float64,
    check_float64,
    check_handed_on,
    check_type,
    is_concrete,
    leaves_of,
    numbers,
    refusal,
    shape_refusal,
    whole_number,
)
from ._section import Section
from .system import AbstractHybridSystem, mode_type


def a_time(name: str, value: Any) -> Array | np.ndarray:
    """One finite real number as a float64 scalar."""
    if type(value) is not float and leaves_of(name, value) != [(name, value)]:
        raise refusal(name, value, "a real number", TypeError)
    time = as_float64(name, value)
    if time.shape != ():
        raise shape_refusal(name, value, "one number (use jax.vmap)")
    return time


def times(name: str, ts: Any) -> Array:
    """A vector of finite real numbers in float64; empty if there are none."""
    row = check_times(name, ts)
    return jnp.asarray(ts if isinstance(ts, jax.Array) else row, jnp.float64)


def check_times(name: str, ts: Any) -> Any:
    """The same as it is traced, or as an array of NumPy: that compiles nothing."""
    if is_concrete(ts):
        empty = isinstance(ts, list | tuple) and not ts
        array = np.zeros(0) if empty else numbers(name, ts, "a vector of real numbers")
    else:
        array = jnp.asarray(ts)
    if array.ndim != 1:
        raise shape_refusal(name, ts, "a vector (use jax.vmap)")
    return check_float64(name, array)


def output_times(ts: Any, t0: Any, t1: Any) -> Array | None:
    """`saveat.ts`, increasing and within `[t0, t1]`; None if there are none."""
    if ts is None:
        return None
    row = check_times("saveat.ts", ts)
    if row.size == 0:
        return None
    if is_concrete((row, t0, t1)):
        values, low, high = np.asarray(row), float(t0), float(t1)
        if np.any(np.diff(values) < 0):
            at = int(np.flatnonzero(np.diff(values) < 0)[0]) + 1
            allowed = f"at least the time before it, {values[at - 1]}: they must increase"
            raise refusal(f"saveat.ts[{at}]", float(values[at]), allowed)
        if values[0] < low or values[-1] > high:
            at = 0 if values[0] < low else values.size - 1
            allowed = f"within [t0, t1] = [{low}, {high}]"
            raise refusal(f"saveat.ts[{at}]", float(values[at]), allowed)
    return times("saveat.ts", ts)


def sections_of(sections: Given[Sequence[Section] | Section]) -> tuple[Section, ...]:
    """Sections as a tuple, of one or several."""
    if isinstance(sections, Section):
        return (sections,)
    if isinstance(sections, list | tuple) and all(isinstance(s, Section) for s in sections):
        return tuple(sections)
    raise refusal("sections", sections, "a Section or a sequence of Sections", TypeError)


def the_start(system: AbstractHybridSystem, y0: PyTree, mode0: Any, args: PyTree) -> tuple:
    """Initial state in float64, and the number of the mode; None where none is given."""
    y0 = as_float64("y0", y0)
    check_handed_on("args", args)
    if not jax.tree.leaves(y0):
        raise refusal("y0", y0, "a state with at least one component")
    return y0, None if mode0 is None else mode_index("mode0", system, mode0)


def start_of(
    system: AbstractHybridSystem, t0: Any, y0: PyTree, mode0: Any, args: PyTree
) -> tuple[PyTree, Array]:
    """Initial state in float64, and the mode: the one given, checked, or that of the state."""
    y0, mode = the_start(system, y0, mode0, args)
    if mode is not None:
        return y0, jnp.asarray(mode)
    if is_concrete((system, t0, y0, args)):
        try:
            return y0, _compiled_first_mode(system, t0, y0, args)
        except jax.errors.ConcretizationTypeError:
            pass  # it asks in Python which number it has
    return y0, first_mode(system, t0, y0, args)


def first_mode(system: AbstractHybridSystem, t0: Any, y0: PyTree, args: PyTree) -> Array:
    """The mode of the state, which the system says."""
    mode = _of_state("y0", "initial_mode", system, y0, lambda: system.initial_mode(t0, y0, args))
    return jnp.asarray(mode, mode_type(system))


# Loops and branches in it are compiled once for all calls.
_compiled_first_mode = jit_by_code(first_mode)


def check_field(
    system: AbstractHybridSystem, t0: Any, y0: PyTree, mode: Any, args: PyTree, name: str = "y0"
) -> None:
    """Raise for a state whose time derivative the system cannot give, or gives in another form."""
    if not jax.tree.leaves(y0):
        raise refusal(name, y0, "a state with at least one component")
    slope = _of_state(
        name, "vector_field", system, y0,
        lambda: eqx.filter_eval_shape(system.vector_field, t0, y0, mode, args),
    )  # fmt: skip
    form = jax.tree.structure(y0)
    if form != jax.tree.structure(slope):
        raise refusal(
            "vector_field(t, y, mode, args)",
            jax.tree.structure(slope),
            f"of the structure {form}, as {name} is",
        )
    for (where, a), b in zip(leaves_of(name, y0), jax.tree.leaves(slope), strict=True):
        shape, dtype = np.shape(b), jnp.result_type(b)  # of a number of Python, too
        if a.shape != shape or dtype != jnp.float64:
            raise ValueError(
                f"vector_field(t, y, mode, args) = an array of shape {shape}, dtype {dtype} for "
                f"{where}: it must be of shape {a.shape}, dtype float64."
            )


def check_sections(
    system: AbstractHybridSystem, sections: tuple[Section, ...], t0: Any, y0: PyTree, mode: Any,
    args: PyTree,
) -> None:  # fmt: skip
    """Raise for sections whose functions do not give one number."""
    for section in sections:
        found = eqx.filter_eval_shape(section.function, system, t0, y0, y0, mode, args)
        number = isinstance(found, int | float) and not isinstance(found, bool)
        array = isinstance(found, jax.ShapeDtypeStruct) and found.shape == ()
        if not (number or (array and jnp.issubdtype(getattr(found, "dtype", np.void), jnp.number))):
            what = f"sections: the function of {section.name!r} of (system, t, y, dy, mode, args)"
            raise refusal(what, found, "a real number")


_named: weakref.WeakSet[type] = weakref.WeakSet()  # classes whose systems name modes and guards


def the_system(system: Any) -> AbstractHybridSystem:
    """`system`, if it is one that names its modes and guards."""
    check_type("system", system, AbstractHybridSystem, "an AbstractHybridSystem")
    if type(system) in _named:
        return system
    for name in ("mode_names", "guard_names"):
        given = getattr(system, name)
        # A machine of many contacts makes the names of its modes as they are asked for.
        if not isinstance(given, Sequence) or isinstance(given, str):
            allowed = "a tuple of names (not a method; a property may compute it)"
            raise refusal(name, given, allowed, TypeError)
    _named.add(type(system))
    return system


def mode_index(name: str, system: AbstractHybridSystem, mode: Any) -> Array | np.ndarray:
    """Mode number from a name or a number.

    Raises `ValueError` where `mode` is a name the system does not have or a concrete number outside
    its range, or where it is neither.
    """
    names = system.mode_names
    if isinstance(mode, str) and mode in names:
        return np.asarray(names.index(mode), mode_type(system))
    try:
        number = whole_number(name, mode, 0, len(names) - 1)
        as_array = np.asarray if is_concrete(number) else jnp.asarray
        return as_array(number, mode_type(system))
    except (TypeError, ValueError):
        words = ", ".join(map(repr, itertools.islice(names, LISTED)))
        more = ", ..." if len(names) > LISTED else ""
        allowed = f"a mode of the system, an integer from 0 to {len(names) - 1} or one of {words}{more}"
        raise refusal(name, mode, allowed) from None


def _of_state(
    name: str, what: str, system: AbstractHybridSystem, y0: PyTree, call: Callable[[], Any]
) -> Any:
    try:
        return call()
    except (jax.errors.JAXTypeError, jax.errors.JAXIndexError, DeclarationError):
        raise  # of the function's own making, and explained by JAX
    except (AttributeError, TypeError, IndexError, ValueError) as error:
        allowed = (
            f"a state that {what} of the {type(system).__name__} can take "
            f"({type(error).__name__}: {error})"
        )
        raise refusal(name, y0, allowed) from error
