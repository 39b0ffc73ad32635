"""An input that the scenarios and the designed one have in common, so that one program serves all."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

import corexy_jax as cx


class Input(cx.AbstractTable):
    """Harmonic voltages plus a table of levels `v1`, `v2` [V] with slopes [V/s] from each time on."""

    slope_1: Float[Array, " row"]
    slope_2: Float[Array, " row"]
    harmonic: cx.Harmonic

    def __init__(self, times: Any, v1: Any, v2: Any, slope_1: Any, slope_2: Any, harmonic: Any):
        super().__init__(times, v1, v2)
        self.slope_1, self.slope_2 = jnp.asarray(slope_1), jnp.asarray(slope_2)
        self.harmonic = harmonic

    def volts(self, t, piece):
        row = self._row(piece)
        since = t - self.times[row]
        one, two = self.harmonic.volts(t, piece)
        return (
            one + self.v1[row] + self.slope_1[row] * since,
            two + self.v2[row] + self.slope_2[row] * since,
        )


def scenario_input(number: int, duration: float) -> Input:
    """The input of a scenario with a break every half second."""
    times = np.arange(0.0, max(duration, 1.0), 0.5)
    flat = np.zeros(times.size)
    voltage = cx.scenario(number).voltage
    if isinstance(voltage, cx.Harmonic):
        return Input(times, flat, flat, flat, flat, voltage)
    assert isinstance(voltage, cx.SquareWave)
    middle = np.array([[float(v) for v in voltage(t + 0.25)] for t in times])
    return Input(times, middle[:, 0], middle[:, 1], flat, flat, cx.Harmonic(0.0, 0.0))


def ramps(ends: Any, duration: float) -> Input:
    """Voltages [V] that go from `ends[row, 0]` to `ends[row, 1]` within half a second, then jump."""
    times = np.arange(0.0, max(duration, 1.0), 0.5)
    start = ends[:, 0]
    slopes = (ends[:, 1] - start) / 0.5
    still = cx.Harmonic(0.0, 0.0)
    return Input(times, start[:, 0], start[:, 1], slopes[:, 0], slopes[:, 1], still)
