"""Builders of the system of each point of a grid, and the labels of such a diagram."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from .._validation import check_callable, check_type, refusal
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
    system: Any, coords: Collection[str], labels: Mapping[str, Any]
) -> dict[str, Variable]:
    """Labels of the grid: those given, else the units that the system states of its parameters.

    A function may make anything of a point, and its unit is not known here.
    """
    found = {}
    for key in coords:
        given, unit = labels.get(key), None
        if isinstance(system, AbstractHybridSystem):
            *parts, name = key.split("__")
            holder: Any = system
            for part in parts:
                holder = getattr(holder, part)
            unit = getattr(holder, "parameter_units", {}).get(name)
        if given is not None or unit is not None:
            given = Variable() if given is None else given
            found[key] = Variable(given.dims, given.units or unit, given.long_name, given.attrs)
    return found
