"""Checks of arguments that the analyses share."""

from typing import Any

import numpy as np
from jaxtyping import PyTree

from .._validation import (
    as_float64,
    check_increasing,
    check_type,
    is_concrete,
    numbers,
    one_row,
    refusal,
)
from ..hybrid import AbstractHybridSystem, Integrator
from ..hybrid.arguments import a_time, check_field, the_system
from ..hybrid.arguments import start_of as _start_of


def times_of(name: str, t: Any) -> np.ndarray:
    """Output times as a vector that increases."""
    if not is_concrete(t):
        raise refusal(name, t, "known: it becomes a coordinate, so call this outside of jit and vmap")
    row = numbers(name, t, "a vector of real numbers")  # not a pytree of single numbers
    return np.asarray(check_increasing(name, one_row(name, as_float64(name, row), least=2)))


def an_integrator(integrator: Any) -> Integrator:
    """The integrator, the default one for `None`."""
    integrator = Integrator() if integrator is None else integrator
    return check_type("integrator", integrator, Integrator, "an Integrator or None")


def start_of(
    system: AbstractHybridSystem, t0: Any, y0: PyTree, mode0: Any, args: PyTree
) -> tuple[PyTree, Any]:
    """Initial state in float64 and mode, checked against the system, which is checked first."""
    the_system(system)
    t0 = a_time("t0", t0)
    y0, mode = _start_of(system, t0, y0, mode0, args)
    check_field(system, t0, y0, mode, args)
    return y0, mode
