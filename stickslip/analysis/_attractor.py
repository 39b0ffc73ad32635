"""The attractor by a finite sequence of points: its period, and whether it is reached."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._types import Given, Numeric, Whole
from .._validation import (
    MOST,
    check_count,
    is_concrete,
    numbers,
    one_number,
    one_static,
    refusal,
    shape_refusal,
    whole_number,
)
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY

# Meanings of `period`, by number in `period_status`. Only "repeats" and "none" are measurements.
PERIOD_STATUS = (
    "repeats",
    "none",
    "lane_failed",
    "too_few_points",
    "not_finite",
    "not_settled",
    "constant",
    "zero_on_section",
    "below_rounding",
)
CANNOT_TELL = -1  # `period` where the points do not say


class Verdict(NamedTuple):
    """Outcome of `period_of`.

    - `period`: points after which the sequence repeats; 0 if it does so after none up to the largest
      that was looked for; -1 if that is unknown.
    - `status`: why, an index into `PERIOD_STATUS`.
    - `slow`: whether the first points are not yet those of the attractor.
    """

    period: Int[Array, ""]
    status: Int[Array, ""]
    slow: Bool[Array, ""]


def points_needed(period: int) -> int:
    """Points without which nothing is said on this period: two rounds, and 3 points compared."""
    return max(2 * period, period + 3)


def period_of(
    points: Given[Float[Array, "point observable"]],
    count: Whole,
    span: Given[Float[Array, "2 observable"]],
    *,
    tolerance: Numeric,
    max_period: int,
    start: Given[Float[Array, " observable"]] | None = None,
    periods: Given[Sequence[float | None] | None] = None,
) -> Verdict:
    r"""Period of a sequence of points, or the reason why it is unknown.

    **Arguments**

    - `points`: what was observed at each crossing. Rows from `count` on are ignored.
    - `span`: least and greatest value of each observable along the whole motion, not only on the
      section. Their difference is the size that `tolerance` refers to, so that neither the origin
      nor the unit of an observable matters, nor that it vanishes on the section. The points are
      counted in.
    - `start`: value of each observable before the transient: a motion smaller than the rounding of
      where it came from is a rest.

    - `periods`: of each observable its own period, as of an angle, or None; whole turns then count as
      no difference, where the motion goes round.

    The period is the smallest $p$ for which the last points repeat: over the last quarter of the
    points, at least over $p$ and over 3 of them, and the round before, each point differs by at most
    `tolerance` times the size from the one of the last round that is a multiple of $p$ later. That
    takes $\max(2p, p + 3)$ points: 4 for period one, and 32 for `max_period = 16`, the least for which
    "none" is said.

    The status, an index into `PERIOD_STATUS`, is

    - `repeats`: `period` is the period;
    - `none` (period 0): the points repeat after none of 1 to `max_period`.

    In all other cases the period is -1:

    - `too_few_points`: none was found, and there are too few points to exclude `max_period`;
    - `not_finite`: a point or `span` is NaN or infinite;
    - `not_settled`: none was found while the points still approach something, or creep;
    - `constant`: no observable moves beyond rounding: a rest, or observables that show nothing;
    - `zero_on_section`: all that move are zero at every crossing, to a part in 1e9 of their size,
      as a speed is at the maxima of its position: that they repeat means nothing;
    - `below_rounding`: an observable is so small a motion about so large a value that `tolerance`
      lies below its rounding.

    (`lane_failed` is for the caller.) `slow` is true if for some $p$ the points $p$ apart differed by
    more than the tolerance over the first quarter, and by less than a tenth of that over the last: the
    points of the first quarter are then not those of the attractor, and more time should be dropped.

    Errors: `ValueError`, `TypeError` for arguments of another kind or shape. Points may be NaN, which
    is an outcome.
    """
    points, span = _columns("points", points), _columns("span", span)
    if span.shape != (2, points.shape[1]):
        raise shape_refusal("span", span, f"of the shape {(2, points.shape[1])}")
    count = jnp.asarray(whole_number("count", count, 0, MOST))
    one_number("tolerance", tolerance, "positive")
    check_count("max_period", max_period, 1)
    if start is not None:
        start = jnp.asarray(_numbers("start", start))
        if start.shape != points.shape[1:]:
            raise shape_refusal("start", start, f"of the shape {points.shape[1:]}")
    turns = _periods(periods, points.shape[1])
    room = points.shape[0]
    quarter = jnp.maximum(count // 4, 3)
    # Counted from the end: row 0 is the last point.
    index = jnp.arange(room, dtype=count.dtype)
    valid = index < count
    latest = jnp.take(points, jnp.clip(count - 1 - index, 0, room - 1), axis=0)
    finite = jnp.all(jnp.isfinite(latest) | ~valid[:, None]) & jnp.all(jnp.isfinite(span))
    latest = jnp.where(valid[:, None], latest, latest[:1])
    low = jnp.minimum(span[0], jnp.min(latest, axis=0))
    high = jnp.maximum(span[1], jnp.max(latest, axis=0))
    rounding = ENGINE.some_roundings * jnp.maximum(jnp.abs(low), jnp.abs(high))
    largest = jnp.maximum(jnp.abs(low), jnp.abs(high))
    for k, turn in enumerate(turns):
        if turn is not None:
            goes_round = high[k] - low[k] >= turn
            cut = _widest_gap(latest[:, k], turn)
            inside = jnp.mod(latest[:, k] - cut, turn) + cut
            latest = latest.at[:, k].set(jnp.where(goes_round, inside, latest[:, k]))
            low = low.at[k].set(jnp.where(goes_round, cut, low[k]))
            high = high.at[k].set(jnp.where(goes_round, cut + turn, high[k]))
    size = high - low
    if start is not None:
        largest = jnp.maximum(largest, jnp.where(jnp.isfinite(start), jnp.abs(start), 0.0))
    moves = size > ENGINE.some_roundings * largest
    resolved = tolerance * size >= rounding
    # A fixed point repeats anyhow.
    scaled = (latest - low[None, :]) / jnp.where(moves, size, jnp.inf)[None, :]
    tells = moves & (jnp.max(jnp.abs(latest), axis=0) > ENGINE.zero * size)

    def is_repeated(p):
        repeats = _away_from_last_round(scaled, jnp.maximum(quarter, p) + p, p) <= tolerance
        enough = count >= jnp.maximum(2 * p, p + 3)
        return enough & repeats, *_approach(scaled, count, quarter, p, tolerance)

    # All at once in one piece of program: unrolled it took a second to compile.
    tried = jnp.arange(1, max(min(max_period, room // 2), 1) + 1, dtype=count.dtype)
    repeats, shrunk, still = jax.vmap(is_repeated)(tried)
    period = jnp.where(jnp.any(repeats), tried[jnp.argmax(repeats)], 0)
    slow = jnp.any(shrunk)
    creeps = jnp.any(still) | _draws_together(scaled, count)
    found = period > 0

    status = jnp.where(found, PERIOD_STATUS.index("repeats"), PERIOD_STATUS.index("none"))
    for name, applies in (
        ("not_settled", ~found & (slow | creeps)),
        ("too_few_points", ~found & (count < points_needed(max_period))),
        ("below_rounding", jnp.any(moves & ~resolved)),
        ("zero_on_section", ~jnp.any(tells)),
        ("constant", ~jnp.any(moves)),
        ("too_few_points", count < points_needed(1)),
        ("not_finite", ~finite),
    ):
        status = jnp.where(applies, PERIOD_STATUS.index(name), status)
    told = status <= PERIOD_STATUS.index("none")
    period = jnp.where(told, period, CANNOT_TELL)
    return Verdict(period.astype(jnp.int32), status.astype(jnp.int32), slow & finite)


def _periods(periods: Any, count: int) -> tuple[float | None, ...]:
    """A period or None for each observable."""
    if periods is None:
        return (None,) * count
    if not isinstance(periods, tuple | list):
        raise refusal("periods", periods, "a sequence of positive numbers or None, or None", TypeError)
    if len(periods) != count:
        raise shape_refusal("periods", tuple(periods), f"{count} of them, one for each observable")
    return tuple(
        None if p is None else float(one_static(f"periods[{i}]", p, "positive"))
        for i, p in enumerate(periods)
    )


def _widest_gap(values: Any, period: float) -> Any:
    """Where on the circle none of the values is near: there it is cut open."""
    found = jnp.sort(jnp.mod(values, period))
    gaps = jnp.append(found[1:], found[0] + period) - found
    at = jnp.argmax(gaps)
    return found[at] + 0.5 * gaps[at]


def _columns(name: str, values: Any) -> Any:
    """A table of numbers, a column for each observable; NaN is allowed."""
    values = _numbers(name, values)
    if values.ndim != 2:
        raise shape_refusal(name, values, "a table, a column for each observable")
    return values


def _numbers(name: str, values: Any) -> Any:
    return jnp.asarray(numbers(name, values), jnp.float64) if is_concrete(values) else values


def _away_from_last_round(scaled, window, p):
    """Largest distance of the last `window` points from those of the last round of `p`."""
    index = jnp.arange(scaled.shape[0], dtype=window.dtype)
    away = jnp.max(jnp.abs(scaled - scaled[index % p]), axis=1)
    return jnp.max(jnp.where(index < window, away, 0.0))


def _draws_together(scaled, count):
    """Whether the range of the points shrinks from quarter to quarter, as on a spiral."""
    index = jnp.arange(scaled.shape[0], dtype=count.dtype)[:, None]
    part, ranges = jnp.maximum(count // 4, 1), []
    for k in range(4):
        used = (index >= k * part) & (index < (k + 1) * part)
        top = jnp.max(jnp.where(used, scaled, -jnp.inf), axis=0)
        ranges.append(jnp.max(top - jnp.min(jnp.where(used, scaled, jnp.inf), axis=0)))
    shrinks = jnp.stack([ranges[k] < 0.9 * ranges[k + 1] for k in range(3)]).all()
    return (count >= 32) & shrinks


def _approach(scaled, count, quarter, p, tolerance):
    """Whether points `p` apart have come together tenfold; whether they are still on their way.

    On their way they come closer from quarter to quarter, or go on in one direction all through the
    second half, while a step is small against the motion. A quasi-periodic motion that has not yet
    gone round creeps too: the record is too short to distinguish it from an approach.
    """
    room = scaled.shape[0]
    index = jnp.arange(room, dtype=count.dtype)
    step = scaled - scaled[jnp.minimum(index + p, room - 1)]  # counted from the end, like the points
    compared = index < count - p
    gap = jnp.max(jnp.abs(step), axis=1)

    def largest(rows):
        return jnp.max(jnp.where(compared & rows, gap, 0.0))

    last = largest(index < jnp.maximum(quarter, p))
    first = largest(index >= count - p - quarter)
    long_enough = (count >= 4 * p) & (count >= 12)
    shrunk = long_enough & (first > tolerance) & (last < 0.1 * first)

    part = jnp.maximum((count - p) // 4, 1)
    parts = [largest((index >= k * part) & (index < (k + 1) * part)) for k in range(4)]
    smaller = jnp.stack([parts[k] < 0.97 * parts[k + 1] for k in range(3)]).all()
    near = (parts[3] < ACCURACY.small) & (parts[0] > 0)
    half = compared & (index < (count - p + 1) // 2)
    # From round to round, not from point to point: an approach may alternate.
    before = step[jnp.minimum(index + p, room - 1)]
    pair = (half & (index < count - 2 * p))[:, None]
    one_way = jnp.all((step * before >= 0) | ~pair) & (largest(half) < ACCURACY.small) & jnp.any(pair)
    return shrunk, long_enough & (count >= p + 12) & ((smaller & near) | one_way)
