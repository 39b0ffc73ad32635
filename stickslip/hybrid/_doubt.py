r"""Event functions under error control: is a step short enough to know them between its ends?

The engine takes an event function $g$ within a step for the cubic $p$ through its values and
exact rates at both ends. It is compared with $g$ itself at two interior points, where the method gives
the state to a higher order (`_within.py`). With the largest mismatch $e$ and the room $g$ has (its
lowest value seen, or its size where it changes sign), the doubt is $3e/\mathrm{room}$: beyond 1, a zero
could hide between the points, and the step is tried again shorter by the rule that serves the error of
the state. Where a value is seen beyond zero, or the cubic less its mismatch goes there between the
points, the step is tried again up to that place.

The two points are not multiples of a common fraction of the step, so that a step of whole periods does
not see the same phase three times.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ._loop_state import Lane, Plan
from .accuracy import ACCURACY
from .event_functions import EventFunctions, Values
from .tree import cubic

NO_JUMP = ACCURACY.slack / ACCURACY.rounding


class Verdict(NamedTuple):
    """Result of the looks inside a step."""

    doubt: Any  # largest of all event functions; `place` does not say where
    place: Any  # fraction of the step at which one is or may be beyond zero, and back; 0 if nowhere
    jumps: Any  # whether one jumps in a step too short to be cut


JUMPS = 4.0 * ACCURACY.most


class _Course(NamedTuple):
    """An event function over the step, in the sign that makes it positive at the start."""

    v0: Any
    rise0: Any  # rate times the length of the step
    v1: Any
    rise1: Any
    seen: tuple  # at the interior points


def look_inside(
    plan: Plan, system: Any, lane: Lane, h: Any, states: tuple, dy: Any, args: Any
) -> tuple[tuple, ...]:
    """Values of the event functions in the `states` at the interior points; none of those not asked."""
    rows = [
        plan.functions.values(system, lane.t + point * h, y, dy, lane.mode, args, lane.scales)
        for point, y in zip(ACCURACY.points_inside, states, strict=True)
    ]
    columns = zip(plan.looked_at_inside, *rows, strict=True)
    return tuple(tuple(column) if looked else () for looked, *column in columns)


def judge(
    plan: Plan, lane: Lane, h: Any, values: Values, inside: tuple[tuple, ...], first: int, last: int
) -> Any:
    """The verdict on the step, as one number, by the functions `first` to before `last`; see `told`.

    A jump keeps its mismatch however short the step, and so does, next to a zero, a kink. Below
    `plan.resolution` the step is taken as it is.
    """
    looked = [i for i in range(first, min(last, len(inside))) if inside[i]]
    if not looked:
        return jnp.zeros_like(h)
    functions = plan.functions
    courses = [_course(functions, i, lane, values, inside[i], h) for i in looked]
    roundings = [ACCURACY.rounding if i < functions.num_guards else 0.0 for i in looked]
    short = h <= plan.resolution
    instant = ACCURACY.rounding * plan.noise.time / jnp.maximum(h, plan.resolution)
    sections = [i >= functions.num_guards for i in looked]
    if plan.execute.fused or len(looked) <= ACCURACY.judged_together:
        ones = zip(courses, roundings, sections, strict=True)
        found = [_look_inside(*of_one, instant, short) for of_one in ones]
    else:
        # One small program for all of them.
        course = jax.tree.map(lambda *rows: jnp.stack(rows), *courses)
        some = jnp.asarray(sections) if any(sections) else False
        columns = _look_inside(course, jnp.asarray(roundings), some, instant, short)
        found = [_Looked(*(column[k] for column in columns)) for k in range(len(looked))]
    return _verdict(found, short)


class _Looked(NamedTuple):
    mismatch: Any
    room: Any
    place: Any
    jumps: Any


def _look_inside(course: _Course, rounding: Any, section: Any, instant: Any, short: Any) -> _Looked:
    # A smooth function changes by its slope times the length; a jump does not know of the length. Next
    # to zero the terms of a guard cancel, and what is left of their rounding is not a jump.
    slopes = jnp.abs(course.rise0) + jnp.abs(course.rise1)
    mismatch, size = _mismatch(course, rounding + instant * slopes)
    jumps = mismatch > 2.0 * slopes + 1e-9 * size + NO_JUMP * rounding
    # A section has no magnitude but its own values.
    slack = ACCURACY.slack if section is False else ACCURACY.slack * jnp.where(section, size, 1.0)
    return _Looked(mismatch, _room(course), _beyond(course, mismatch, section, slack, short), jumps)


def _verdict(found: list[_Looked], short: Any) -> Any:
    worst, room, place, jumps = found[0]
    for other in found[1:]:
        sooner = (other.place > 0) & ((place == 0) | (other.place < place))
        place = jnp.where(sooner, other.place, place)
        # The largest of the ratios, with one division for all.
        larger = other.mismatch * room > worst * other.room
        worst = jnp.where(larger, other.mismatch, worst)
        room = jnp.where(larger, other.room, room)
        jumps = jumps | other.jumps
    doubt = jnp.minimum(ACCURACY.doubt_certain * worst / room, ACCURACY.most)
    doubt = jnp.where(short, jnp.where(jumps, JUMPS, 0.0), doubt)
    return jnp.where(place > 0, -place, doubt)


def told(verdicts: list) -> Verdict:
    """The parts of the numbers that `judge` gives, all together."""
    verdict = verdicts[0]
    for other in verdicts[1:]:
        # Places are negative, the nearest one the largest of them, and come before any doubt.
        lower, higher = jnp.minimum(verdict, other), jnp.maximum(verdict, other)
        verdict = jnp.where((lower < 0) & (higher >= 0), lower, higher)
    jumps = verdict == JUMPS
    doubt = jnp.where(jumps, 0.0, jnp.maximum(verdict, 0.0))
    return Verdict(doubt, jnp.maximum(-verdict, 0.0), jumps)


def _course(
    functions: EventFunctions, i: int, lane: Lane, values: Values, seen: tuple, h: Any
) -> _Course:
    start, rate = lane.values[i], lane.rates[i]
    # The sign of the start for all: of a section both halves of an excursion count. A guard that has
    # just fired starts at zero, and has the sign it goes to.
    side = jnp.where(start == 0, rate, start)
    sign = functions.sign(i, side) if i < functions.num_guards else jnp.sign(side)
    return _Course(
        sign * start, sign * rate * h, sign * values.value[i], sign * values.rate[i] * h,
        tuple(sign * value for value in seen),
    )  # fmt: skip


def _mismatch(course: _Course, rounding: Any) -> tuple[Any, Any]:
    """Largest difference between the function and its cubic, and the largest of its values."""
    v0, a, v1, b, seen = course
    mismatch, size = jnp.zeros_like(v0), jnp.maximum(jnp.abs(v0), jnp.abs(v1))
    for point, value in zip(ACCURACY.points_inside, seen, strict=True):
        mismatch = jnp.maximum(mismatch, jnp.abs(value - cubic(point, v0, a, v1, b)))
        size = jnp.maximum(size, jnp.abs(value))
    # Of a straight line the mismatch is rounding, and at zero room it would still be a doubt. Rounding
    # of the time is rounding of what changes with it.
    return jnp.where(mismatch <= ACCURACY.value_rounding * size + rounding, 0.0, mismatch), size


def _room(course: _Course) -> Any:
    """How far the function keeps from zero."""
    v0, a, v1, _, seen = course
    # One that falls at the start may go through zero before the first point; one that has just fired
    # starts at zero and rises.
    low = jnp.where(a < 0, jnp.minimum(v0, v1), v1)
    for value in seen:
        low = jnp.minimum(low, value)
    # Where it ends beyond zero its crossing is found anyway: only its size counts.
    room = jnp.where(v1 < 0, jnp.maximum(jnp.abs(v0), jnp.abs(v1)), low)
    return jnp.maximum(room, 1e-150)


def _beyond(course: _Course, mismatch: Any, section: Any, slack: Any, short: Any) -> Any:
    """Where the function is first seen, or may be, beyond zero and back again; 0 if nowhere.

    One that stays beyond to the end of the step crosses in it, which is found without a look: to look
    there first would cut a step that begins on the zero again and again. One that ends on zero was
    located there: of several zeros it may be the last. Those of a section are located after the run,
    one in each step: a step that may hold three is cut at once.
    """
    v0, a, v1, b, seen = course
    # Bernstein coefficients of the cubic less a parabola of one and a half times the mismatch, which
    # leaves the ends as they are. The cubic has no zero inside if all are positive, nor if it has no
    # three real zeros.
    b1, b2 = v0 + a / 3.0 - 2.0 * mismatch, v1 - b / 3.0 - 2.0 * mismatch
    left, middle, right = v0 * b2 - b1 * b1, v0 * v1 - b1 * b2, b1 * v1 - b2 * b2
    dips = (jnp.minimum(b1, b2) < -slack) & (4.0 * left * right > middle * middle)
    begins = (v0 > 0) | ((v0 >= -slack) & (a > 0))
    back = (v1 >= 0) | (v1 >= ACCURACY.reach * b)
    cut = dips & back
    if section is not False:
        # Three zeros of the cubic need coefficients of changing sign, and three it may have.
        cut = cut | (section & (v1 < 0) & (b1 < -slack) & (b2 + 4.0 * mismatch > slack))
    place = jnp.where(cut & ~short, ACCURACY.points_inside[0], 0.0)
    for point, value in reversed(list(zip(ACCURACY.points_inside, seen, strict=True))):
        beyond = value < -slack
        place = jnp.where(beyond & back, point, place)
        back = back | ~beyond
    return jnp.where(begins, place, 0.0)
