"""From lines and speeds to a motion in time: look-ahead, trapezoids of speed, corners."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from stickslip.checks import (
    Given,
    Numeric,
    Row,
    as_parameter,
    check_finite,
    check_known,
    check_positive,
    check_type,
    numbers,
    one_number,
    refusal,
    shape_refusal,
)
from stickslip.control import InputShaper

from .._arguments import finite
from ._axis_shapers import AxisShapers


class Trajectory(eqx.Module):
    """A path in pieces of constant acceleration, `path(t, args) -> ((x, y), (vx, vy))`.

    - `times` [s]: when each piece begins, and when the last ends; it rests before and after.
    - `positions` [m], `velocities` [m/s], `accelerations` [m/s²] where each piece begins, `[piece, 2]`.

    As a system jumps at these times, hand them, and those of a shaper, to `stickslip.WithBreaks`:
    `trajectory.breaks(shaper)`.
    """

    times: Float[Array | np.ndarray, " border"]
    positions: Float[Array | np.ndarray, "piece 2"]
    velocities: Float[Array | np.ndarray, "piece 2"]
    accelerations: Float[Array | np.ndarray, "piece 2"]

    def __call__(self, t: Numeric, args: PyTree) -> tuple[Any, Any]:
        """Position [m] and velocity [m/s] at time `t` [s]."""
        times = jax.lax.stop_gradient(jnp.asarray(self.times))
        inside = jnp.clip(t, times[0], times[-1])
        piece = jnp.searchsorted(times, inside, side="right") - 1
        piece = jnp.clip(piece, 0, times.size - 2)
        since = inside - times[piece]
        place, speed, bend = (
            jnp.asarray(a)[piece] for a in (self.positions, self.velocities, self.accelerations)
        )
        x = place + since * (speed + 0.5 * since * bend)
        v = jnp.where(inside == t, speed + since * bend, 0.0)
        return (x[0], x[1]), (v[0], v[1])

    def travelled(self, t: Numeric) -> Any:
        """Way along the lines until time `t` [m], a number or one for each of several times."""
        (t,) = finite(t=t)
        t, times = jnp.asarray(t), jnp.asarray(self.times)
        first, rate = (
            jnp.asarray(jnp.hypot(*jnp.asarray(a).T)) for a in (self.velocities, self.accelerations)
        )
        ahead = jnp.sum(jnp.asarray(self.velocities) * jnp.asarray(self.accelerations), axis=1)
        # Pieces begin at rest, go on evenly, or speed up or slow down along their lines.
        rate = jnp.where(ahead < 0.0, -rate, rate)
        spans = jnp.diff(times)
        begin = jnp.concatenate([jnp.zeros(1), jnp.cumsum(spans * (first + 0.5 * rate * spans))])
        piece = jnp.clip(jnp.searchsorted(times, t, side="right") - 1, 0, spans.size - 1)
        since = jnp.clip(t - times[piece], 0.0, spans[piece])
        return begin[piece] + since * (first[piece] + 0.5 * rate[piece] * since)

    @property
    def duration(self) -> Any:
        """From the first piece to the end of the last [s]."""
        return self.times[-1] - self.times[0]

    def breaks(self, shaper: Given[InputShaper | AxisShapers | None] = None) -> Float[Array, " break"]:
        """Times at which the path jumps or bends [s], each once for every part of a shaper."""
        allowed = "an InputShaper, AxisShapers or None"
        check_type("shaper", shaper, InputShaper | AxisShapers | None, allowed)
        if shaper is None:
            return jnp.asarray(self.times)
        return jnp.sort((jnp.asarray(self.times)[:, None] + shaper.times[None, :]).ravel())


def trajectory(
    points: Given[Sequence[Any] | np.ndarray | Array],
    speeds: Given[Numeric | Row],
    *,
    acceleration: Numeric,
    corner_speed: Numeric,
    begin: Numeric = 0.0,
) -> Trajectory:
    r"""The fastest motion along straight lines with these limits, by looking ahead.

    Along a line the speed is a trapezoid. Between two lines that meet under the angle $\theta$ (180°
    straight on) it is not above $v$, at which the direction changes at once:

    $$v^2 = v_c^2(\sqrt2 - 1)\frac{\sin\frac\theta2}{1 - \sin\frac\theta2}, \qquad
      v^2 \le \tfrac12 a\,d\tan\tfrac\theta2$$

    with the corner speed $v_c$ of a right angle, the acceleration $a$ and the lengths $d$ of both
    lines; it begins and ends at rest. These are the rules of the firmware Klipper.

    **Arguments**

    - `points` [m]: `[point, 2]`, at least two; lines of no length are left out. `speeds` [m/s]: the
      greatest along each line, positive, one or one each.
    - `acceleration` [m/s²], `corner_speed` [m/s], positive; `begin` [s].

    **Returns** a `Trajectory`. **Raises** `TypeError`, `ValueError` naming the argument. It reads
    numbers and does not work under `jit`.
    """
    points = numbers("points", check_known("points", check_finite("points", points))).astype(np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
        raise shape_refusal("points", points, "of shape [point, 2], at least two points")
    speeds = numbers("speeds", check_known("speeds", check_positive("speeds", speeds))).astype(
        np.float64
    )
    if speeds.shape not in ((), (len(points) - 1,)):
        raise shape_refusal("speeds", speeds, f"one number, or one for each of {len(points) - 1} lines")
    a = float(check_known("acceleration", one_number("acceleration", acceleration, "positive")))
    corner = float(check_known("corner_speed", one_number("corner_speed", corner_speed, "positive")))
    corner = min(corner, 3e8)  # more limits nothing
    begin = float(check_known("begin", one_number("begin", begin)))
    lines = np.diff(points, axis=0)
    length = np.hypot(*lines.T)
    speeds = np.broadcast_to(speeds, length.shape)[length > 0.0]
    starts, lines, length = points[:-1][length > 0.0], lines[length > 0.0], length[length > 0.0]
    if not len(length):
        raise refusal("points", points, "points of which two are different")
    along = lines / length[:, None]
    border = _border_speeds(along, length, speeds, a, corner)
    rows = [
        row
        for i in range(len(length))
        for row in _trapezoid(starts[i], along[i], length[i], speeds[i], a, border[i], border[i + 1])
    ]
    spans, *parts = (as_parameter(np.array(part)) for part in zip(*rows, strict=True))
    return Trajectory(begin + np.concatenate([[0.0], np.cumsum(spans)]), *parts)


def _border_speeds(along: Any, length: Any, speeds: Any, a: float, corner: float) -> np.ndarray:
    """Speed at the beginning of each line, and 0 at the end of the last."""
    # Of the angle between two lines.
    cosine = -np.sum(along[:-1] * along[1:], axis=1)
    half, other = (np.sqrt(np.maximum(0.5 * (1.0 + s * cosine), 0.0)) for s in (-1.0, 1.0))
    straight = half > 1.0 - 1e-12
    by_corner = corner**2 * (2.0**0.5 - 1.0) * half / np.where(straight, 1.0, 1.0 - half)
    shorter = np.minimum(length[:-1], length[1:])
    by_length = 0.5 * a * shorter * half / np.where(straight, 1.0, other)
    squares = np.minimum(speeds[:-1], speeds[1:]) ** 2
    squares = np.where(straight, squares, np.minimum(squares, np.minimum(by_corner, by_length)))
    squares = np.concatenate([[0.0], squares, [0.0]])
    for i in range(len(length) - 1, -1, -1):
        squares[i] = min(squares[i], squares[i + 1] + 2.0 * a * length[i])
    for i in range(len(length)):
        squares[i + 1] = min(squares[i + 1], squares[i] + 2.0 * a * length[i])
    return np.sqrt(squares)


def _trapezoid(
    start: Any, along: Any, length: float, limit: float, a: float, first: float, last: float
) -> list[tuple]:
    """Pieces of one line: time, position, velocity, acceleration."""
    top = min(limit, np.sqrt(0.5 * (first**2 + last**2) + a * length))
    up, down = (max(top - v, 0.0) / a for v in (first, last))
    even = max(length - 0.5 * up * (first + top) - 0.5 * down * (top + last), 0.0) / top
    found, at = [], 0.0
    for span, v, rate in ((up, first, a), (even, top, 0.0), (down, top, -a)):
        # Of what rounding leaves of a part there is none.
        if span > 1e-12 * (up + even + down):
            found.append((span, start + at * along, v * along, rate * along))
        at += span * (v + 0.5 * rate * span)
    return found
