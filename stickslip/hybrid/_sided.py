"""A system whose field bends or jumps in the state, with the sides on which it is as part of the mode.

A bend is then an event like others, without a jump of the state: it is located, the step ends there,
and within a step the field is that of one side. Nobody outside of a run sees the sides.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.core
import jax.extend
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.interpreters.partial_eval import dce_jaxpr
from jaxtyping import PyTree

from .._jaxpr import LITERAL, equations, nowhere
from .._validation import MOST_NUMBERED
from ._bends import Change, Outcomes, compares, evaluate_with
from ._section import Section
from ._wrapper import AbstractSystemWrapper
from .accuracy import ACCURACY
from .system import AbstractHybridSystem, mode_type


class Sided(AbstractSystemWrapper):
    """`system` with the outcomes of the comparisons in its field as the low bits of the mode."""

    system: AbstractHybridSystem
    width: int = eqx.field(static=True)
    changes: tuple[Change, ...] = eqx.field(static=True)
    jumps: bool = eqx.field(static=True)  # whether the field is rounded somewhere: that is not located
    roots: bool = eqx.field(static=True)
    field: "Program" = eqx.field(static=True)  # slope of the state and the margins, by the sides given
    numbers: "Program" = eqx.field(static=True)  # sides by the numbers
    steep: bool = eqx.field(
        static=True
    )  # whether guards have no slope somewhere, where a force has one

    def inner(self, y, args):
        return y, args

    @property
    def mode_names(self) -> Any:
        """As many as there are modes and sides; they have no names."""
        return range(len(self.system.mode_names) << self.width)

    @property
    def _sides(self) -> tuple[int, int, bool]:
        """Number of the bends, and of the low bits of the mode that say on which side of them it is;
        whether the field has roots."""
        return len(self.changes), self.width, self.roots

    @property
    def _own_guards(self) -> tuple[str, ...]:
        return ("a force bends",) * len(self.changes)

    @property
    def _own_scales(self) -> tuple:
        return (None,) * len(self.changes)  # never stated

    def inner_mode(self, mode: Any) -> Any:
        """The mode of `system`."""
        return jnp.asarray(mode >> self.width, mode_type(self.system))

    def with_sides(self, t: Any, y: PyTree, mode: Any, args: PyTree) -> Any:
        """The mode for a `mode` of `system`, with the sides that the state is on."""
        (found,) = self.numbers((self.system, args), t, jnp.maximum(mode, 0), y, (True,))
        mode = jnp.asarray(mode, mode_type(self)) << self.width
        return mode | jnp.asarray(found, mode.dtype)

    def held_state(self, t, y, mode, args):
        return self.system.held_state(t, y, self.inner_mode(mode), args)

    def vector_field(self, t, y, mode, args):
        leaves, form = jax.tree.flatten(y)
        wanted = (True,) * len(leaves) + (False,) * len(self.changes)
        return jax.tree.unflatten(form, self.field((self.system, args), t, mode, y, wanted))

    def guards(self, t, y, mode, args):
        wanted = (False,) * len(jax.tree.leaves(y)) + (True,) * len(self.changes)
        margins = self.field((self.system, args), t, mode, y, wanted)
        mode = self.inner_mode(mode)
        if self.steep:
            return (*_gentle_guards(self.system, t, y, mode, args), *margins)
        return (*self.system.guards(t, y, mode, args), *margins)

    def transition(self, t, y, mode: Any, guard, args):
        first = len(self.system.guard_names)
        over = mode
        for number, (adds, place) in enumerate(self.changes, start=first):
            bit = jnp.asarray(1 << place, mode.dtype)
            over = jnp.where(guard == number, mode ^ bit if adds is None else mode + adds * bit, over)
        if not first:
            return y, over
        own = jnp.minimum(guard, first - 1)
        after, new = self.system.transition(t, y, self.inner_mode(mode), own, args)
        new = self.with_sides(t, after, new, args)
        bends = guard >= first
        y = jax.tree.map(lambda a, b: jnp.where(bends, a, b), y, after)
        return y, jnp.where(bends, over, new)


class Program:
    """A function of a system with its arguments, time, mode and state, traced once for all calls."""

    def __init__(self, function: Callable, problem: PyTree, t: Any, mode: Any, y: PyTree):
        leaves, form = jax.tree.flatten(problem)
        self.arrays = [isinstance(leaf, jax.Array | np.ndarray) for leaf in leaves]
        rest = [None if array else leaf for leaf, array in zip(leaves, self.arrays, strict=True)]

        def flat(given, t, mode, y):
            given = iter(given)
            whole = [next(given) if a else x for a, x in zip(self.arrays, rest, strict=True)]
            return function(*jax.tree.unflatten(form, whole), t, mode, y)

        given = [leaf for leaf, array in zip(leaves, self.arrays, strict=True) if array]
        self.closed = jax.make_jaxpr(flat)(given, t, mode, y)
        self.parts: dict = {}

    def __call__(self, problem: PyTree, t: Any, mode: Any, y: PyTree, wanted: tuple) -> list:
        """The results that are wanted."""
        if wanted not in self.parts:
            self.parts[wanted] = dce_jaxpr(self.closed.jaxpr, wanted, instantiate=True)[0]
        leaves = jax.tree.leaves(problem)
        given = [leaf for leaf, array in zip(leaves, self.arrays, strict=True) if array]
        t = jnp.asarray(t, jnp.float64)
        operands = jax.tree.leaves((given, t, mode, y))
        return jax.core.eval_jaxpr(self.parts[wanted], self.closed.consts, *operands)


def system_with_sides(
    system: AbstractHybridSystem, t: Any, y: PyTree, mode: Any, args: PyTree
) -> tuple[Sided | None, bool]:
    """`system` with its sides, None if there are none, and whether its field bends elsewhere too."""
    if not compares(_field_program(system, t, y, mode, args)[0].jaxpr):
        if not jax.eval_shape(lambda t, y: system.switches_in(t, y, mode, args), t, y):
            return None, False
    found: Any = None

    def by_numbers(system, args, t, mode, y):
        nonlocal found
        found = _look(system, t, y, mode, args)[1]
        return [jnp.asarray(found.found, jnp.int64)]

    numbers = Program(by_numbers, (system, args), t, mode, y)
    # A system that declares its switches knows of what is not seen.
    left, width = found.left and not found.declared, found.width
    if not found.changes or len(system.mode_names) << width > MOST_NUMBERED:
        return None, left or bool(found.changes)
    changes, jumps, roots = tuple(found.changes), found.jumps, found.roots

    def by_sides(system, args, t, mode, y):
        slope, found = _look(system, t, y, jnp.asarray(mode >> width, kind), args, mode)
        return [*jax.tree.leaves(slope), *found.margins]

    kind = mode_type(system)
    wide = jnp.int64 if len(system.mode_names) << width > 2**31 else jnp.int32
    field = Program(by_sides, (system, args), t, jnp.asarray(mode, wide) << width, y)
    outcomes = Outcomes()
    jax.eval_shape(lambda t, y: _gentle_guards(system, t, y, mode, args, outcomes), t, y)
    return Sided(system, width, changes, jumps, roots, field, numbers, outcomes.steep), left


def _gentle_guards(system: Any, t: Any, y: PyTree, mode: Any, args: PyTree, seen: Any = None) -> tuple:
    """Guards with the slopes that the field has: a root at zero has one of 0, not of NaN."""
    leaves, form = jax.tree.flatten((t, y))
    closed = jax.make_jaxpr(lambda *given: system.guards(*jax.tree.unflatten(form, given), mode, args))(
        *leaves
    )
    return tuple(evaluate_with(closed, leaves, (True,) * len(leaves), seen or Outcomes()))


def of_sided(section: Section) -> Section:
    """A section of a system as one of the system with its sides."""

    def function(system, t, y, dy, mode, args):
        return section.function(system.system, t, y, dy, system.inner_mode(mode), args)

    return Section(function, section.direction, section.terminal, section.name)


def _field_program(system: Any, t: Any, y: PyTree, mode: Any, args: PyTree) -> tuple:
    """The field as a program of time, mode and the numbers of the state; the form of its result."""
    leaves, form = jax.tree.flatten(y)
    slope: Any = None

    def field(t, mode, *leaves):
        nonlocal slope
        found = system.vector_field(t, jax.tree.unflatten(form, leaves), mode, args)
        found, slope = jax.tree.flatten(found)
        return found

    closed = jax.make_jaxpr(field)(t, mode, *leaves)
    # A number without a slope is not a part of the motion.
    used = dce_jaxpr(closed.jaxpr, [True] * len(closed.jaxpr.outvars), instantiate=True)[0]
    return jax.extend.core.ClosedJaxpr(used, closed.consts), slope


def _look(
    system: Any, t: Any, y: PyTree, mode: Any, args: PyTree, code: Any = None
) -> tuple[PyTree, Outcomes]:
    """Slope of the state and the outcomes behind it: those of a `code`, or as the numbers say."""
    outcomes = Outcomes(code)
    t, y = _on_declared_sides(system, t, y, mode, args, outcomes)
    closed, form = _field_program(system, t, y, mode, args)
    leaves = jax.tree.leaves(y)
    # A number without a slope, such as that of a piece between two breaks, changes in no outcome.
    varies = (False, False, *(_moves(slope, closed.jaxpr) for slope in closed.jaxpr.outvars))
    found = evaluate_with(closed, (t, mode, *leaves), varies, outcomes)
    return jax.tree.unflatten(form, found), outcomes


def _on_declared_sides(
    system: Any, t: Any, y: PyTree, mode: Any, args: PyTree, outcomes: Outcomes
) -> tuple:
    """Time and state on the sides of the switches that the system declares, by the outcomes given.

    Beyond a border by a little they are moved back across it, without a slope of their own: where to
    does not matter, as the motion ends its step at the border.
    """
    count = len(jax.eval_shape(lambda t, y: system.switches_in(t, y, mode, args), t, y))
    for number in range(count):

        def value(t, y, number=number):
            found = jnp.asarray(system.switches_in(t, y, mode, args)[number], jnp.float64)
            if found.shape != ():
                raise ValueError(f"switches(...)[{number}] has shape {found.shape}; allowed: scalars")
            return found

        now, slopes = jax.value_and_grad(value, argnums=(0, 1))(t, y)
        side = outcomes.declares(now)
        if outcomes.code is None:
            continue
        flat, back = ravel_pytree(jax.lax.stop_gradient((t, y)))
        slopes = ravel_pytree(slopes)[0]
        beside = ACCURACY.edge * (jnp.sum(jnp.abs(slopes * flat)) + jnp.abs(now)) + 1e-300
        lacks = jax.lax.stop_gradient(jnp.maximum(beside - jnp.where(side, now, -now), 0.0))
        # Each number by its own size, and by more where it passes zero, lest one of little effect be
        # moved far in its place; the time, which comes first, only if there is nothing else.
        weight = jnp.abs(flat) / jnp.maximum(jnp.max(jnp.abs(flat)), 1e-300) + 1e-3
        first = np.concatenate([[1e-12], np.ones(flat.size - 1)])
        weight = jnp.where(slopes == 0.0, 0.0, first * weight**2)
        reach = jnp.sum(weight * slopes * slopes)
        moved = jnp.where(side, lacks, -lacks) * weight * slopes / jnp.where(reach > 0, reach, 1.0)
        t, y = jax.tree.map(jnp.add, (t, y), back(jax.lax.stop_gradient(moved)))
    return t, y


def _moves(slope: Any, jaxpr: Any) -> bool:
    """Whether a result of a program is more than the constant 0."""
    made = (eqn for eqn in equations(jaxpr, nowhere) if any(var is slope for var in eqn.outvars))
    atoms = [slope] if isinstance(slope, LITERAL) else [atom for eqn in made for atom in eqn.invars]
    return not (atoms and all(isinstance(a, LITERAL) and not np.any(a.val) for a in atoms))


def without_sides(solution: Any, system: Any) -> Any:
    """Solution of a run of `system`, with the modes of the system itself if `system` is a `Sided`."""
    if not isinstance(system, Sided):
        return solution

    def modes(found):
        logs = [found.outputs, found.steps, *found.crossings]
        of_events = [] if found.events is None else [found.events.mode_before, found.events.mode_after]
        return [found.mode1, *(log.mode for log in logs if log is not None), *of_events]

    leaves, form = jax.tree.flatten(solution)
    places = [any(leaf is mode for mode in modes(solution)) for leaf in leaves]
    inner = [system.inner_mode(a) if place else a for a, place in zip(leaves, places, strict=True)]
    return jax.tree.unflatten(form, inner)
