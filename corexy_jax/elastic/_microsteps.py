"""A path as the driver of a stepper has it: in microsteps."""

from collections.abc import Callable
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np

from stickslip.checks import (
    Given,
    Numeric,
    Row,
    as_parameter,
    check_callable,
    check_finite,
    check_increasing,
    check_known,
    numbers,
    one_number,
    one_row,
    refusal,
    shape_refusal,
    whole_number,
)

from ._trajectory import Trajectory


def microsteps(
    path: Given[Callable],
    breaks: Row,
    r: Numeric,
    *,
    division: int = 16,
    steps: int = 200,
) -> Trajectory:
    r"""The same path with both motors commanded to the nearest microstep.

    $$\theta_i^c = q\left\lfloor\frac{\theta_i}q + \frac12\right\rfloor, \qquad
      q = \frac{2\pi}{\mathrm{division}\cdot\mathrm{steps}}, \qquad
      r\theta_1 = x + y,\ r\theta_2 = x - y$$

    It rests between the steps and jumps at times that are found exactly, as pieces of a `Trajectory`
    whose speeds are 0: hand its `breaks()` to `stickslip.WithBreaks`.

    **Arguments**

    - `path(t, args) -> ((x, y), (vx, vy))` [m]: quadratic in time between its `breaks` [s], a row that
      does not decrease, and at rest before and after; such as a `Trajectory`, and a shaper of it with
      `trajectory.breaks(shaper)`.
    - `r` [m]: radius of the pulleys, positive. `division`: microsteps in a full step, of which
      `steps` are a turn.

    **Returns** a `Trajectory`. **Raises** `TypeError`, `ValueError` naming the argument, also for a
    path that is not quadratic between two breaks. It reads numbers and does not work under `jit`.
    """
    check_callable("path", path, "path(t, args)", 0.0, None)
    row = check_known("breaks", one_row("breaks", check_finite("breaks", breaks)))
    times = numbers("breaks", row).astype(np.float64)
    times = np.unique(check_increasing("breaks", times, equal=True))
    if times.size < 2:
        raise shape_refusal("breaks", breaks, "at least two different times")
    radius = float(check_known("r", one_number("r", r, "positive")))
    turn = whole_number("division", division, 1, 4096) * whole_number("steps", steps, 4, 40_000)
    quantum = 2.0 * np.pi * radius / turn

    @jax.jit
    @jax.vmap
    def in_steps(t):
        try:
            (x, y), _ = path(t, None)
        except TypeError:
            allowed = "a function that returns ((x, y), (vx, vy))"
            raise refusal("path", path, allowed, TypeError) from None
        return jnp.stack([x + y, x - y]) / quantum

    span = np.diff(times)
    at, quarter, half = (np.asarray(in_steps(jnp.asarray(t))).T for t in (
        times, times[:-1] + 0.25 * span, times[:-1] + 0.5 * span,
    ))  # fmt: skip
    # Of the quadratic u + v s + w s² in 0 <= s <= 1, through both ends and the middle.
    first, last = at[:, :-1], at[:, 1:]
    w = 2.0 * (first + last - 2.0 * half)
    v = last - first - w
    off = np.abs(first + 0.25 * v + 0.0625 * w - quarter)
    if not off.max() <= 1e-6 * (1.0 + np.abs(at).max()):
        raise refusal("path", path, "quadratic in time between its breaks")
    events = [(times[0], motor, np.floor(at[motor, 0] + 0.5)) for motor in (0, 1)]
    for motor in (0, 1):
        for piece in range(span.size):
            found = _jumps(*(float(a[motor, piece]) for a in (first, v, w, last)))
            begin, end = times[piece], times[piece + 1]
            events += [(min(begin + s * (end - begin), end), motor, level) for s, level in found]
    events.sort(key=lambda event: event[0])
    where, rows = np.zeros(2), {}
    for t, motor, level in events:
        where[motor] = level
        rows[t] = where.copy()
    begins, levels = np.array(list(rows)), np.array(list(rows.values())) * quantum
    end = times[-1] if begins[-1] < times[-1] else times[-1] + span[-1]
    places = 0.5 * np.stack([levels[:, 0] + levels[:, 1], levels[:, 0] - levels[:, 1]], axis=1)
    still = np.zeros_like(places)
    return Trajectory(*map(as_parameter, (np.append(begins, end), places, still, still)))


def _jumps(u: float, v: float, w: float, last: float) -> list[tuple[float, float]]:
    """Jumps of a quadratic in 0 to 1 that is rounded: where they are, and to which level."""
    turn = -0.5 * v / w if w else -1.0
    middle = [(turn, u + 0.5 * v * turn)] if 0.0 < turn < 1.0 else []
    found: list[tuple[float, float]] = []
    for (s0, u0), (s1, u1) in pairwise([(0.0, u), *middle, (1.0, last)]):
        low, high = np.floor(u0 + 0.5), np.floor(u1 + 0.5)
        up = 1.0 if high > low else -1.0
        levels = np.arange(low + up, high + up, up) if high != low else np.empty(0)
        rise = levels - 0.5 * up - u0 if up > 0 else levels + 0.5 - u0
        slope = v + 2.0 * w * s0
        root = np.sqrt(np.maximum(slope**2 + 4.0 * w * rise, 0.0))
        since = 2.0 * rise / np.where(rise == 0.0, 1.0, slope + up * root)
        found += list(zip(np.clip(s0 + since, s0, s1).tolist(), levels.tolist(), strict=True))
    return found
