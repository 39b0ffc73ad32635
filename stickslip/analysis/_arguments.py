"""Checks of arguments that the analyses share."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._validation import check_finite, check_nonnegative, check_positive, check_type
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid._system import mode_index
from ..hybrid._tree import as_float64


def one_number(name: str, value: Any, kind: str = "finite") -> Any:
    """A single finite, positive or not negative number, traced or not."""
    check = {"finite": check_finite, "positive": check_positive, "not negative": check_nonnegative}
    check[kind](name, value)
    if jnp.shape(value) != ():
        raise ValueError(f"{name} has the shape {jnp.shape(value)}: it must be one number.")
    return value


def a_count(name: str, value: Any, low: int) -> int:
    """An integer of at least `low`."""
    if not isinstance(value, int) or isinstance(value, bool) or value < low:
        raise ValueError(f"{name} = {value!r}: it must be an integer of at least {low}.")
    return value


def named_observables(observables: Any) -> dict[str, Any]:
    """Observables by name: of a name, a sequence of names, or a mapping."""
    if isinstance(observables, str):
        observables = (observables,)
    if isinstance(observables, Mapping):
        named = dict(observables)
    elif isinstance(observables, Sequence) and all(isinstance(o, str) for o in observables):
        named = {o.replace(" ", "_"): o for o in observables}
    else:
        raise TypeError(
            f"observables = {observables!r}: it must be a name, a sequence of names, or a mapping from "
            "names to names or functions."
        )
    if not named:
        raise ValueError(f"observables = {observables!r} is empty: it must name at least one.")
    return named


def times_of(t: Any) -> np.ndarray:
    """Output times as a vector that increases."""
    try:
        times = np.asarray(t, np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"t = {t!r}: it must be a vector of real numbers.") from None
    good = (
        times.ndim == 1 and times.size > 1 and np.isfinite(times).all() and np.all(np.diff(times) > 0)
    )
    if not good:
        raise ValueError(f"t has the shape {times.shape}: it must be a vector that increases.")
    return times


def an_integrator(integrator: Any) -> Integrator:
    """The integrator, the default one for `None`."""
    integrator = Integrator() if integrator is None else integrator
    return check_type("integrator", integrator, Integrator, "an Integrator")


def start_of(
    system: AbstractHybridSystem, t0: Any, y0: PyTree, mode0: Any, args: PyTree
) -> tuple[PyTree, Any]:
    """Initial state in float64, and the mode: the one given, checked, or that of the state."""
    try:
        y0 = as_float64("y0", y0)
    except (TypeError, ValueError, OverflowError) as error:
        # Some messages are those of the array library.
        text = str(error) if str(error).startswith("y0") else f"y0 = {y0!r}: it must be a state."
        kind = TypeError if isinstance(error, TypeError) else ValueError
        raise kind(text) from None
    if not jax.tree.leaves(y0):
        raise ValueError(f"y0 = {y0!r}: it must be a state with at least one component.")
    try:
        first = system.initial_mode(t0, y0, args)
        jax.eval_shape(lambda y: system.vector_field(t0, y, first, args), y0)
    except (AttributeError, TypeError, IndexError, ValueError) as error:
        raise ValueError(
            f"y0 = {y0!r}: it must be a state of the {type(system).__name__} ({error})."
        ) from error
    if mode0 is None:
        return y0, jnp.asarray(first, jnp.int32)
    number = isinstance(mode0, int | np.integer | jax.Array) and not isinstance(mode0, bool)
    if not isinstance(mode0, str) and (
        not number or jnp.shape(mode0) != () or jnp.result_type(mode0).kind not in "iu"
    ):
        raise ValueError(f"mode0 = {mode0!r}: it must be a mode's name or number.")
    if isinstance(mode0, int) and not 0 <= mode0 < len(system.mode_names):
        raise ValueError(f"mode0 = {mode0!r}: it must be from 0 to {len(system.mode_names) - 1}.")
    return y0, jnp.asarray(mode_index(system, mode0), jnp.int32)
