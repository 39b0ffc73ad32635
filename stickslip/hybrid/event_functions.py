"""Values and rates of every event function: the guards of the system, then the sections."""

import functools
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.interpreters.partial_eval import dce_jaxpr
from jaxtyping import PyTree

from .._validation import check_in, one_number
from ._section import Section
from ._tolerance import generic, sizes
from .accuracy import ACCURACY
from .dependence import AFFINE, NONE, OTHER, degrees
from .system import DIRECTIONS, AbstractHybridSystem, guard_directions, guard_scales

# Value of a bend that lies beyond zero by so little that any other is located before it.
STALE = -10.0 * ACCURACY.slack


class Values(NamedTuple):
    """Scaled values and rates of all event functions, guards first."""

    value: tuple
    rate: tuple
    scale: tuple = ()  # what the guards' terms amount to here, where the system states no magnitudes


class EventFunctions(eqx.Module):
    """All event functions of a run; knows which are guards."""

    num_guards: int = eqx.field(static=True)
    directions: tuple = eqx.field(static=True)
    factors: tuple  # one over the stated magnitude of each
    sections: tuple[Section, ...] = eqx.field(static=True)
    of_slope: tuple = eqx.field(static=True)  # of each section, whether it depends on the slope
    # Those that do not, by what they are of time and state: not affine, or affine.
    bent: tuple = eqx.field(static=True)
    straight: tuple = eqx.field(static=True)
    read: tuple = eqx.field(static=True)  # which leaves of the state those depend on
    continuous: tuple[int, ...] = eqx.field(static=True)  # guards whose touch leaves derivatives right
    scheduled: tuple[int, ...] = eqx.field(static=True)  # guards that are times left to known instants
    # Whether magnitudes of the guards follow the motion, because the system states none.
    learned: bool = eqx.field(static=True)
    stated: tuple[bool, ...] = eqx.field(static=True)  # the magnitudes of which guards are stated
    # How many of the guards, the last of them, are bends of a force: events without a transition.
    num_bends: int = eqx.field(static=True)
    width: int = eqx.field(static=True)  # low bits of the mode that say on which side of them a lane is
    roots: bool = eqx.field(static=True)  # whether a force with bends has roots, whose slope may bend

    @property
    def count(self) -> int:
        return len(self.directions)

    def is_bend(self, index: Any) -> Any:
        """Whether a function, one of the guards, is a bend of a force."""
        return (index >= self.num_guards - self.num_bends) & (index < self.num_guards)

    def is_scheduled(self, index: Any) -> Any:
        """Whether a function is the time left until a known instant."""
        return functools.reduce(operator.or_, (index == i for i in self.scheduled), index < -1)

    @property
    def num_silent(self) -> int:
        """How many of the guards are no events to the user: bends, and known instants."""
        return self.num_bends + len(self.scheduled)

    def is_silent(self, index: Any) -> Any:
        """Whether a function is one of those."""
        return self.is_bend(index) | self.is_scheduled(index)

    def until_scheduled(self, values: Values) -> Any:
        """Time left until the next of the known instants [s]; None where there are none."""
        left = [-values.value[i] / values.rate[i] for i in self.scheduled]
        return functools.reduce(jnp.minimum, left) if left else None

    def acts(self, index: int) -> bool:
        """Whether a crossing ends the step: guards and terminal sections, not recorded sections."""
        return index < self.num_guards or self.sections[index - self.num_guards].terminal

    def evaluate(self, system: AbstractHybridSystem, t, y, dy, mode, args, size=None) -> Values:
        """All values at `(t, y)`, their rates of change along the motion, and their terms if learned.

        `size`: the largest that the state has been.
        """
        one, zero_slope = jnp.ones_like(t), jax.tree.map(jnp.zeros_like, dy)

        def guards(t, y):
            return tuple(system.guards(t, y, mode, args))

        def field(t, y):
            return system.vector_field(t, y, mode, args)

        values, rates, scale = (), (), ()
        if self.num_guards:
            values, rates = jax.jvp(guards, (t, y), (one, dy))
            if self.learned and size is not None:
                scale = terms_in_state(system, t, y, mode, args, size)
        for section, of_slope in zip(self.sections, self.of_slope, strict=True):
            slope = zero_slope
            if of_slope:
                _, slope = jax.jvp(field, (t, y), (one, dy))

            def value(t, y, dy, section=section):
                return section.function(system, t, y, dy, mode, args)

            v, r = jax.jvp(value, (t, y, dy), (one, dy, slope))
            values, rates = (*values, v), (*rates, r)
        return Values(
            tuple(map(_times_factor, values, self.factors)),
            tuple(map(_times_factor, rates, self.factors)),
            scale,
        )

    def values(self, system: AbstractHybridSystem, t, y, dy, mode, args, scales: tuple) -> tuple:
        """Values alone, scaled by the stated magnitudes or by the learned `scales` of the guards."""
        values = tuple(system.guards(t, y, mode, args)) if self.num_guards else ()
        values += tuple(section.function(system, t, y, dy, mode, args) for section in self.sections)
        values = tuple(map(_times_factor, values, self.factors))
        return over_magnitudes(values, scales)

    def sign(self, index: int, start: Any) -> Any:
        """Factor that makes a crossing of function `index` a fall, given its value at the start."""
        direction = self.directions[index]
        if direction == "falling":
            return 1.0
        if direction == "rising":
            return -1.0
        return jnp.sign(start)


def over_magnitudes(values: tuple, scales: tuple) -> tuple:
    """Values of the guards over their magnitudes; the sections, which come last, are left alone.

    Magnitudes that are not known yet, as `_rescale` has it: a guess has a minus, of none is 0.
    """
    by = (jnp.where(s == 0, 1.0, jnp.abs(s)) for s in map(jnp.asarray, scales))
    return (*(v / s for v, s in zip(values, by, strict=False)), *values[len(scales) :])


def terms_in_state(system: AbstractHybridSystem, t, y, mode, args, size: PyTree) -> tuple:
    """How much each guard changes as the state goes from zero to `size`: what its terms amount to."""

    def guards(y):
        return tuple(system.guards(t, y, mode, args))

    t, y = jax.lax.stop_gradient((t, y))
    _, terms = jax.jvp(guards, (y,), (generic(size),))
    return tuple(jax.lax.stop_gradient(jnp.abs(term)) for term in terms)


def terms_in_parameters(system: AbstractHybridSystem, t, y, mode, args) -> tuple:
    """Size of the parameters in each guard, so that `ACCURACY.slack` of it is their rounding."""
    numbers, others = eqx.partition((system, args), eqx.is_inexact_array)

    def guards(numbers):
        system, args = eqx.combine(numbers, others)
        return tuple(system.guards(t, y, mode, args))

    t, y, numbers = jax.lax.stop_gradient((t, y, numbers))
    rounded = jax.tree.map(
        lambda a: jnp.where(jnp.isfinite(a), ACCURACY.part_of_slack * a, 0.0), numbers
    )
    terms = (jnp.abs(term) for term in jax.jvp(guards, (numbers,), (generic(rounded),))[1])
    return tuple(jnp.where(term < jnp.inf, term, 0.0) for term in terms)


def guards_over_magnitudes(system: AbstractHybridSystem, t, y, mode, args) -> Any:
    """The guards of one instant over their magnitudes, in a row; nothing is known of the motion."""
    values, scales = tuple(system.guards(t, y, mode, args)), guard_scales(system)
    if bends := getattr(system, "_sides", (0, 0))[0]:
        # Of one without a value nothing is known.
        values = (*values[:-bends], *(jnp.where(jnp.isnan(v), 0.0, v) for v in values[-bends:]))
    if system.guard_scales is None:
        by_state = terms_in_state(system, t, y, mode, args, sizes(y))
        by_numbers = terms_in_parameters(system, t, y, mode, args)
        found = zip(jax.lax.stop_gradient(values), by_state, by_numbers, strict=True)
        scales = tuple(jnp.maximum(jnp.abs(v), jnp.maximum(a, b)) for v, a, b in found)
    return jnp.stack(over_magnitudes(values, scales))


def _times_factor(value: Any, factor: Any) -> Any:
    if isinstance(factor, float) and factor == 1.0:
        return value
    return value * factor


def _inverse(scale: Any) -> Any:
    if scale is None:
        return 1.0
    return 1.0 / float(scale) if isinstance(scale, int | float) else jax.lax.stop_gradient(1.0 / scale)


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
    for i, (direction, scale) in enumerate(
        zip(guard_directions(system), guard_scales(system), strict=True)
    ):
        check_in(f"guard_directions[{i}]", direction, DIRECTIONS)
        if scale is not None:  # which a bend of a force has: it is learned from the motion
            one_number(f"guard_scales[{i}]", scale, "positive")
    for section in sections:
        check(
            lambda t, y, dy, s=section: s.function(system, t, y, dy, mode, args), section.name, t, y, dy
        )
    of_slope = tuple(s.uses_slope(system, t, y, dy, mode, args) for s in sections)
    scheduled = system.scheduled_guards
    judged = (i not in scheduled for i in range(len(names)))
    judged = (*judged, *(not slope for slope in of_slope))
    scales = (None,) * len(names) if system.guard_scales is None else system.guard_scales
    function = all_values(system, sections, dy, mode, args)
    degree = degrees(function, (t, y), (True, True))
    kept = [known and d != NONE for known, d in zip(judged, degree, strict=True)]
    # A name that no parameter of a user's has.
    num_bends, width, roots = getattr(system, "_sides", (0, 0, False))
    return EventFunctions(
        num_guards=len(names),
        directions=guard_directions(system) + tuple(s.direction for s in sections),
        factors=tuple(map(_inverse, guard_scales(system))) + (1.0,) * len(sections),
        sections=sections,
        of_slope=of_slope,
        bent=tuple(known and d == OTHER for known, d in zip(judged, degree, strict=True)),
        straight=tuple(known and d == AFFINE for known, d in zip(judged, degree, strict=True)),
        read=_read(function, t, y, kept),
        continuous=system.continuous_guards,
        scheduled=scheduled,
        learned=any(scale is None for scale in scales),
        stated=tuple(scale is not None for scale in scales),
        num_bends=num_bends,
        width=width,
        roots=roots,
    )


def _read(function: Callable, t, y, kept: list[bool]) -> tuple[bool, ...]:
    """Which leaves of the state the `kept` results of `function(t, y)` depend on."""
    closed = jax.make_jaxpr(function)(t, y)
    used = dce_jaxpr(closed.jaxpr, kept)[1]
    return tuple(used[len(jax.tree.leaves(t)) :])


def all_values(
    system: AbstractHybridSystem, sections: tuple[Section, ...], dy, mode, args
) -> Callable[[Any, Any], list]:
    """The event functions as one function of time and state."""

    def values(t, y):
        guards = tuple(system.guards(t, y, mode, args)) if system.guard_names else ()
        return [*guards, *(s.function(system, t, y, dy, mode, args) for s in sections)]

    return values
