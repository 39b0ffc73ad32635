"""Arguments that the ways of following an orbit have in common."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import PyTree

from .._validation import (
    as_parameter,
    check_callable,
    check_handed_on,
    check_type,
    one_concrete,
    refusal,
)
from ..analysis.observable import check_parameter, with_parameters
from ..hybrid import AbstractHybridSystem, current_executor
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import start_of
from ..hybrid.tree import with_float_arrays
from ._along import Problem
from ._beginning import beside_breaks
from ._closing import check_autonomous
from ._guess import OrbitGuess, check_seen
from ._options import Follow, Shooting
from ._orbit import PeriodicOrbit


def follow_of(follow: Any, bounds: tuple[tuple[float, float], ...]) -> Follow:
    """The settings of a branch within bounds, with the values asked for as rows of numbers."""
    check_type("follow", follow, Follow, "a Follow")
    rows = follow.values_by_parameter(len(bounds))
    if len(rows) != len(bounds):
        allowed = f"{len(bounds)} tuples of numbers, one for each parameter"
        raise refusal("follow.values", follow.values, allowed, TypeError)
    names = ["follow.values"] if len(bounds) == 1 else [f"follow.values[{i}]" for i in range(len(rows))]
    found = tuple(levels_of(*both) for both in zip(names, rows, bounds, strict=True))
    values = found[0] if len(bounds) == 1 else found
    return dataclasses.replace(follow, values=values, step=float(follow.step))


def shooting_of(shooting: Any) -> Shooting:
    return check_type("shooting", shooting, Shooting, "a Shooting")


def bounds_of(argument: str, bounds: Any) -> tuple[float, float]:
    """Least and greatest value."""
    allowed = "two numbers, the lower one first"
    if not isinstance(bounds, tuple | list) or len(bounds) != 2:
        raise refusal(argument, bounds, allowed, TypeError)
    low, high = (float(one_concrete(f"{argument}[{i}]", b)) for i, b in enumerate(bounds))
    if not low < high:
        raise refusal(argument, bounds, allowed)
    return low, high


def levels_of(argument: str, values: Any, bounds: tuple[float, float]) -> tuple[float, ...]:
    """Values of a parameter that are asked for, each once."""
    if not isinstance(values, tuple | list):
        raise refusal(argument, values, "a tuple of numbers", TypeError)
    found = [float(one_concrete(f"{argument}[{i}]", value)) for i, value in enumerate(values)]
    for i, value in enumerate(found):
        if not bounds[0] <= value <= bounds[1]:
            raise refusal(f"{argument}[{i}]", value, f"within the bounds, {bounds[0]} and {bounds[1]}")
    return tuple(dict.fromkeys(found))


def value_of(system: AbstractHybridSystem, name: Any, argument: str = "parameter") -> float:
    """Value that a parameter of the system has."""
    if not isinstance(name, str):
        raise refusal(argument, name, "a name of a parameter", TypeError)
    check_parameter(system, name, argument)
    value: Any = system
    for part in name.split("__"):
        value = getattr(value, part)
    return float(one_concrete(name, value))


def concrete_guess(system: AbstractHybridSystem, guess: OrbitGuess, args: PyTree) -> OrbitGuess:
    """One guess of numbers that are known, with its mode as a number."""
    check_seen("orbit", guess)
    period = float(one_concrete("orbit.period", guess.period, "positive"))
    t0 = float(one_concrete("orbit.t0", guess.t0))
    y0, mode0 = start_of(system, t0, guess.y0, guess.mode0, args)
    t0, y0, mode0 = beside_breaks(system, args, Shooting().integrator_or(), t0, y0, mode0)
    return OrbitGuess(y0, period, mode0, t0, guess.turns)


def problem_of(
    system: AbstractHybridSystem,
    values: Mapping[str, float],
    spans: Any,
    orbit: PeriodicOrbit | OrbitGuess,
    forcing_period: Any,
    *,
    args: PyTree,
    shooting: Any,
) -> Problem:
    """The problem of a branch from an orbit over parameters that have these values there."""
    check_handed_on("args", args)
    shooting = shooting_of(shooting)
    there, multiple = with_parameters(system, dict(values)), 1
    if forcing_period is None:
        state = orbit.t0, orbit.y0, orbit.mode0
        check_autonomous("forcing_period", there, *state, args, "the period of the forcing")
    else:
        check_callable("forcing_period", forcing_period, "forcing_period(system)", system)
        forcing = one_concrete("forcing_period(system)", forcing_period(there), "positive")
        # A period that was simulated is known to some digits; a number of periods is a whole one.
        ratio = float(orbit.period) / float(forcing)
        multiple = round(ratio)
        if multiple < 1 or abs(ratio - multiple) > ENGINE.same:
            allowed = f"of which the orbit's period, {float(orbit.period)} s, is a multiple"
            raise refusal("forcing_period(system)", float(forcing), allowed)
    system, args = with_float_arrays((system, args))
    return Problem(
        system, args, shooting.integrator_or(), as_parameter(np.asarray(spans, float)), tuple(values),
        forcing_period, multiple, shooting.segments, shooting.max_events, current_executor(),
    )  # fmt: skip
