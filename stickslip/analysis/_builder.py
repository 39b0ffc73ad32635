"""Builders of the system of each point of a grid, and the labels of such a diagram."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from .._validation import check_callable, check_type, is_concrete, refusal
from ..hybrid import AbstractHybridSystem
from ..sweep import Variable
from .observable import check_parameter, with_parameters

Build = Callable[[dict[str, Any]], AbstractHybridSystem]


def builder_of(system: Any, coords: Mapping[str, Any]) -> Build:
    """Function of a point: the system with its parameters replaced, or what the given function makes.

    The function is called here once, with the first point, so that what it cannot take is reported now.
    """
    allowed = "an AbstractHybridSystem or a function (**point) of one"
    if isinstance(system, AbstractHybridSystem):
        for key in coords:
            check_parameter(system, key)
        return lambda point: with_parameters(system, point)
    make: Callable[..., Any] = system
    if not callable(make):
        raise refusal("system", system, allowed, TypeError)
    call = f"system({', '.join(f'{key}=...' for key in coords)}), or an AbstractHybridSystem"
    check_callable("system", system, call, **coords)
    first = make(**{key: float(values[0]) for key, values in coords.items()})
    check_type("system(**point)", first, AbstractHybridSystem, "an AbstractHybridSystem")
    return lambda point: make(**point)


def check_labels(labels: Mapping[str, Any], known: Collection[str]) -> None:
    """Raise for labels that the diagram lacks."""
    for key, label in labels.items():
        if key not in known:
            raise refusal(f"variables[{key!r}]", label, f"a label of one of {', '.join(known)}")


def labelled_parameters(
    system: Any, coords: Mapping[str, Any], labels: Mapping[str, Any]
) -> dict[str, Variable]:
    """Labels of the grid: those given, else the units that the system states of its parameters.

    A function may make anything of a point. Where its systems have a parameter of the same name with
    the value of the point, at both ends of the grid, that is the one which is meant.
    """
    made = []
    if not isinstance(system, AbstractHybridSystem):
        points = [{key: float(values[end]) for key, values in coords.items()} for end in (0, -1)]
        made = [(system(**point), point) for point in points]
    found = {}
    for key in coords:
        given, unit = labels.get(key), None
        if isinstance(system, AbstractHybridSystem):
            unit = _unit_of(system, key)
        elif all(_holds(one, key, point[key]) for one, point in made):
            unit = _unit_of(made[0][0], key)
        if given is not None or unit is not None:
            given = Variable() if given is None else given
            found[key] = Variable(given.dims, given.units or unit, given.long_name, given.attrs)
    return found


def _holder(system: Any, key: str) -> tuple[Any, str]:
    """The part of a system that has a parameter, and the name that it has there."""
    *parts, name = key.split("__")
    for part in parts:
        system = getattr(system, part, None)
    return system, name


def _unit_of(system: Any, key: str) -> str | None:
    holder, name = _holder(system, key)
    return getattr(holder, "parameter_units", {}).get(name)


def _holds(system: Any, key: str, value: float) -> bool:
    """Whether a parameter is one number, this one."""
    found: Any = getattr(*_holder(system, key), None)
    return is_concrete(found) and np.shape(found) == () and bool(found == value)
