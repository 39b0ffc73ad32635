"""Checks of arguments that the analyses share."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import PyTree

from .._validation import check_type
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid._arguments import check_field
from ..hybrid._arguments import start_of as _start_of


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
    """Initial state in float64 and mode, checked against the system."""
    y0, mode = _start_of(system, t0, y0, mode0, args)
    check_field(system, t0, y0, mode, args)
    return y0, mode
