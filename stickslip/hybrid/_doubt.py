r"""Event functions under error control: is a step short enough to know them between its ends?

What the engine believes of an event function $g$ within a step is the cubic $p$ through its values and
exact rates at both ends. It is compared with $g$ itself at two interior points, where the state is
taken from the cubic through its own ends. With the largest mismatch $e$ and the room $g$ has (its
lowest value seen, or its size where it changes sign), the doubt is $3e/\mathrm{room}$: beyond 1, a
zero could hide between the points, and the step is tried again shorter by the rule that serves the
error of the state. For a function that is affine in time and state, $p$ is $g$ along the cubic of the
state and nothing is computed; see `_dependence.py`.

The two points are no multiples of a common fraction of the step, so that a step of whole periods does
not see the same phase three times.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._events import SLACK, EventFunctions, Values
from ._lane import Lane, Plan

POINTS = (0.3819660112501051, 0.7236067977499789)
CERTAIN = 3.0  # a mismatch of a third of the room is accepted
LARGEST = 1e4  # a doubt beyond this says no more than that the step is much too long
NOISE = 1e-13  # mismatches below this part of the values are rounding


class Inside(NamedTuple):
    """Event functions at the interior points: a value at each, or None for one without doubt."""

    values: tuple


def look_inside(
    functions: EventFunctions, system: Any, lane: Lane, t: Any, h: Any, y1: PyTree, dy1: PyTree,
    args: PyTree, scales: tuple,
) -> Inside:  # fmt: skip
    """Values at the interior points of the step from `t`, scaled like those at its ends."""
    rows = []
    for point in POINTS:
        y = jax.tree.map(
            lambda y0, s0, y1, s1, x=point: _cubic(x, y0, h * s0, y1, h * s1),
            lane.y, lane.dy, y1, dy1,
        )  # fmt: skip
        rows.append(functions.values(system, t + point * h, y, dy1, lane.mode, args, scales))
    columns = zip(functions.doubtful, *rows, strict=True)
    return Inside(tuple(tuple(column) if doubtful else None for doubtful, *column in columns))


def _cubic(x: float, start: Any, start_rise: Any, end: Any, end_rise: Any) -> Any:
    """Cubic at the fraction `x` of a step through the values at its ends; rises: slopes times length.

    What is constant stays so to the last bit: a component may be the number of a piece.
    """
    rest = 1.0 - x
    middle = start + x * x * (3.0 - 2.0 * x) * (end - start)
    return middle + x * rest * (rest * start_rise - x * end_rise)


def doubt(plan: Plan, lane: Lane, h: Any, values: Values, inside: Inside) -> tuple[Any, Any]:
    """Largest doubt of all event functions, and whether one jumps in a step too short to be cut.

    A jump keeps its mismatch however short the step, and so does, next to a zero, a kink. Below
    `plan.resolution` the step is taken as it is.
    """
    functions = plan.functions
    worst, jumps = jnp.zeros_like(h), jnp.zeros_like(h) > 0
    short = h <= plan.resolution
    for i, seen in enumerate(inside.values):
        if seen is None:
            continue
        # The sign of the start for all: of a section both halves of an excursion count.
        start = lane.values[i]
        sign = functions.sign(i, start) if i < functions.num_guards else jnp.sign(start)
        v0, r0 = sign * start, sign * lane.rates[i]
        v1, r1 = sign * values.value[i], sign * values.rate[i]
        # A function that falls at the start may go through zero before the first point; one that has
        # just fired starts at zero and rises.
        low = jnp.where(r0 < 0, jnp.minimum(v0, v1), v1)
        mismatch, size = jnp.zeros_like(h), jnp.maximum(jnp.abs(v0), jnp.abs(v1))
        for point, value in zip(POINTS, seen, strict=True):
            value = sign * value
            believed = _cubic(point, v0, h * r0, v1, h * r1)
            mismatch = jnp.maximum(mismatch, jnp.abs(value - believed))
            low, size = jnp.minimum(low, value), jnp.maximum(size, jnp.abs(value))
        rounding = NOISE * size
        # Of an affine function the mismatch is rounding, and at zero room it would still be a doubt.
        mismatch = jnp.where(mismatch <= rounding, 0.0, mismatch)
        # Where the function ends beyond zero its crossing is found anyway: only its size counts.
        room = jnp.where(v1 < 0, jnp.maximum(jnp.abs(v0), jnp.abs(v1)), low)
        # An excursion that was seen is looked into at once, by its place and not by its doubt.
        seen_below = (low < -SLACK) & (v1 >= 0)
        found = jnp.where(
            (mismatch > 0) & ~seen_below,
            jnp.minimum(CERTAIN * mismatch / jnp.maximum(room, 1e-300), LARGEST),
            0.0,
        )
        worst = jnp.maximum(worst, found)
        # What is smooth changes by its slope times the length; a jump does not know of the length.
        slopes = (jnp.abs(r0) + jnp.abs(r1)) * h
        jumps = jumps | (short & (mismatch > 2.0 * slopes + 1e-9 * size))
    return jnp.where(short, 0.0, worst), jumps


def first_below(functions: EventFunctions, lane: Lane, inside: Inside, values: Values, h: Any) -> Any:
    """Where a doubtful event function was first seen beyond zero and back again; 0 if nowhere.

    One that stays beyond to the end of the step crosses in it, which is found without a look: to look
    there first would cut a step that begins on the zero again and again.
    """
    place = jnp.zeros_like(h)
    for i, seen in enumerate(inside.values):
        if seen is None:
            continue
        start = lane.values[i]
        sign = functions.sign(i, start) if i < functions.num_guards else jnp.sign(start)
        back = sign * values.value[i] >= 0
        for point, value in reversed(list(zip(POINTS, seen, strict=True))):
            beyond = sign * value < -SLACK
            here = (sign * start > 0) & beyond & back
            first = (place == 0) | (point * h < place)
            place = jnp.where(here & first, point * h, place)
            back = back | ~beyond
    return place
