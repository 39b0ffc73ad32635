"""Values and rates of every event function: the guards of the system, then the sections."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from ._section import Section
from ._system import AbstractHybridSystem, guard_directions, guard_scales

# A guard counts as violated below this fraction of its scale: rounding of the state, not motion.
SLACK = 1e-12
FAR = 1e30  # value of an event function that cannot fire


class Values(NamedTuple):
    """Scaled values and rates of all event functions, guards first; rates are None where unknown."""

    value: tuple
    rate: tuple


class EventFunctions(eqx.Module):
    """All event functions of a run; knows which are guards and which rates are exact."""

    num_guards: int = eqx.field(static=True)
    directions: tuple = eqx.field(static=True)
    scales: tuple
    sections: tuple[Section, ...] = eqx.field(static=True)
    exact_rate: tuple = eqx.field(static=True)

    @property
    def count(self) -> int:
        return len(self.directions)

    def acts(self, index: int) -> bool:
        """Whether a crossing ends the step: guards and terminal sections, not recorded sections."""
        return index < self.num_guards or self.sections[index - self.num_guards].terminal

    def evaluate(self, system: AbstractHybridSystem, t, y, dy, mode, args) -> Values:
        """All values at `(t, y)` and their rates of change along the motion."""
        one, zero_slope = jnp.ones_like(t), jax.tree.map(jnp.zeros_like, dy)

        def guards(t, y):
            return tuple(system.guards(t, y, mode, args))

        values, rates = (), ()
        if self.num_guards:
            values, rates = jax.jvp(guards, (t, y), (one, dy))
        for section, exact in zip(self.sections, self.exact_rate[self.num_guards :], strict=True):

            def value(t, y, dy, section=section):
                return section.function(t, y, dy, mode, args)

            if exact:
                v, r = jax.jvp(value, (t, y, dy), (one, dy, zero_slope))
            else:
                v, r = value(t, y, dy), None
            values, rates = (*values, v), (*rates, r)
        return Values(tuple(map(_scaled, values, self.scales)), tuple(map(_scaled, rates, self.scales)))

    def sign(self, index: int, start: Any) -> Any:
        """Factor that makes a crossing of function `index` a fall, given its value at the start."""
        direction = self.directions[index]
        if direction == "falling":
            return 1.0
        if direction == "rising":
            return -1.0
        return jnp.sign(start)


def _scaled(value: Any, scale: Any) -> Any:
    if value is None or (isinstance(scale, float) and scale == 1.0):
        return value
    return value / scale


def _frozen(scale: Any) -> Any:
    return float(scale) if isinstance(scale, int | float) else jax.lax.stop_gradient(scale)


def event_functions(
    system: AbstractHybridSystem, sections: tuple[Section, ...], t, y, dy, mode, args
) -> EventFunctions:
    """Event functions of `system` and `sections`; checks the guards' number and shapes.

    Raises `ValueError` where the system returns another number of guards than it names, or one that
    is not a scalar.
    """
    names = system.guard_names

    def check(function: Callable, label: str, *operands) -> Any:
        out = eqx.filter_eval_shape(function, *operands)
        shapes = [getattr(leaf, "shape", ()) for leaf in jax.tree.leaves(out)]
        if any(shape != () for shape in shapes):
            raise ValueError(f"{label} has shape {shapes}; allowed: scalars, shape ()")
        return out

    values = check(lambda t, y: tuple(system.guards(t, y, mode, args)), "guards(t, y, ...)", t, y)
    if len(values) != len(names):
        raise ValueError(
            f"guards(t, y, ...) returned {len(values)} values; allowed: {len(names)}, one for each "
            f"of guard_names={names}"
        )
    for given, label in (
        (guard_directions(system), "directions"),
        (guard_scales(system), "scales"),
    ):
        if len(given) != len(names):
            raise ValueError(f"guard_{label}={given} must have {len(names)} entries, one per guard")
    for section in sections:
        check(lambda t, y, dy, s=section: s.function(t, y, dy, mode, args), section.name, t, y, dy)
    exact = tuple(not s.uses_slope(t, y, dy, mode, args) for s in sections)
    return EventFunctions(
        num_guards=len(names),
        directions=guard_directions(system) + tuple(s.direction for s in sections),
        scales=tuple(map(_frozen, guard_scales(system))) + (1.0,) * len(sections),
        sections=sections,
        exact_rate=(True,) * len(names) + exact,
    )
