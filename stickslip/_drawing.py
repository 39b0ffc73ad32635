"""Colours and dots that pictures share, those of `plot` and those of a report."""

import numpy as np
from matplotlib.axes import Axes

BLUE, RED, GREY, BAND = "#1f4e9c", "#c0392b", "0.6", "0.8"


def residual_dots(axis: Axes, places: np.ndarray, values: np.ndarray, size: float = 1.5) -> None:
    """As many residuals as a panel tells apart over their places, and the line to lie about."""
    every = max(values.size // 4000, 1)
    axis.plot(places[::every], values[::every], ".", ms=size, color=BLUE)
    axis.axhline(0.0, lw=0.6, color=GREY)
