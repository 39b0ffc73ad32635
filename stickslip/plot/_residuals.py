"""Dots of residuals about zero."""

import numpy as np
from matplotlib.axes import Axes

from ._axes import BLUE, GREY

MOST = 4000  # dots that a panel tells apart


def residual_dots(axis: Axes, places: np.ndarray, values: np.ndarray, size: float = 1.5) -> None:
    """At most so many residuals over their places, and the line that they should lie about."""
    every = max(values.size // MOST, 1)
    axis.plot(places[::every], values[::every], ".", ms=size, color=BLUE)
    axis.axhline(0.0, lw=0.6, color=GREY)
