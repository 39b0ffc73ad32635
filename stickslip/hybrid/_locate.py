"""Event location as step-size control: the next step length inside a bracket around a zero.

No nested root search: a lane whose event function changed sign in its attempt keeps its state, and
its next attempt is a shorter step. The bracket holds, for the step lengths `low < high`, the value
of the event function there (positive at `low`, negative at `high`) and its rate of change.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from .accuracy import ACCURACY


class Bracket(NamedTuple):
    """Step lengths around the zero, with values and rates; all scalars."""

    low: Any
    high: Any
    value_low: Any
    value_high: Any
    rate_low: Any
    rate_high: Any
    tries: Any  # attempts inside this bracket, signed by the side that moved last; 0: no bracket
    beyond: Any = None  # which of several functions is beyond its zero at `high`


def empty(like: Any, beyond: Any = None) -> Bracket:
    """No bracket."""
    zero = jnp.zeros_like(like)
    return Bracket(zero, zero, zero, zero, zero, zero, zero, beyond)


def update(
    b: Bracket, shrink: Any, h: Any, value: Any, rate: Any, value_start: Any, rate_start: Any,
    index: Any = None,
) -> Bracket:  # fmt: skip
    """Bracket after an attempt of length `h` that ended at `value` with slope `rate`.

    A new bracket starts at length zero with the value and rate at the start of the step. The value
    at an end that stays twice in a row is halved (Illinois), which keeps the secant from stalling.
    Where not `shrink`, the bracket is closed. `index`: of the function, where there are several.
    """
    # The sign of `tries` is the end that moved last, so that one number says both things.
    new = b.tries == 0.0
    negative = new | (value < 0)
    value_low = jnp.where(new, value_start, jnp.where(b.tries > 0, 0.5, 1.0) * b.value_low)
    value_high = jnp.where(b.tries < 0, 0.5, 1.0) * b.value_high
    count = jnp.abs(b.tries) + 1.0
    beyond = b.beyond
    if beyond is not None:
        beyond = jnp.where(shrink, jnp.where(negative, index, beyond), -1)
    return Bracket(
        low=jnp.where(negative, jnp.where(new, 0.0, b.low), h),
        high=jnp.where(negative, h, b.high),
        value_low=jnp.where(negative, value_low, value),
        value_high=jnp.where(negative, value, value_high),
        rate_low=jnp.where(negative, jnp.where(new, rate_start, b.rate_low), rate),
        rate_high=jnp.where(negative, rate, b.rate_high),
        tries=jnp.where(shrink, jnp.where(negative, count, -count), 0.0),
        beyond=beyond,
    )


def is_collapsed(b: Bracket, t: Any, full: Any) -> Any:
    """Whether the ends of the bracket are the same time to rounding; `t` is the start of the step.

    Or to what is located of a step of length `full`, where no attempt ended before the zero: what
    leaves zero at the start without a slope, as the square of a speed at rest, is halved for ever.
    """
    told = 4e-16 * jnp.maximum(jnp.abs(t), b.high)
    return b.high - b.low <= jnp.where(b.low == 0.0, jnp.maximum(told, ACCURACY.solved * full), told)


def propose(b: Bracket, full: Any, t: Any) -> Any:
    """Next step length: inverse cubic Hermite if both rates fall, else Illinois, else the middle.

    A bracket that has collapsed around a jump is left by its far end.

    The inverse Hermite polynomial `h(g)` through both ends with their rates has error of fourth order
    in the width of the bracket and needs no iteration. Where the guard starts at zero and rises, the
    zero at the start is not the one sought: take the other zero of the parabola through the start,
    its rate and the far end. Where it starts at zero and falls, the event is at the start of the step.
    """
    width = b.high - b.low
    drop = b.value_high - b.value_low  # negative
    # The place of the zero if the function were linear, from either end.
    u = b.value_low / jnp.where(drop < 0, -drop, 1.0)
    v = 1.0 - u
    falls = (b.rate_low < 0) & (b.rate_high < 0)
    # Both divisions by a rate in one: vector divisions are what this function costs.
    product = jnp.where(falls, b.rate_low * b.rate_high, 1.0)
    bend = u * v * drop * (v * b.rate_high - u * b.rate_low) / product
    linear = v * v * (1.0 + 2.0 * u) * b.low + u * u * (1.0 + 2.0 * v) * b.high
    hermite = linear + bend
    secant = b.low + u * width
    # Outside of the bracket an interpolation has seen another zero, or none.
    inside_hermite = falls & (hermite > b.low) & (hermite < b.high)
    inside_secant = (secant > b.low) & (secant < b.high)
    tries = jnp.abs(b.tries)
    at_first = b.low == 0.0
    # A guard that has just fired starts at zero: every interpolation would find that zero again. One
    # that leaves zero without a slope, as a block whose friction is just overcome, may fall by
    # rounding.
    level = (b.rate_low <= 0) & (-b.rate_low <= ACCURACY.zero * jnp.abs(b.rate_high))
    resting = at_first & ((b.rate_low >= 0) | level) & (b.value_low <= 1e-12)
    forced = (tries >= ACCURACY.bisect_every) & (jnp.floor(tries * 0.5) * 2.0 == tries)
    rise = b.rate_low * b.high
    hop = rise - b.value_high
    leap = rise * b.high / jnp.where(resting & (hop > 0), hop, 1.0)
    hops = (hop > 0) & (b.rate_low > 0)
    halve = forced | ~(inside_hermite | inside_secant | resting) | (resting & ~hops)
    guess = jnp.where(inside_hermite, hermite, secant)
    guess = jnp.where(resting, leap, guess)
    guess = jnp.where(halve, b.low + 0.5 * width, guess)
    # Falling, and so near zero at the start that the Newton correction reaches it: the event is there.
    at_start = (
        at_first & (b.rate_low < 0) & ~level & (b.value_low <= -ACCURACY.solved * full * b.rate_low)
    )
    guess = jnp.where(at_start, 0.0, guess)
    return jnp.where(is_collapsed(b, t, full) & (b.tries != 0), b.high, guess)


def begins_inside(value0: Any, rate0: Any, rate: Any) -> Any:
    """Whether a function that crosses downwards begins a step above zero, or on it and rises.

    A guard that rests on zero has a slope of rounding beside that of its end, and does not.
    """
    return (value0 > 0) | ((value0 == 0) & (rate0 > ACCURACY.zero * jnp.abs(rate)))


def dip(value0: Any, rate0: Any, value1: Any, rate1: Any, h: Any) -> tuple[Any, Any]:
    """Whether a function positive at both ends may be negative in between, and where to look.

    It falls at the start and rises at the end, and its two tangents meet below zero. A function that
    is convex over the step (one bend) cannot go below zero unless they do, so that none of its
    excursions is missed; the place to look is where the linearly interpolated rate is zero.
    """
    below = rate0 * (value1 - rate1 * h) > rate1 * value0
    dips = (rate0 < 0) & (rate1 > 0) & (value0 > 0) & (value1 > 0) & below
    where = h * rate0 / (rate0 - rate1)  # infinite, or NaN, only where it does not dip
    # Not too near an end, where the look would cost a step and show what is known.
    return dips, jnp.clip(where, 0.1 * h, 0.9 * h)
