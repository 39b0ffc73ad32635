"""The page of a map: coloured cells above; below the motion from the chosen one."""

import html
from typing import Any

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import CategoricalColorMapper, ColumnDataSource, Div, HoverTool
from bokeh.palettes import Bright7
from bokeh.plotting import figure

from ._map import Map
from ._module import Functions
from ._motion import CHOSEN, MotionFigures, later

# Other codes are no attractors, and have no colour, as in `plot.basins`.
GREYS = {"not settled": "#d3d3d3", "left the limits": "#ffffff", "failed": "#000000"}


def colours_of(words: list[str]) -> list[str]:
    """A colour for each word: seven that colour-blind people tell apart, or a grey."""
    return [GREYS.get(word, Bright7[k % len(Bright7)]) for k, word in enumerate(words)]


class MapPage:
    """The page with its state: the chosen cell, and the motion from there if a module computes it."""

    def __init__(self, map: Map, functions: Functions | None, document: Any):
        self.map, self.document = map, document
        self.orbit = None if functions is None else functions.orbit
        self.asked = 0  # number of the last click: answers to earlier ones come too late
        across, up = map.labels
        plot: Any = figure(
            height=460, sizing_mode="stretch_width", title=map.title.replace("$", ""),
            x_axis_label=across, y_axis_label=up, tools="pan,wheel_zoom,box_zoom,reset,save",
        )  # fmt: skip
        plot.toolbar.logo = None
        x, y = (a.ravel() for a in np.meshgrid(map.x, map.y))
        word = np.array(map.words)[map.number].ravel()
        data = {"x": x, "y": y, "word": word, **{k: v.ravel() for k, v in map.beside.items()}}
        self.cells = ColumnDataSource(data, name="cells")
        mapper = CategoricalColorMapper(factors=map.words, palette=colours_of(map.words))
        colour: Any = {"field": "word", "transform": mapper}
        glyphs = plot.rect(
            "x", "y", width=map.x[1] - map.x[0], height=map.y[1] - map.y[0], source=self.cells,
            fill_color=colour, line_color=colour, legend_group="word",
        )  # fmt: skip
        tips = [(key, "@{" + key + "}{0.[0000]}") for key in map.beside]
        places = [(key, f"@{at}{{0.[000000]}}") for key, at in zip(map.parameters, "xy", strict=True)]
        plot.add_layout(plot.legend[0], "right")
        plot.add_tools(
            HoverTool(renderers=[glyphs], tooltips=[(map.code, "@word"), *places, *tips], limit=1)
        )
        self.marker = ColumnDataSource({"x": [], "y": []}, name="marker")
        plot.scatter(
            "x", "y", source=self.marker, marker="circle_cross", size=14, line_width=2,
            line_color=CHOSEN, fill_alpha=0.0,
        )  # fmt: skip
        # The second of two quick clicks is a double one, wherever it is.
        for click in ("tap", "doubletap"):
            plot.on_event(click, lambda event: self.choose(event.x, event.y))
        self.chosen = Div(text="", disable_math=True, styles={"font-weight": "bold"}, name="chosen")
        self.message = Div(text="", disable_math=True, name="message")
        self.motion = MotionFigures()
        figures = [row(*self.motion.figures, sizing_mode="stretch_width")] if self.orbit else []
        notes = "A click on the map chooses the nearest cell" + (
            " and shows the motion from there." if self.orbit else "; --with has its motion computed."
        )
        told = Div(text=html.escape(notes), disable_math=True, name="notes")
        document.title = map.title
        document.add_root(
            column(plot, told, self.chosen, self.message, *figures, sizing_mode="stretch_width")
        )

    def choose(self, x: float, y: float) -> None:
        """Show the cell nearest to a place, and have the motion from there computed."""
        cell = self.map.cell(x, y)
        point, words = self.map.point(cell), self.map.in_words(cell)
        across, up = point.values()
        self.marker.data = {"x": [across], "y": [up]}
        self.chosen.text = html.escape(words)
        self.asked += 1
        if self.orbit is None:
            return
        compute, number = self.orbit, self.asked

        def show() -> None:
            if number == self.asked:
                self.motion.show(compute(**point), "", f"motion, {words}", "phase plane")

        self.motion.clear(f"computing the motion, {words}")
        later(self.document, self.message, "computing the motion ...", show)
