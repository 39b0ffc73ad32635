"""How large the noise of a record is, from the record alone."""

import itertools
import math

import numpy as np

from .._argument_checks import check_arguments, number, or_none
from .._types import Row
from .._validation import check_finite, one_row, refusal


@check_arguments(quantum=or_none(number("positive")))
def noise_level(series: Row, quantum: float | None = None) -> float:
    r"""Standard deviation of the noise in a series of even samples of a smooth motion.

    Differences of the order $m$ leave of white noise the variance $\binom{2m}{m}\sigma^2$, and of the
    motion less and less, as far as it is sampled well within its shortest period. The order is the
    first from which the next one says the same, within what chance explains; the estimate is never
    below $q/\sqrt{12}$ of an encoder's `quantum` $q$. Noise that hangs together in time (filtered
    signals) is underestimated, and single jumps of the motion, as impacts make in a velocity, count
    as noise.

    **Arguments:** `series`, one row of at least 8; `quantum`, in its unit: the smallest step of the
    encoder, or None. **Returns** a number in the unit of the series. **Raises** `TypeError`,
    `ValueError` for anything else. It reads numbers and does not work under `jit`.
    """
    row = np.asarray(check_finite("series", one_row("series", series, least=8)), np.float64)
    if not np.any(np.diff(row)) and quantum is None:
        raise refusal("series", series, "a series that changes, or a stated quantum")
    least = 0.0 if quantum is None else float(quantum) / math.sqrt(12.0)
    estimates = []
    for order in range(1, min(10, row.size // 3) + 1):
        rest = np.diff(row, order)
        estimates.append((math.sqrt(np.mean(rest**2) / math.comb(2 * order, order)), rest.size))
    for (now, count), (after, _) in itertools.pairwise(estimates):
        # Within three standard deviations of one estimate: the two share most of their noise.
        if after > now * (1.0 - 3.0 / math.sqrt(2.0 * count)):
            return max(now, least)
    return max(min(now for now, _ in estimates), least)


def quantum_of(series: np.ndarray) -> float | None:
    """The step of which all differences of the series are multiples, if there is one: an encoder's."""
    values = np.unique(series[np.isfinite(series)])
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * np.abs(values).max(initial=0.0)]
    if steps.size < 4:
        return None
    step = float(steps.min())
    # Refined over all of them: one step alone has few digits.
    for _ in range(3):
        counts = np.rint((values - values[0]) / step)
        if counts[-1] < 1:
            return None
        step = float((values[-1] - values[0]) / counts[-1])
    off = np.abs((values - values[0]) / step - np.rint((values - values[0]) / step))
    # Numbers without a quantum have steps as fine as their closest pair: many more than values.
    return step if off.max() < 0.05 and values.size > 0.02 * counts[-1] else None
