"""How long the next attempt is."""

from typing import Any, NamedTuple

import equinox.internal as eqxi
import jax
import jax.numpy as jnp

from ._loop_state import DIP, HOLD, PLAIN, REFRESH, REJECT, SHRINK, Lane, Plan, is_event
from ._tolerance import Ends, scales
from .accuracy import ACCURACY
from .executor import bookkeeping


def _target(plan: Plan, next_output, t1, outputs):
    """Time the lane must land on next, and whether that is the end rather than an output time."""
    if not plan.has_outputs:
        return t1, jnp.ones_like(next_output) > 0
    n = outputs.shape[0]
    is_last = next_output >= n
    # Past the last row the index is held, or a batch would read outside of the array.
    return jnp.where(is_last, t1, outputs[jnp.minimum(next_output, n - 1)]), is_last


def rounding(t, t1):
    """Times closer than this are one."""
    return 4e-16 * jnp.maximum(jnp.abs(t), jnp.abs(t1))


class Next(NamedTuple):
    """The next attempt: its length, what the step-size rule alone would take, the output aimed at."""

    h: Any
    h_free: Any
    output: Any
    landed: Any  # whether this attempt landed on an output time


def control(
    plan: Plan, code, lane: Lane, h, search, known, error, t, y, dy, size, t1, outputs, begins: bool
) -> Next:
    """Choice of the next attempt.

    `search`: the lengths that an event being located, and a place to look at, ask for; None where no
    event function interferes. `known`: event functions at the start of the next attempt. `begins`:
    whether a lane may just have computed its first slope.
    """
    rule: Any = plan.step_size
    scheduled = plan.functions.until_scheduled(known)
    landed, next_output = code < HOLD, lane.next_output
    if plan.has_outputs:
        landed, next_output = _land_on_output(plan, code, scheduled, next_output, t, t1, outputs)
    # Three lengths: what the rule would take (`h_free`, which outlives steps that an event or an output
    # time has shortened), what this lane takes next, and what it takes after a rejection.
    h_free, h_take, h_rejected = lane.h_free, None, h
    if rule.adaptive:
        factors = _factors(plan, error, lane.error)
        first = _begun(plan, h_free, h, y, dy, size) if begins else h_free
        h_free = _free(plan, code, h, h_free, first, factors, lane.bracket.tries, landed)
        h_take = h_rejected = h_free
    h_next = _length(plan, code, h_take, h_rejected, search, scheduled, next_output, t, t1, outputs)
    return Next(h_next, h_free, next_output, landed)


@bookkeeping
def _factors(plan: Plan, error, last):
    """Ratio of the next step to this one if it is accepted, and, where it is another, if rejected."""
    rule: Any = plan.step_size
    order = plan.stepper.order()
    error = jnp.where(error < 1e10, error, 1e10)  # what is not a number counts as large
    if rule.remembers:
        # After a rejection the error before it says nothing, and 1 stands for it.
        return rule.factor(error, last, order), rule.factor(error, jnp.ones_like(error), order)
    return (rule.factor(error, last, order),)


def _begun(plan: Plan, h_free, h, y, dy, size):
    """The length that the rule takes, of its own choice where a lane has just begun."""
    rule: Any = plan.step_size
    # Step lengths are not differentiated: the grid is a choice, not part of the motion.
    h_free, h, y, dy, size = jax.lax.stop_gradient((h_free, h, y, dy, size))

    def initial(y, dy, size, h_free):
        scale = scales(rule.rtol, plan.atols, plan.kinds, plan.noise, size, Ends(h, y, y, dy, dy))
        first = rule.initial(y, dy, scale)
        first = jnp.where(jnp.isfinite(first), first, ACCURACY.first_step * plan.resolution)
        return jnp.where(h_free == 0, first, h_free)

    # Lanes begin once: a branch for the whole batch, not a piece of every attempt.
    return jax.lax.cond(
        eqxi.unvmap_any(h_free == 0), initial, lambda y, dy, size, h_free: h_free, y, dy, size, h_free
    )


@bookkeeping
def _free(plan: Plan, code, h, h_free, first, factors, tries, landed):
    """Length of the next step if nothing but the step-size rule were to shorten it."""
    grown = h * factors[0]
    rule: Any = plan.step_size
    # A length that an event or an output time has shortened says nothing on the length that is
    # possible.
    grown = jnp.where(landed | (tries != 0), jnp.maximum(grown, h_free), grown)
    taken = jnp.where(code == PLAIN, grown, first)
    # A rejected step must become shorter whatever the rule says, or it would be repeated as it is.
    # One that ended on a border is halved, because the part that is left decides.
    most = 0.5 if plan.functions.roots else 0.9
    rejected = h * jnp.minimum(factors[-1], most)
    return jnp.minimum(jnp.where(code == REJECT, rejected, taken), rule.dtmax)


@bookkeeping
def _length(plan: Plan, code, h_take, h_rejected, search, scheduled, next_output, t, t1, outputs):
    """Length of the next attempt: to the end, the next output time or known instant, unless an event is
    located."""
    target = _target(plan, next_output, t1, outputs)[0] if plan.has_outputs else t1
    # A rule that is not adaptive needs no state, and its length is a constant of the program.
    h_take = plan.step_size.initial(None, None, None) if h_take is None else h_take
    # A remainder that is longer by rounding alone is taken whole; else a step of some 1e-16 s would
    # follow, whose scaled error means nothing.
    remaining = target - t
    if scheduled is not None:
        remaining = jnp.minimum(remaining, scheduled)
    h_next = jnp.where(remaining <= h_take * (1.0 + 1e-9), jnp.maximum(remaining, 0.0), h_take)
    if search is not None:
        h_located, h_dip = search
        # In the new mode slope and event functions are not known yet: an attempt of length zero.
        h_next = jnp.where(is_event(code), 0.0, h_next)
        h_next = jnp.where(code == SHRINK, h_located, h_next)
        h_next = jnp.where(code == DIP, h_dip, h_next)
    return jnp.where(code == REJECT, h_rejected, h_next)


@bookkeeping
def _land_on_output(plan: Plan, code, scheduled, next_output, t, t1, outputs):
    target, is_last = _target(plan, next_output, t1, outputs)
    # An event at an output time comes first; the output is taken by the attempt of length zero after.
    landed = (code == PLAIN) | (code == REFRESH)
    landed = landed & (target - t <= rounding(t, t1)) & ~is_last
    if scheduled is not None:
        landed = landed & (scheduled > rounding(t, t1))
    return landed, next_output + jnp.where(landed, 1, 0)
