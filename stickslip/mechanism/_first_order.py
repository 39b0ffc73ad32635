"""States of first order beside coordinates and velocities: a current, a temperature, a filter."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from stickslip._validation import refusal

from ._abstract_declaration import AbstractDeclaration
from ._known import kept_trace

RATES = "rates(t, q, v, args)"


def rates_of(declaration: AbstractDeclaration, t: Any, q: Any, v: Any, args: Any) -> list[Any]:
    """Rates of the states of first order, in their order."""
    names = declaration.names.first_order
    if not names:
        return []
    given = declaration.rates(t, q, v, args)
    if not isinstance(given, Mapping):
        raise refusal(RATES, given, f"a mapping with a rate for each of {_list_of(names)}", TypeError)
    for name in names:
        if name not in given:
            raise refusal(RATES, sorted(given), f"a mapping with a rate for {name!r} too")
    for name in given:
        if name not in names:
            raise refusal(RATES, sorted(given), f"a mapping with keys out of {_list_of(names)}")
    found = []
    for name in names:
        rate, state = given[name], getattr(q, name)
        try:
            rate = jnp.asarray(rate, jnp.float64)
        except (TypeError, ValueError):
            raise refusal(f"rates(...)[{name!r}]", rate, "a rate [1/s of the state]") from None
        if jnp.shape(rate) not in ((), jnp.shape(state)):
            allowed = f"of the shape of the state, {jnp.shape(state)}"
            raise refusal(f"the shape of rates(...)[{name!r}]", jnp.shape(rate), allowed)
        found.append(jnp.broadcast_to(rate, jnp.shape(state)))
    return found


def check_rates(declaration: AbstractDeclaration, t: Any, y: Any, args: Any) -> None:
    """Raise for rates that are missing or of wrong shapes, by name, without compiling anything."""
    if declaration.first_order:
        kept_trace(rates_of, declaration, t, *declaration.to_coordinates(y), args)


def _list_of(names: tuple[str, ...]) -> str:
    return ", ".join(map(repr, names))
