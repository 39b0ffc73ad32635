"""Crossings of sections, located after the run: the step they lie in is repeated, shorter."""

from typing import Any

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from . import _locate
from ._event_time import event_delay
from ._lane import Plan
from ._record import Starts
from ._section import Section
from ._tree import shift
from ._xla import Executor, piece, time_loop

MOST_TRIES = 64


def crossings(plan: Plan, theta: PyTree, section: Section, rows: Starts) -> tuple[Any, PyTree, PyTree]:
    """Times, states and slopes at the crossings in `rows`; the motion itself knows nothing of them.

    The length of the shortened step is not differentiated: from where it ends a Newton step leads
    onto the section, whose derivative is that of the crossing.
    """

    @time_loop
    def whole(plan, theta, rows):
        def length(row):
            # Fused, one row of all lanes fits the first-level cache, and rows not in use cost nothing.
            return jax.lax.cond(
                eqxi.unvmap_any(row.h > 0),
                lambda row: _length(plan, theta, section, row), lambda row: row.h,
                row,
            )  # fmt: skip

        return jax.lax.map(length, rows) if plan.execute.fused else jax.vmap(length)(rows)

    h = whole(plan, *_frozen((theta, rows)))
    return jax.vmap(lambda row, h: _land(plan, theta, section, row, h))(rows, h)


def _frozen(tree: PyTree) -> PyTree:
    return jax.tree.map(lambda a: jax.lax.stop_gradient(a) if eqx.is_array(a) else a, tree)


def _start(theta, row: Starts, execute: Executor):
    system, args = theta

    def field(t, y):
        return system.vector_field(t, y, row.mode, args)

    @piece
    def start(execute, t, y):
        return field(t, y)

    return field, start(execute, row.t, row.y)


def _along(theta, section: Section, mode, t, y, dy):
    """Value of the section, the slope of the state, and the rates of both along the motion."""
    system, args = theta

    def look(t, y):
        slope = system.vector_field(t, y, mode, args)
        return section.function(t, y, slope, mode, args), slope

    return jax.jvp(look, (t, y), (jnp.ones_like(t), dy))


def _length(plan: Plan, theta, section: Section, row: Starts):
    """Length of the step from `row` that ends on the section, to a part in a million."""
    execute = plan.execute.for_the_ends()
    field, slope = _start(theta, row, execute)

    @piece
    def value(execute, t, y, dy):
        (value, _), (rate, _) = _along(theta, section, row.mode, t, y, dy)
        return value, rate

    def look(h):
        y, dy, _ = plan.stepper.step(field, row.t, row.y, slope, h, execute)
        return value(execute, row.t + h, y, dy)

    def turned(sign, found):
        return tuple(sign * a for a in found)

    start = value(execute, row.t, row.y, slope)
    sign = {"falling": 1.0, "rising": -1.0}.get(section.direction, jnp.sign(start[0]))
    value0, rate0 = turned(sign, start)

    def cond(carry):
        _, _, searching, tries = carry
        return eqxi.unvmap_any(searching) & (tries < MOST_TRIES)

    def body(carry):
        bracket, best, searching, tries = carry
        whole = tries == 0
        h = jnp.where(whole, row.h, _locate.propose(bracket, row.h, row.t))
        value, rate = turned(sign, look(h))
        near = jnp.abs(value) <= -rate * _locate.TOLERANCE_SECTION * row.h
        collapsed = _locate.is_collapsed(bracket, row.t)
        best = jnp.where(searching, h, best)
        # Whether the step crosses was decided in the run; here rounding may see it otherwise.
        searching = searching & jnp.where(whole, value < 0, ~near & ~collapsed)
        bracket = _locate.update(bracket, searching, h, value, rate, value0, rate0)
        return bracket, best, searching, tries + 1

    zero = jnp.zeros_like(row.h)
    carry = (_locate.empty(zero), zero, (row.h > 0) & (value0 > 0), jnp.zeros((), jnp.int32))
    return jax.lax.while_loop(cond, body, carry)[1]


def _land(plan: Plan, theta, section: Section, row: Starts, h):
    """The shortened step and one Newton step onto the section with its exact rate."""
    execute = plan.execute.for_the_ends()
    field, dy = _start(theta, row, execute)
    y, dy, _ = plan.stepper.step(field, row.t, row.y, dy, h, execute)
    sg = jax.lax.stop_gradient
    t = row.t + h
    slope = sg(dy)
    (value, dy), (rate, ddy) = _along(theta, section, row.mode, t, y, slope)
    # A jump over the section is a step of length zero: its time is that of the event.
    usable = (row.h > 0) & (sg(rate) != 0)
    dt = event_delay(value, sg(rate), usable)
    return t + dt, shift(y, slope, dt), shift(dy, sg(ddy), dt)
