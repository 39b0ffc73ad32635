"""Checks of what a run is given: times, initial state, mode, sections; before anything is compiled."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from .._validation import is_concrete
from ._section import Section
from ._system import AbstractHybridSystem, mode_index
from ._tree import as_float64


def a_time(name: str, value: Any) -> Array:
    """One finite real number as a float64 scalar."""
    if jax.tree.structure(value) != jax.tree.structure(0.0):
        raise TypeError(f"{name} = {value!r}: it must be a real number.")
    time = as_float64(name, value)
    if time.shape != ():
        raise ValueError(f"{name} has the shape {time.shape}; allowed: scalars (use jax.vmap)")
    return time


def times(name: str, ts: Any) -> Array:
    """A vector of finite real numbers in float64."""
    try:
        array = jnp.asarray(ts)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{name} = {ts!r}: it must be a vector of real numbers.") from None
    array = as_float64(name, array)
    if array.ndim != 1:
        raise ValueError(f"{name} has shape {array.shape}; allowed: one dimension (use jax.vmap)")
    return array


def output_times(ts: Any, t0: Any, t1: Any) -> Array | None:
    """`saveat.ts`, increasing and within `[t0, t1]`; None if there are none."""
    if ts is None:
        return None
    ts = times("saveat.ts", ts)
    if ts.size == 0:
        return None
    if is_concrete((ts, t0, t1)):
        values, low, high = np.asarray(ts), float(t0), float(t1)
        if np.any(np.diff(values) < 0):
            raise ValueError(
                f"saveat.ts must increase; it falls after ts={values[:-1][np.diff(values) < 0][0]}"
            )
        if values[0] < low or values[-1] > high:
            raise ValueError(
                f"saveat.ts spans [{values[0]}, {values[-1]}]; allowed: within [t0, t1]=[{low}, {high}]"
            )
    return ts


def sections_of(sections: Any) -> tuple[Section, ...]:
    """Sections as a tuple, of one or several."""
    if isinstance(sections, Section):
        return (sections,)
    if isinstance(sections, list | tuple) and all(isinstance(s, Section) for s in sections):
        return tuple(sections)
    raise TypeError(f"sections = {sections!r}: it must be a Section or a sequence of Sections.")


def start_of(
    system: AbstractHybridSystem, t0: Any, y0: PyTree, mode0: Any, args: PyTree
) -> tuple[PyTree, Array]:
    """Initial state in float64, and the mode: the one given, checked, or that of the state."""
    y0 = as_float64("y0", y0)
    if not jax.tree.leaves(y0):
        raise ValueError(f"y0 = {y0!r}: it must be a state with at least one component.")
    if mode0 is not None:
        return y0, mode_index(system, mode0)
    first = _of_state("initial_mode", system, y0, lambda: _first_mode(system, t0, y0, args))
    return y0, jnp.asarray(first, jnp.int32)


def _first_mode(system: AbstractHybridSystem, t0: Any, y0: PyTree, args: PyTree) -> Any:
    """The system's own initial mode. Loops and branches in it are compiled once for all calls."""
    if is_concrete((system, t0, y0, args)):
        try:
            return _compiled_first_mode(system, t0, y0, args)
        except jax.errors.ConcretizationTypeError:
            pass  # it asks in Python which number it has
    return system.initial_mode(t0, y0, args)


@eqx.filter_jit
def _compiled_first_mode(system, t0, y0, args):
    return jnp.asarray(system.initial_mode(t0, y0, args), jnp.int32)


def check_field(system: AbstractHybridSystem, t0: Any, y0: PyTree, mode: Any, args: PyTree) -> None:
    """Refuse a state whose time derivative the system cannot give, or gives in another form."""
    slope = _of_state(
        "vector_field", system, y0,
        lambda: eqx.filter_eval_shape(system.vector_field, t0, y0, mode, args),
    )  # fmt: skip
    if jax.tree.structure(y0) != jax.tree.structure(slope):
        raise ValueError(
            f"vector_field returned the structure {jax.tree.structure(slope)}; allowed: that of y0, "
            f"{jax.tree.structure(y0)}"
        )
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(y0), jax.tree.leaves(slope), strict=True
    ):
        if a.shape != b.shape or b.dtype != jnp.float64:
            raise ValueError(
                f"vector_field returned shape {b.shape}, dtype {b.dtype} for "
                f"y0{jax.tree_util.keystr(path)}; allowed: {a.shape}, float64"
            )


def _of_state(what: str, system: AbstractHybridSystem, y0: PyTree, call: Callable[[], Any]) -> Any:
    try:
        return call()
    except (jax.errors.JAXTypeError, jax.errors.JAXIndexError):
        raise  # of the function's own making, and explained by JAX
    except (AttributeError, TypeError, IndexError, ValueError) as error:
        raise ValueError(
            f"y0 has the structure {jax.tree.structure(y0)}: it must be a state that {what} of the "
            f"{type(system).__name__} can take ({type(error).__name__}: {error})."
        ) from error
