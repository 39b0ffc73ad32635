"""A Runge-Kutta step that is not yet accepted: its end, its error, and the event functions there."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._by_length import leaving_time
from ._doubt import judge, look_inside, told
from ._loop_state import Lane, Plan, without_state
from ._tolerance import Ends, cancelling, error_norm, largest_magnitude, largest_surprise, scales, sizes
from ._unseen import step_excess
from .accuracy import ACCURACY
from .event_functions import STALE, Values, over_magnitudes
from .executor import bookkeeping, piece
from .status import DISCONTINUOUS, RUNNING, flag, flags_with
from .tree import shift


class Step(NamedTuple):
    """A step of length `h` from the lane's state, and what was seen of the event functions."""

    h: Any
    y1: PyTree
    dy1: PyTree
    error: Any  # scaled error of the state, or the doubt about an event function where it is larger
    values: Values  # event functions at the end, by the magnitudes of the guards at the start
    kept: Values  # the same by the magnitudes at the end
    h_seen: Any  # where an event function was seen beyond zero inside the step; 0 if nowhere
    jumps: Any  # whether an event function jumps inside it


def take(plan: Plan, problem: PyTree, lane: Lane) -> tuple[Lane, Step]:
    """The step, and the lane with what follows the size of the motion brought up to date."""
    system, args = problem
    # The grid of steps is not differentiated; where a step ends at an event, the Newton correction
    # brings the derivative of the event time back in.
    h = jax.lax.stop_gradient(lane.h)
    if plan.follows_size:
        lane = lane._replace(size=_follow_size(plan, lane.size, lane.y))

    after = leaving_time(plan, without_state(lane)) if plan.functions.roots else None

    def field(t, y):
        if after is not None:
            t, y = t + after, shift(y, jax.lax.stop_gradient(lane.dy), after)
        return system.vector_field(t, y, lane.mode, args)

    looks = any(plan.looked_at_inside)
    stepper = plan.stepper
    if stepper.solves:
        stepper = stepper.solved_to(_unit(plan, field, lane, h))
    points = ACCURACY.points_inside if looks else ()
    y1, dy1, errors, within, surprise = stepper.step_and_look(
        field, lane.t, lane.y, lane.dy, h, plan.execute, points, plan.functions.read,
        plan.step_size.adaptive and plan.functions.num_guards > 0,
    )  # fmt: skip
    error = lane.error
    if plan.step_size.adaptive:
        ends = Ends(h, lane.y, y1, lane.dy, dy1)
        error, surprised, change = _scaled_error(plan, errors, surprise, plan.noise, lane.size, ends)
        if plan.watches_jumps:
            peak, flags = _sudden_change(plan, without_state(lane), error, change)
            lane = lane._replace(peak=peak, flags=flags)
        if surprised is not None:
            error = jnp.maximum(error, surprised)
        if plan.watched:
            error = jnp.maximum(error, _excess_of_step(plan, h, ends))
    kept, values, used = Values((), ()), Values((), ()), ()
    h_seen, jumps = jnp.zeros_like(h), jnp.zeros_like(h) > 0
    if plan.functions.count:
        kept = values = _values_at(plan, lane.mode, lane.t + h, y1, dy1, lane.size, problem=problem)
        if plan.functions.learned:
            # Values at the end are the start values of the next step, scaled by the magnitudes found
            # there.
            bare = without_state(lane)
            used, values, kept = _rescale(plan, bare, values)
            if plan.functions.num_bends:
                values, kept = (_with_stale(plan, bare, found) for found in (values, kept))
    if looks:
        bare = without_state(lane)._replace(scales=used)
        inside = _look_inside(plan, bare, h, within, dy1, problem=problem)
        count = plan.functions.count
        groups = range(0, count, ACCURACY.judged_together if plan.execute.fused else count)
        verdict = told([_judge(plan, bare, h, values, inside, first=first) for first in groups])
        # A value seen beyond zero is a fact: it is looked into at any step size. The doubt, which only
        # says that more may be hidden, can be answered by shorter steps alone.
        h_seen = verdict.place * h
        if plan.step_size.adaptive:
            jumps = verdict.jumps
            # Squared, because it falls with the fourth power of the step and the error with the eighth.
            # Where an event is located there is no room left, and no doubt either.
            doubt = jnp.where(lane.bracket.tries == 0, verdict.doubt, 0.0)
            error = jnp.maximum(error, doubt**2)
    return lane, Step(h, y1, dy1, error, values, kept, h_seen, jumps)


def _unit(plan: Plan, field, lane: Lane, h) -> list:
    """Meaning of an error of 1 in the stages of a step, whose end is not known: `scales` of its start.

    While nothing has moved, motion is as large as the slopes at both ends of Euler's step make it.
    """
    t, y, dy, size = jax.lax.stop_gradient((lane.t, lane.y, lane.dy, lane.size))
    size = y if size is None else size
    slopes = largest_magnitude(sizes(dy), field(t + h, shift(y, dy, h)))
    still = functools.reduce(jnp.logical_and, [jnp.all(a == 0.0) for a in jax.tree.leaves(size)])
    y1 = shift(y, slopes, jnp.where(still, h, 0.0))
    # Below rounding there is no share to be solved to.
    terms = jax.tree.map(lambda a: a / ACCURACY.root_share, cancelling(field, t, y))
    noise = plan.noise._replace(terms=terms)
    rule: Any = plan.step_size
    rtol = rule.rtol if rule.adaptive else ACCURACY.solved
    unit = scales(rtol, plan.atols, plan.kinds, noise, size, Ends(h, y, y1, dy, dy))
    return jax.lax.stop_gradient(unit)


@bookkeeping
def _follow_size(plan: Plan, size, y):
    return largest_magnitude(size, y)


@bookkeeping
def _scaled_error(plan: Plan, errors, surprise, noise, size, ends: Ends):
    rule: Any = plan.step_size  # an adaptive one: others estimate no error
    scale = scales(rule.rtol, plan.atols, plan.kinds, noise, size, ends)
    unseen, change = None, None
    if surprise is not None:
        unseen = largest_surprise(surprise, scale, ends, rule.rtol)
    if plan.watches_jumps:
        changes = jax.tree.map(lambda a, b: ends.h * (b - a), ends.dy0, ends.dy1)
        change = error_norm((changes,), scale)
    return error_norm(errors, scale), unseen, change


@bookkeeping
def _excess_of_step(plan: Plan, h, ends: Ends):
    return step_excess(plan.watched, h, plan.longest, ends, plan.stepper.order())


@bookkeeping
def _sudden_change(plan: Plan, lane: Lane, error, change):
    """Longest of the last steps, and the flag of one in which the field jumps.

    A field that jumps inside a step has an error in proportion to the length, whatever the order of
    the method, as large as what the jump makes of the step: attempts collapse onto it until it no
    longer matters. The motion is right, but its derivative by the time of the jump is lost. Of a field
    that is steep and resolved the error is a small part of its `change`, of a bend the change is small.
    """
    rule: Any = plan.step_size
    fits = (lane.status == RUNNING) & (lane.h > 0) & (lane.bracket.tries == 0) & (error <= 1.0)
    short = fits & (lane.h < 0.05 * lane.peak) & (error > 1e-3) & (change < 1e3)
    jumps = short & (rule.rtol * change * lane.peak > 1e-4 * lane.h)
    if plan.functions.roots:  # steps to and from where a field is known to be steep are short
        for i in range(plan.functions.num_guards - plan.functions.num_bends, plan.functions.num_guards):
            jumps = jumps & (jnp.abs(lane.values[i]) > 100.0 * lane.h * jnp.abs(lane.rates[i]))
    peak = jnp.where(fits, jnp.maximum(lane.h, ACCURACY.forgets * lane.peak), lane.peak)
    return peak, flags_with(lane.flags, flag(jumps, DISCONTINUOUS), lane.t + lane.h)


@piece
def _values_at(plan: Plan, mode, t, y, dy, size, *, problem) -> Values:
    system, args = problem
    # The magnitude of the motion includes the end of this step: a motion from rest has none before.
    size = largest_magnitude(size, jax.lax.stop_gradient(y)) if plan.functions.learned else None
    return plan.functions.evaluate(system, t, y, dy, mode, args, size)


@bookkeeping
def _look_inside(plan: Plan, lane: Lane, h, within: tuple, dy, *, problem):
    system, args = problem
    return look_inside(plan, system, lane, h, within, dy, args)


@bookkeeping
def _judge(plan: Plan, lane: Lane, h, values: Values, inside, *, first: int):
    last = first + ACCURACY.judged_together if plan.execute.fused else len(inside)
    return judge(plan, lane, h, values, inside, first, last)


@piece
def _with_stale(plan: Plan, lane: Lane, values: Values) -> Values:
    """Beyond zero by little: bends of a force that have no value, and no rate that would give them one.

    `where(maximum(x, 0) > 0, 1, 0)` compares 0 with 0 wherever `x` is negative. The bend at `x = 0` is
    located first, because this one jumps.
    """
    row, beyond = list(values.value), lane.bracket.beyond
    for i in range(len(row)):
        if plan.functions.is_bend(i):
            counts = jax.lax.stop_gradient(values.rate[i]) == 0.0
            if beyond is not None:
                counts = counts & ((lane.bracket.tries == 0) | (beyond == i))
            stale = jnp.where(counts, STALE, 0.0)
            unknown = jnp.isnan(jax.lax.stop_gradient(row[i]))
            row[i] = _with_slope_of(row[i], jnp.where(unknown, stale, row[i]))
    return values._replace(value=tuple(row))


@jax.custom_jvp
def _with_slope_of(margin: Any, value: Any) -> Any:
    """`value`, with the derivative of `margin`: a bend met to the last digit moves as others do."""
    return value


_with_slope_of.defjvp(lambda given, rates: (given[1], rates[0]))


@piece
def _rescale(plan: Plan, lane: Lane, values: Values) -> tuple[tuple, Values, Values]:
    """Magnitudes at the start of the step, values over them, and over those at its end to go on with.

    A guard is as large as its terms, and as it has been while the mode lasts: magnitudes do not fall,
    and hold still inside a step and while an event is located. Those of another mode, which a lane has
    right after an event, are replaced at once. A guard that begins at zero, as a speed does that has
    always been zero, or at the rounding of one that has just fired, is known as well as the time: for
    one step. Of one that does not change nothing tells its zero from the rounding of a number near 1.
    """
    stays, time = lane.fresh == 1.0, ACCURACY.part_of_slack * plan.noise.time
    used, kept = (), ()
    rows = zip(plan.functions.stated, lane.scales, *jax.lax.stop_gradient(values), strict=False)
    for i, (stated, scale, value, rate, terms) in enumerate(rows):
        if stated:
            used, kept = (*used, jnp.ones_like(value)), (*kept, jnp.ones_like(value))
            continue
        if plan.functions.is_bend(i):
            # A NaN counts for nothing: what has no slope or is stale here has a value elsewhere.
            value, rate, terms = (jnp.where(jnp.abs(a) < jnp.inf, a, 0.0) for a in (value, rate, terms))
        found = jnp.maximum(jnp.abs(value), terms)
        begun = jnp.abs(rate) * time
        unknown = (begun == 0.0) & (terms == 0.0) & (value < ACCURACY.some_roundings) & (value != 0.0)
        begun = jnp.where(unknown, 1.0, begun)
        begun = jnp.where(begun > found, -begun, found)
        used += (jnp.where(stays & (scale != 0.0), scale, begun),)
        kept += (jnp.where(stays, jnp.maximum(scale, found), begun),)

    def over(scales):
        return Values(over_magnitudes(values.value, scales), over_magnitudes(values.rate, scales), kept)

    return used, over(used), over(kept)
