"""The page: the diagram above; below the orbit of the chosen lane and its return map."""

import html
from typing import Any, NamedTuple

from bokeh.layouts import column, row
from bokeh.models import (
    BoxSelectTool,
    Button,
    ColumnDataSource,
    CustomJSHover,
    Div,
    HoverTool,
    Select,
    Span,
)
from bokeh.plotting import figure
from bokeh.transform import linear_cmap

from ._diagram import Diagram
from ._motion import BAD, CHOSEN, GOOD, SIZE, MotionFigures, small

WORDS = "return words[value] === undefined ? String(value) : words[value].replaceAll('_', ' ')"


class Page(NamedTuple):
    """The parts of the page that change, and the whole."""

    diagram: Any  # figure
    drawn: Any  # its points: x, y, bad, status, period
    marker: Any  # where the chosen lane is
    motion: MotionFigures
    orbit: Any  # figure of the points in order, or of the motion over time
    orbit_points: Any
    plane: Any  # figure of the phase plane
    plane_points: Any
    returns: Any  # figure of the return map
    return_points: Any
    diagonal: Any
    chosen: Any  # text on the chosen lane
    message: Any  # text on what is being done, or went wrong
    selects: list
    back: Any
    root: Any


def page_of(diagram: Diagram, notes: list[str], *, motion: bool, drag: bool) -> Page:
    """The page of a diagram, still without points.

    With `motion` the orbit is a line over time and has a phase plane; with `drag` a region of the
    parameter can be dragged.
    """
    over, name = diagram.label(diagram.x), diagram.label(diagram.observable)
    plot = figure(
        height=370, sizing_mode="stretch_width", title=diagram.title.replace("$", ""),
        x_axis_label=over, y_axis_label=name, output_backend="webgl",
        tools="pan,wheel_zoom,box_zoom,reset,save",
    )  # fmt: skip
    drawn = ColumnDataSource({"x": [], "y": [], "bad": [], "status": [], "period": []}, name="drawn")
    glyphs = plot.scatter(
        "x", "y", source=drawn, marker="square", size=2, line_color=None,
        fill_color=linear_cmap("bad", [GOOD, BAD], low=0, high=1), nonselection_fill_alpha=1.0,
    )  # fmt: skip
    periods = diagram.periods()
    period = CustomJSHover(
        args={"none": periods["none"], "untold": periods["untold"]},
        code="return value > 0 ? `period ${value}` : value == 0 ? none : untold",
    )
    status = CustomJSHover(args={"words": list(diagram.words)}, code=WORDS)
    hover = HoverTool(
        renderers=[glyphs],
        tooltips=[
            (diagram.x, "@x{0.[000000]}"),
            (diagram.observable, "@y{0.[000000]}"),
            ("period", "@period{custom}"),
            ("status", "@status{custom}"),
        ],
        formatters={"@period": period, "@status": status},
        limit=1,
    )
    plot.add_tools(hover)
    if drag:
        region = BoxSelectTool(dimensions="width")
        plot.add_tools(region)
        plot.toolbar.active_drag = region
    marker = Span(location=None, dimension="height", line_color=CHOSEN, line_width=1.5, name="marker")
    plot.add_layout(marker)
    moved = MotionFigures(alpha=1.0 if motion else 0.3)
    orbit, plane = moved.figures
    orbit.xaxis.axis_label, orbit.yaxis.axis_label = "number of the point", name
    if not motion:
        orbit.scatter("x", "y", source=moved.orbit_points, color=GOOD, size=4)
    returns = figure(title="return map", **SIZE)
    returns.xaxis.axis_label, returns.yaxis.axis_label = f"{name}, this point", "next point"
    return_points = ColumnDataSource({"x": [], "y": []}, name="returns")
    diagonal = ColumnDataSource({"x": [], "y": []}, name="diagonal")
    returns.line("x", "y", source=diagonal, color="#999999", line_dash="dashed")
    returns.scatter("x", "y", source=return_points, color=GOOD, size=4)
    for part in (plot, returns):
        small(part)
    selects = [
        Select(
            title=key, value="0", options=[(str(i), _value(v)) for i, v in enumerate(values)], name=key
        )
        for key, values in diagram.others.items()
    ]
    state = diagram.dataset.attrs.get("sweep_state", "finished")
    lines = [
        "A click on the diagram chooses the nearest lane.",
        *(["Dragging a region (box select) draws it anew."] if drag else []),
        "Blue: status ok; red: lanes with another status, which the pointer shows.",
        *([f"The sweep is {state}."] if state != "finished" else []),
        *notes,
    ]
    told = Div(text=html.escape(" ".join(lines)), disable_math=True, name="notes")
    chosen = Div(text="", disable_math=True, styles={"font-weight": "bold"}, name="chosen")
    message = Div(text="", disable_math=True, name="message")
    back = Button(label="back", visible=False, width=80, name="back")
    figures = [orbit, plane, returns] if motion else [orbit, returns]
    root = column(
        row(*selects, back), plot, told, chosen, message, row(*figures, sizing_mode="stretch_width"),
        sizing_mode="stretch_width",
    )  # fmt: skip
    return Page(
        plot, drawn, marker, moved, orbit, moved.orbit_points, plane, moved.plane_points, returns,
        return_points, diagonal, chosen, message, selects, back, root,
    )  # fmt: skip


def _value(value: Any) -> str:
    return f"{value:.7g}" if isinstance(value, float) else str(value)
