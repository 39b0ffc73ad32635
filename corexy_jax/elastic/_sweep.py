"""The excitation with which a printer looks for its resonances, as a trajectory."""

import numpy as np

from stickslip.checks import Given, Numeric, Row, as_parameter, check_known, one_concrete, refusal

from .._arguments import unit_row
from ._trajectory import Trajectory


def resonance_sweep(
    direction: Given[Row],
    f0: Numeric,
    f1: Numeric,
    rate: Numeric,
    acceleration_per_hz: Numeric,
    *,
    x: Numeric = 0.0,
    y: Numeric = 0.0,
    begin: Numeric = 0.0,
) -> Trajectory:
    r"""Pulses of a frequency that rises: forth in one half of a period, back in the other.

    Half a period of frequency $f$ is two pieces of the length $1/(4f)$, with the accelerations $\pm a$
    and $\mp a$, $a = a_f f$, and ends at rest; the sign then changes, and $f$ grows by
    $\dot f/(2f)$. It covers $a_f/(16 f)$ and has the speed $a_f/4$ at most, whatever $f$; the last
    half period is the one that begins at $f \le f_1$. The command of the firmware Klipper for this is
    `TEST_RESONANCES` without the slow motion that it can lay underneath (`sweeping_period: 0`).

    **Arguments**

    - `direction`: the axis, a row `(x, y)` of any length but 0; `(1, 1)` is a diagonal, along which
      one belt moves.
    - `f0`, `f1` [Hz], positive, `f1` not below; `rate` $\dot f$ [Hz/s], positive, of
      $2(f_1^2 - f_0^2)/\dot f$ pieces in all, up to a million.
    - `acceleration_per_hz` $a_f$ [m/s² per Hz], positive: 0.06 is usual.
    - `x`, `y` [m]: where it begins; `begin` [s]: when.

    **Returns** a `Trajectory`. **Raises** `TypeError`, `ValueError` naming the argument. It reads
    numbers and does not work under `jit`.
    """
    along = unit_row("direction", check_known("direction", direction))
    low, high, growth, per_hz = (
        float(one_concrete(name, value, "positive"))
        for name, value in (
            ("f0", f0), ("f1", f1), ("rate", rate), ("acceleration_per_hz", acceleration_per_hz),
        )
    )  # fmt: skip
    if high < low:
        raise refusal("f1", f1, f"not below f0 = {low}")
    slowest = 2e-6 * (high - low) * (high + low)
    if not growth >= slowest:
        raise refusal("rate", rate, f"not below {slowest:g}: a million pieces from f0 to f1")
    place = np.array([float(one_concrete(name, value)) for name, value in (("x", x), ("y", y))])
    start = float(one_concrete("begin", begin))
    frequencies = [low]
    while (after := frequencies[-1] + 0.5 * growth / frequencies[-1]) <= high:
        frequencies.append(after)
    f = np.array(frequencies)
    spans = np.repeat(0.25 / f, 2)
    signs = np.where(np.arange(f.size) % 2 == 0, 1.0, -1.0)
    rates = np.stack([signs * per_hz * f, -signs * per_hz * f], axis=1).ravel()
    tops = np.stack([np.zeros(f.size), 0.25 * signs * per_hz], axis=1).ravel()
    ways = np.stack([np.zeros(f.size), signs * per_hz / (32.0 * f)], axis=1).ravel()
    before = np.concatenate([[0.0], np.cumsum(signs * per_hz / (16.0 * f))[:-1]])
    reached = np.repeat(before, 2) + ways
    parts = (place + reached[:, None] * along, tops[:, None] * along, rates[:, None] * along)
    times = start + np.concatenate([[0.0], np.cumsum(spans)])
    return Trajectory(times, *(as_parameter(part) for part in parts))
