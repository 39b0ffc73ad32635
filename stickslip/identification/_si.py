"""Numbers in the units of an instrument, in coherent SI units."""

import functools
from typing import Any

import numpy as np

from .._validation import check_type, refusal


def to_si(name: str, values: Any, unit: Any) -> tuple[np.ndarray, str]:
    """`values` in the coherent SI unit of what `unit` measures, and its text: `"mm/s"` gives m/s,
    `"deg"` rad, `"rpm"` rad/s, `"kN"` N.

    Units are read by Pint. **Raises** `ValueError` for one that it does not know, by the argument
    `name`; `TypeError` for anything but a text.
    """
    check_type(name, unit, str, "the text of a unit")
    import pint

    registry = _registry()
    try:
        given = registry.parse_units(unit)
        target = _without_prefixes(given)
        if registry.Quantity(1.0, target).to_base_units().magnitude != 1.0:
            target = registry.Quantity(1.0, given).to_base_units().units
        found = registry.Quantity(np.asarray(values, np.float64), given).to(target)
    except (pint.errors.PintError, AttributeError, TypeError, ValueError):
        raise refusal(name, unit, "a unit such as 'ms', 'mm/s', 'deg', 'rpm' or 'kN'") from None
    return np.asarray(found.magnitude), f"{target:~C}".replace("**", "^").replace("*", " ")


def is_unit(text: str) -> bool:
    """Whether a text is a unit that `to_si` knows."""
    try:
        to_si("unit", 1.0, text.strip())
    except ValueError:
        return False
    return True


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def _without_prefixes(given: Any) -> Any:
    """Millinewtons over metres become newtons over metres."""
    registry = _registry()
    parts = registry.Unit("")
    for name, power in given._units.items():
        parts = parts * registry.Unit(registry.parse_unit_name(name)[0][1]) ** power
    return parts
