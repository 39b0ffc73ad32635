"""Checks of what the functions of the machine are given; values that are traced pass unread."""

from typing import Any

import numpy as np

from stickslip import Integrator
from stickslip.checks import (
    REAL,
    as_parameter,
    check_between,
    check_finite,
    check_type,
    is_concrete,
    numbers,
    one_number,
    one_row,
    refusal,
)

from ._errata import Errata
from ._parameters import CoreXYParameters


def the_machine(p: Any, name: str = "p") -> CoreXYParameters:
    """Parameters of the machine."""
    return check_type(name, p, CoreXYParameters, "CoreXYParameters")


def the_errata(errata: Any) -> Errata:
    """The errata that are corrected, none for `None`."""
    return Errata() if errata is None else check_type("errata", errata, Errata, "an Errata or None")


def the_integrator(integrator: Any) -> Integrator | None:
    """An integrator, or `None` for the default one."""
    return check_type("integrator", integrator, Integrator | None, "an Integrator or None")


def finite(**values: Any) -> list[Any]:
    """Arguments that are finite real numbers or arrays of them; lists become arrays."""
    return [_array(check_finite(name, value)) for name, value in values.items()]


def _array(value: Any) -> Any:
    return as_parameter(value) if isinstance(value, list | tuple) else value


def named(name: str, value: Any, kind: type) -> Any:
    """A named tuple of the machine whose numbers are finite."""
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    check_type(name, value, kind, f"{article} {kind.__name__}")
    for field, item in zip(kind._fields, value, strict=True):
        if hasattr(item, "_fields"):
            named(f"{name}.{field}", item, type(item))
        elif isinstance(item, list | tuple):
            raise refusal(f"{name}.{field}", item, "a number or an array", TypeError)
        else:
            check_finite(f"{name}.{field}", item)
    return value


def pair(name: str, value: Any, *, scalar: bool = False) -> tuple[Any, Any]:
    """A number, or where a `scalar` is not asked for an array, for each of the two motors."""
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise refusal(name, value, "a pair of numbers, one for each motor", TypeError)
    for i, item in enumerate(value if scalar else ()):
        one_number(f"{name}[{i}]", item)
    one, two = (_array(check_finite(f"{name}[{i}]", item)) for i, item in enumerate(value))
    return one, two


def unit_row(name: str, value: Any) -> Any:
    """A direction in the plane, a row `(x, y)` of any length but 0, as one of the length 1."""
    one_row(name, value)
    if np.shape(value) != (2,) or (is_concrete(value) and not np.any(np.asarray(value))):
        raise refusal(name, value, "a row (x, y), not 0")
    row = np.asarray(value, np.float64) if is_concrete(value) else as_parameter(value)
    row = row / abs(row).max()
    return row / (row[0] ** 2 + row[1] ** 2) ** 0.5


def dmn_number(name: str, value: Any) -> Any:
    """Number of a dynamic model, 1 to 4, or an array of them."""
    if is_concrete(value) and numbers(name, value, REAL).dtype.kind not in "iu":
        raise refusal(name, value, "an integer from 1 to 4 or an array of them", TypeError)
    check_between(name, value, 1, 4)
    return np.asarray(value) if isinstance(value, list | tuple) else value
