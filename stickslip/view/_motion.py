"""A motion on the page, over time and in the phase plane, and work that the page announces."""

import html
import sys
import traceback
from collections.abc import Callable
from typing import Any

from bokeh.models import ColumnDataSource
from bokeh.plotting import figure

from ._module import motion

GOOD, BAD, CHOSEN = "#1f4e9c", "#c0392b", "#b7791f"
MOST_DRAWN = 200_000  # points or cells that a browser draws without a pause
SIZE = {
    "height": 300,
    "sizing_mode": "stretch_width",
    "tools": "pan,wheel_zoom,box_zoom,reset,save",
}


class MotionFigures:
    """Two figures and their points, empty at first."""

    def __init__(self, alpha: float = 1.0):
        self.orbit: Any = figure(title="orbit", **SIZE)
        self.orbit_points = ColumnDataSource({"x": [], "y": []}, name="orbit")
        self.orbit.line("x", "y", source=self.orbit_points, color=GOOD, alpha=alpha)
        self.plane: Any = figure(title="phase plane", **SIZE)
        self.plane_points = ColumnDataSource({"x": [], "y": []}, name="plane")
        self.plane.line("x", "y", source=self.plane_points, color=GOOD)
        for part in self.figures:
            small(part)

    @property
    def figures(self) -> list[Any]:
        return [self.orbit, self.plane]

    def clear(self, words: str) -> None:
        """No motion, and words why."""
        self.orbit.title.text = self.plane.title.text = words
        self.orbit_points.data = self.plane_points.data = {"x": [], "y": []}

    def show(self, dataset: Any, observable: str, title: str, about: str) -> None:
        """Draw what the user's function returned: an observable or else the first, the next over it.

        Errors: those of `motion`.
        """
        found = motion(dataset, observable)
        self.orbit.title.text, self.plane.title.text = title, about
        self.orbit.xaxis.axis_label, self.orbit.yaxis.axis_label = found.labels[:2]
        self.orbit_points.data = {"x": found.t, "y": found.first}
        self.plane.xaxis.axis_label, self.plane.yaxis.axis_label = found.labels[1:]
        if found.second is not None:
            self.plane_points.data = {"x": found.first, "y": found.second}


def small(part: Any) -> None:
    """No logo, and a title of which a third of the page holds all words."""
    part.toolbar.logo = None
    part.title.text_font_size = "8pt"


def failure(error: BaseException) -> str:
    """An error as the page shows it."""
    text = html.escape(f"{type(error).__name__}: {error}")
    return f'<span style="color: {BAD}">{text}</span>'


def later(document: Any, message: Any, words: str, compute: Callable[[], None]) -> None:
    """Say on the page what is done, then do it; an error is shown there and in the terminal."""

    def work() -> None:
        try:
            compute()
        except Exception as error:  # whatever the user's functions raise
            traceback.print_exc(file=sys.stderr)
            message.text = failure(error)
        else:
            message.text = ""

    message.text = html.escape(words)
    document.add_next_tick_callback(work)
