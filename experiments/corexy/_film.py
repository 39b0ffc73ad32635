"""Frames of the machine from above, beside curves of its two motors."""

from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from stickslip.plot import Movie

from ._machine import Machine


def film(
    time: np.ndarray,
    place: np.ndarray,
    turned: np.ndarray,
    slips: np.ndarray,
    curves: Callable[[Axes, int], Any],
    words: Callable[[int], str],
    frames: int,
    per_second: int,
) -> Movie:
    """The collar at each `place` [m], the rims of the motors `turned` by so much [m], and whether each
    belt `slips`; `[row, 2]` each.

    `curves(axes, k)` draws those of motor k + 1; `words(row)` is the title.
    """
    room = 0.18 * max(np.ptp(place[:, 0]), np.ptp(place[:, 1]), 0.1)
    x, y = (place - place.min(axis=0) + room).T
    figure = plt.figure(figsize=(7.6, 5.2), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    axis = figure.add_subplot(grid[:, 0])
    (trace,) = axis.plot([], [], color="0.6", lw=0.8, zorder=2)
    machine = Machine(axis, x.max() + room, y.max() + room)
    title = axis.set_title("", fontsize=10)
    cursors = []
    for k in range(2):
        panel = figure.add_subplot(grid[k, 1])
        curves(panel, k)
        panel.set_xlim(time[0], time[-1])
        cursors.append(panel.axvline(time[0], color="k", lw=0.8))
    panel.set_xlabel("t [s]")
    panel.legend(fontsize=7, loc="upper right")
    even = np.linspace(time[0], time[-1], frames)
    rows = np.interp(even, time, np.arange(time.size)).round().astype(int)

    def update(i: int) -> None:
        at = rows[i]
        machine.move(x[at], y[at], turned[at], slips[at])
        trace.set_data(x[: at + 1], y[: at + 1] + 0.5 * machine.gap)
        for cursor in cursors:
            cursor.set_xdata([time[at], time[at]])
        title.set_text(words(at))

    return Movie(figure, update, frames, per_second)
