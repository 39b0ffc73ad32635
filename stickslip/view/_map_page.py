"""The page of a map: coloured cells above; below the motion from the chosen one."""

import html
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import CategoricalColorMapper, ColumnDataSource, Div, HoverTool
from bokeh.plotting import figure

from .._attractor_color import attractor_color
from ._map import Map
from ._module import Functions
from ._motion import CHOSEN, MOST_DRAWN, MotionFigures, later, small


class MapPage:
    """The page with its state: the chosen cell, and the motion from there if a module computes it."""

    def __init__(self, shown: Map, functions: Functions | None, document: Any):
        self.shown, self.document = shown, document
        self.orbit = None if functions is None else functions.orbit
        self.asked = 0  # number of the last click: answers to earlier ones come too late
        across, up = shown.labels
        plot: Any = figure(
            height=460, sizing_mode="stretch_width", title=shown.title.replace("$", ""),
            x_axis_label=across, y_axis_label=up, tools="pan,wheel_zoom,box_zoom,reset,save",
        )  # fmt: skip
        small(plot)
        columns: Any = shown.columns(MOST_DRAWN)
        self.cells = ColumnDataSource(columns, name="cells")
        colors = [attractor_color(word, number) for number, word in enumerate(shown.words)]
        mapper = CategoricalColorMapper(factors=shown.words, palette=colors)
        color: Any = {"field": "word", "transform": mapper}
        glyphs = plot.quad(
            "left", "right", "bottom", "top", source=self.cells, fill_color=color, line_color=color,
            legend_group="word",
        )  # fmt: skip
        plot.add_layout(plot.legend[0], "right")
        tips = [(key, f"@{at}{{0.[000000]}}") for key, at in zip(shown.parameters, "xy", strict=True)]
        tips += [(key, f"@{{beside {k}}}{{0.[0000]}}") for k, key in enumerate(shown.beside)]
        plot.add_tools(HoverTool(renderers=[glyphs], tooltips=[(shown.code, "@word"), *tips], limit=1))
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
        if shown.number.size > MOST_DRAWN:
            notes += f" Of {shown.number.size:,} cells only {len(self.cells.data['x']):,} are drawn."
        told = Div(text=html.escape(notes), disable_math=True, name="notes")
        document.title = shown.title
        document.add_root(
            column(plot, told, self.chosen, self.message, *figures, sizing_mode="stretch_width")
        )

    def choose(self, x: float, y: float) -> None:
        """Show the cell nearest to a place, and have the motion from there computed."""
        cell = self.shown.cell(x, y)
        point, words = self.shown.point(cell), self.shown.in_words(cell)
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
