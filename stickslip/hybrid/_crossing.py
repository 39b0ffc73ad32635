"""Crossings of sections, located after the run: the step they lie in is repeated, shorter.

The length of the shortened step is not differentiated: from where it ends a Newton step leads onto the
section, whose derivative is that of the crossing. A derivative is computed in a run of its own, whose
steps end elsewhere: rounding chooses them. So it starts from the steps of that run, and is told the
times of the crossings.
"""

from collections.abc import Callable
from typing import Any

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jax.lax import stop_gradient
from jaxtyping import PyTree

from . import _locate
from ._by_length import by_length, length_before, moved_to_zero
from ._loop_state import Plan
from ._record import Crossed, Starts
from ._section import Section
from .accuracy import ACCURACY
from .event_time import event_delay
from .executor import piece, time_loop
from .tree import select, shift, write_row


def crossings(plan: Plan, problem: PyTree, section: Section, rows: Starts, count: Any) -> Crossed:
    """Times, states and slopes at the crossings in `rows`; the motion itself knows nothing of them.

    Rows past the `count` are meaningless.
    """
    if plan.execute.fused:
        return crossings_near(
            plan, problem, section, rows, rows.t + _lengths(plan, problem, section, rows)
        )

    def crossing(row):
        # The search has been where it leads to: repeating that step would double the program.
        return land_on_section(problem, section, row, *_search(plan, problem, section, row))

    return _of_each(crossing, rows, count, Crossed(rows.t, rows.y, rows.y, rows.mode))


def crossings_near(plan: Plan, problem: PyTree, section: Section, rows: Starts, near: Any) -> Crossed:
    """The crossings in `rows` where their times are known to a part of a step; with derivatives."""
    execute = plan.execute.for_the_ends()

    def land(row, near):
        field = field_of(problem, row.mode)

        @piece
        def start(execute, t, y):
            return field(t, y)

        dy0, look = start(execute, row.t, row.y), section_and_slope(problem, section, row.mode)
        h = length_before(plan, look, row.t, row.y, dy0, length_of(row, near))
        y, dy, _ = plan.stepper.step(field, row.t, row.y, dy0, h, execute)
        slope = by_length(plan, problem, row, dy0, h) if plan.functions.roots else None
        return land_on_section(problem, section, row, h, y, dy, slope)

    return jax.vmap(land)(rows, near)


def length_of(row: Any, near: Any) -> Any:
    """Length of the step from a row (it has `t` and `h`) to a time, within that of the row."""
    return stop_gradient(jnp.clip(near - row.t, 0.0, row.h))


def _lengths(plan: Plan, problem: PyTree, section: Section, rows: Starts) -> Any:
    """Lengths of the steps that end on the section, to a part in a million."""

    @time_loop
    def whole(plan, problem, rows):
        def in_use(row):
            # One row of all lanes fits the first-level cache, and rows not in use cost nothing.
            return jax.lax.cond(
                eqxi.unvmap_any(row.h > 0),
                lambda row: _search(plan, problem, section, row)[0], lambda row: row.h, row,
            )  # fmt: skip

        return jax.lax.map(in_use, rows)

    return whole(plan, problem, rows)


def _of_each(function: Callable, rows: Starts, count: Any, like: PyTree) -> PyTree:
    """`function` of the rows in use, one after the other: side by side it compiles three times as
    long. Zero for the others; `like` is what all results look like."""
    most = eqxi.unvmap_max(count)

    def body(carry):
        i, out = carry
        return i + 1, write_row(out, function(jax.tree.map(lambda a: a[i], rows)), i)

    begun = jnp.zeros((), jnp.int32), jax.tree.map(jnp.zeros_like, like)
    return jax.lax.while_loop(lambda carry: carry[0] < most, body, begun)[1]


def land_on_section(
    problem, section: Section, row: Any, h, y, dy, by_length: PyTree | None = None
) -> Crossed:
    """From the end of the shortened step one Newton step onto the section with its exact rate.

    `by_length`: the slope at the end by the length of the step, where it is not `dy`.
    """
    t = row.t + h
    # A jump over the section is a step of length zero: its time is that of the event.
    usable = row.h > 0
    if by_length is not None:
        look = section_and_slope(problem, section, row.mode)
        return Crossed(*moved_to_zero(look, t, y, by_length, usable), row.mode)
    slope = stop_gradient(dy)
    (value, dy), (rate, ddy) = _along(problem, section, row.mode, t, y, slope)
    dt = event_delay(value, stop_gradient(rate), usable)
    return Crossed(t + dt, shift(y, slope, dt), shift(dy, stop_gradient(ddy), dt), row.mode)


def field_of(problem, mode):
    """The field of a mode, of time and state."""
    system, args = problem
    return lambda t, y: system.vector_field(t, y, mode, args)


def section_and_slope(problem, section: Section, mode):
    """Value of a section and the slope of the state, of time and state."""
    system, args = problem

    def look(t, y):
        slope = system.vector_field(t, y, mode, args)
        return section.function(system, t, y, slope, mode, args), slope

    return look


def _along(problem, section: Section, mode, t, y, dy):
    """Value of the section, the slope of the state, and the rates of both along the motion."""
    return jax.jvp(section_and_slope(problem, section, mode), (t, y), (jnp.ones_like(t), dy))


def _search(plan: Plan, problem, section: Section, row: Starts) -> tuple[Any, PyTree, PyTree]:
    """Length of the step from `row` that ends on the section, to a part in a million, and its end.

    The first step has length zero and says what the section is at the start, the second is whole.
    """
    execute = plan.execute.for_the_ends()
    field = field_of(problem, row.mode)

    @piece
    def value_of(execute, t, y, dy):
        (value, _), (rate, _) = _along(problem, section, row.mode, t, y, dy)
        return value, rate

    def is_zero(value, rate):
        # The run rounds by the step before this one, which may have been longer.
        instant = ACCURACY.zero * row.h + ACCURACY.same_instant * ACCURACY.rounding * jnp.abs(row.t)
        return jnp.abs(value) <= instant * jnp.abs(rate)

    def cond(carry):
        *_, searching, tries = carry
        return eqxi.unvmap_any(searching) & (tries < ACCURACY.crossing_tries)

    def body(carry):
        bracket, best, (slope, *start), end, searching, tries = carry
        begins, whole = tries == 0, tries == 1
        h = jnp.where(whole, row.h, _locate.propose(bracket, row.h, row.t))
        h = jnp.where(begins, 0.0, h)
        y, dy, _ = plan.stepper.step(field, row.t, row.y, tree(slope), h, execute)
        found = value_of(execute, row.t + h, y, dy)
        y, dy = ravel_pytree(y)[0], ravel_pytree(dy)[0]
        slope, *start = select(begins, (dy, *found), (slope, *start))
        # One that starts on zero, at an event say, has a sign of rounding: it has left that of its end.
        # Where an event ends the step too, only the slope at the start knows where it goes.
        end = jnp.where(whole, jnp.where(is_zero(*found), 0.0, found[0]), end)
        on_zero = is_zero(*start)
        if section.direction == "both":  # it crosses: of two ends on one side the lower is on zero
            on_zero = on_zero | ((start[0] * end > 0) & (jnp.abs(start[0]) < jnp.abs(end)))
        side = jnp.where(on_zero, jnp.where(end == 0, start[1], -end), start[0])
        sign = {"falling": 1.0, "rising": -1.0}.get(section.direction, jnp.sign(side))
        value, rate, value0, rate0 = (sign * a for a in (*found, *start))
        on_zero = on_zero | ((value0 < 0) & (rate0 > 0))
        value0 = jnp.where(on_zero, jnp.maximum(value0, 0.0), value0)
        near = jnp.abs(value) <= -rate * ACCURACY.same * row.h
        collapsed = _locate.is_collapsed(bracket, row.t, row.h)
        # Whether the step crosses was decided in the run; here rounding may see it otherwise.
        inside = (value0 > 0) | on_zero
        best = select(searching & (inside | ~whole), (h, y, dy), best)
        searching = searching & jnp.where(whole, inside & (value < 0), ~near & ~collapsed)
        searching = jnp.where(begins, row.h > 0, searching)
        bracket = _locate.update(bracket, searching & ~begins, h, value, rate, value0, rate0)
        return bracket, best, (slope, *start), end, searching, tries + 1

    zero, (y, tree) = jnp.zeros_like(row.h), ravel_pytree(row.y)
    nowhere = (jnp.zeros_like(y), zero, zero)
    tries = jnp.zeros((), jnp.int32)
    begun = (_locate.empty(zero), (zero, y, y), nowhere, zero, zero == 0, tries)
    _, (h, y, dy), *_ = jax.lax.while_loop(cond, body, begun)
    return h, tree(y), tree(dy)
