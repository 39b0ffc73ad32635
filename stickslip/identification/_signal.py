"""A sampled input as a function of time that knows where it jumps or bends."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, choice, one_real, reals
from .._types import Numeric, Row
from .._validation import check_finite, is_concrete, one_row, refusal, shape_refusal
from ..hybrid.accuracy import ACCURACY as ENGINE

NEVER = ENGINE.far  # time of a break that never comes [s]
KINDS = ("hold", "linear", "cubic")


class Signal(eqx.Module):
    r"""Samples of an input at increasing `times` [s], in the unit of the `values`.

    - `"hold"`: from each sample to the next its value (zero-order hold); it jumps where two samples
      differ. `"linear"`: straight lines, which bend at the samples. `"cubic"`: the cubic spline.
    - Two samples at the same time are a jump of a linear or cubic signal: on either side of it the
      signal is interpolated by itself.
    - Before the first sample and after the last (under `"hold"`: after it has been held as long as the
      one before) the first and the last value hold, but inputs of a `Record` that
      are too short raise an error.

    `breaks` are the times at which it jumps or bends. A system in whose fields a `Signal` stands is
    given these by a `Problem`, as by `stickslip.WithBreaks`, so that its motion is exact through them:

    >>> voltage = Signal([0.0, 1.0, 2.0, 3.0], [0.0, 5.0, 5.0, 1.0])
    >>> float(voltage(1.5)), [float(t) for t in voltage.breaks]
    (5.0, [1.0, 3.0])

    **Raises** `ValueError`, `TypeError` for times that fall, values that are not as many or not finite.
    """

    times: Float[Array | np.ndarray, " piece"]
    coefficients: Float[Array | np.ndarray, "4 piece"]
    breaks: Float[Array | np.ndarray, " break"]
    end: Float[Array | np.ndarray, ""]

    @check_arguments(kind=choice(KINDS))
    def __init__(self, times: Row, values: Row, kind: str = "hold"):
        times, values = _row("times", times), _row("values", values)
        if values.shape != times.shape:
            raise shape_refusal("values", values, f"of shape {times.shape}, as times")
        _check_order(times, kind)
        if kind == "hold":
            jumps = np.flatnonzero(np.diff(values) != 0.0) + 1
            self.times = times
            self.coefficients = np.zeros((4, times.size))
            self.coefficients[0] = values
            self.breaks = times[jumps]
            self.end = np.asarray(2.0 * times[-1] - times[-2])
        else:
            self.times, self.coefficients, self.breaks = _pieces_of(times, values, kind)
            self.end = np.asarray(times[-1])

    @check_arguments(t=reals)
    def __call__(self, t: Numeric) -> Any:
        """Value at time `t` [s]; at a jump the one behind it."""
        times = jnp.asarray(self.times)
        piece = jnp.searchsorted(jax.lax.stop_gradient(times), t, side="right") - 1
        piece = jnp.maximum(piece, 0)
        a, b, c, d = (row[piece] for row in jnp.asarray(self.coefficients))
        s = jnp.maximum(t - times[piece], 0.0)
        return a + s * (b + s * (c + s * d))

    @check_arguments(delay=one_real)
    def delayed(self, delay: Numeric) -> "Signal":
        """The same, later by `delay` [s]; its breaks too, with their derivatives."""
        where = lambda s: (s.times, s.breaks, s.end)  # noqa: E731
        return eqx.tree_at(where, self, tuple(jnp.asarray(a) + delay for a in where(self)))


def _row(name: str, values: Any) -> np.ndarray:
    if not is_concrete(values):
        raise refusal(name, values, "known: make a Signal outside of jit and vmap", TypeError)
    check_finite(name, values)
    one_row(name, values, least=2)
    return np.asarray(values, np.float64)


def _check_order(times: np.ndarray, kind: str) -> None:
    steps = np.diff(times)
    wrong = steps <= 0.0 if kind == "hold" else steps < 0.0
    if kind != "hold":
        wrong[[0, -1]] = steps[[0, -1]] <= 0.0
        wrong[1:] |= (steps[1:] == 0.0) & (steps[:-1] == 0.0)
    if wrong.any():
        at = int(np.flatnonzero(wrong)[0]) + 1
        allowed = f"above the one before it, {times[at - 1].item()}: they must increase"
        raise refusal(f"times[{at}]", times[at].item(), allowed)


def _pieces_of(times: np.ndarray, values: np.ndarray, kind: str):
    """Beginnings and coefficients of the pieces, and the breaks, of what lies between the jumps."""
    from scipy.interpolate import CubicSpline

    cuts = np.flatnonzero(np.diff(times) == 0.0) + 1
    starts, rows, breaks = [], [], [times[cuts]]
    for t, v in zip(np.split(times, cuts), np.split(values, cuts), strict=True):
        slopes = np.diff(v) / np.diff(t)
        if kind == "linear" or t.size < 3:
            c = np.stack([v[:-1], slopes, np.zeros(t.size - 1), np.zeros(t.size - 1)])
            rounding = 1e-12 * np.max(np.abs(slopes))
            breaks.append(t[1:-1][np.abs(np.diff(slopes)) > rounding])
        else:
            c = CubicSpline(t, v).c[::-1]
        starts.append(t[:-1])
        rows.append(c)
    # After the last sample its value holds.
    starts.append(times[-1:])
    rows.append(np.array([[values[-1]], [0.0], [0.0], [0.0]]))
    return np.concatenate(starts), np.concatenate(rows, axis=1), np.sort(np.concatenate(breaks))


def pad_signal(signal: Signal, pieces: int, breaks: int) -> Signal:
    """The same with arrays of so many pieces and breaks; those added never come."""
    more, never = pieces - signal.times.size, breaks - signal.breaks.size
    return eqx.tree_at(
        lambda s: (s.times, s.coefficients, s.breaks),
        signal,
        (
            np.concatenate([signal.times, np.full(more, NEVER)]),
            np.pad(np.asarray(signal.coefficients), ((0, 0), (0, more)), mode="edge"),
            np.concatenate([signal.breaks, np.full(never, NEVER)]),
        ),
    )


def breaks_of(system: PyTree) -> Array | None:
    """Breaks of all signals within a system, increasing; `None` if there are none."""
    is_signal = lambda leaf: isinstance(leaf, Signal)  # noqa: E731
    rows = [s.breaks for s in jax.tree.leaves(system, is_leaf=is_signal) if is_signal(s)]
    if not rows or not sum(row.shape[0] for row in rows):
        return None
    times = jnp.sort(jnp.concatenate([jnp.asarray(row) for row in rows]))
    # Inputs sampled by one clock jump together: of equal times one stays.
    gap = jnp.diff(times, prepend=-NEVER)
    again = jax.lax.stop_gradient(gap <= 4e-16 * jnp.abs(times)) | (times >= NEVER)
    later = NEVER * (1.0 + 1e-3 * jnp.arange(1.0, times.shape[0] + 1.0))
    return jnp.sort(jnp.where(again, later, times))
