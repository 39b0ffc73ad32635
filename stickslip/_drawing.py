"""Colours, dots and figures that pictures share, those of `plot` and those of a report."""

import io

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

BLUE, RED, GREEN, GREY, BAND = "#1f4e9c", "#c0392b", "#2e8b57", "0.6", "0.8"


def residual_dots(axis: Axes, places: np.ndarray, values: np.ndarray, size: float = 1.5) -> None:
    """As many residuals as a panel tells apart over their places, and the line to lie about."""
    every = max(values.size // 4000, 1)
    axis.plot(places[::every], values[::every], ".", ms=size, color=BLUE)
    axis.axhline(0.0, lw=0.6, color=GREY)


class Picture(Figure):
    """A figure without pyplot that a notebook shows all the same, rather than its `repr`."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()
