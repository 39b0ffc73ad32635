"""The page of a diagram on the local server: clicks and regions are answered by Python."""

import html
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from .._validation import refusal
from ._diagram import Diagram, Lanes
from ._module import Functions
from ._motion import MOST_DRAWN, later
from ._page import Page, page_of


class Live:
    """A page with its state: the diagram shown, the region of it, the chosen lane."""

    def __init__(self, diagram: Diagram, functions: Functions | None, document: Any):
        self.whole = self.shown = diagram
        self.functions = functions or Functions(None, None)
        self.document = document
        self.region: tuple[float, float] | None = None
        self.x = float("nan")
        self.asked = 0  # number of the last click: answers to earlier ones come too late
        notes = [f"At most {MOST_DRAWN:,} points are drawn, of evenly spaced lanes."]
        if len(diagram.observables) > 1:
            notes.append(f"--observable chooses one of {', '.join(diagram.observables)}.")
        self.page: Page = page_of(diagram, notes, motion=self.functions.orbit is not None, drag=True)
        self.lanes = self._lanes()
        # The second of two quick clicks is a double one, wherever it is.
        for click in ("tap", "doubletap"):
            self.page.diagram.on_event(click, lambda event: self.choose(event.x))
        self.page.diagram.on_event("selectiongeometry", self._on_drag)
        self.page.back.on_click(self.back)
        for select in self.page.selects:
            select.on_change("value", lambda attr, old, new: self.back())
        self.draw()
        self.choose(float(self.lanes.x[self.lanes.x.size // 2]))
        document.title = diagram.title
        document.add_root(self.page.root)

    @property
    def choices(self) -> list[int]:
        """Numbers of the chosen values of the other coordinates."""
        return [int(select.value) for select in self.page.selects]

    def _lanes(self) -> Lanes:
        return self.shown.lanes(self.shown.matching(self.whole, self.choices))

    def draw(self) -> None:
        """The points of the lanes shown, thinned evenly to what a browser draws."""
        lanes = self.lanes if self.region is None else self.lanes.part(*self.region)
        total = int(lanes.counts().sum())
        stride = max(1, -(-total // MOST_DRAWN))
        self.page.drawn.data = columns_of(lanes.every(stride))

    def choose(self, x: float) -> None:
        """Show the lane nearest to a parameter, and have its orbit computed."""
        lane = self.lanes.nearest(x)
        self.x = float(self.lanes.x[lane])
        self.asked += 1
        points, page = self.lanes.points(lane), self.page
        words = self.shown.in_words(self.lanes, lane)
        page.marker.location = self.x
        page.chosen.text = html.escape(words)
        page.returns.title.text = f"return map, {words}"
        page.return_points.data = {"x": points[:-1], "y": points[1:]}
        ends = [float(np.nanmin(points)), float(np.nanmax(points))] if points.size else []
        page.diagonal.data = {"x": ends, "y": ends}
        if self.functions.orbit is None:
            page.orbit.title.text = f"points in order, {words}"
            page.orbit_points.data = {"x": np.arange(points.size), "y": points}
            return
        number = self.asked
        page.motion.clear(f"computing the orbit, {words}")
        self._later("computing the orbit ...", lambda: self._orbit(number, words))

    def _orbit(self, number: int, words: str) -> None:
        if number != self.asked:
            return
        assert self.functions.orbit is not None
        found = self.functions.orbit(**self.whole.point(self.x, self.choices))
        about = f"phase plane, {self.shown.about(self.x)}"
        self.page.motion.show(found, self.whole.observable, f"orbit, {words}", about)

    def _on_drag(self, event: Any) -> None:
        if event.final and event.geometry.get("x0") is not None:
            low, high = sorted((event.geometry["x0"], event.geometry["x1"]))
            self.drag(float(low), float(high))

    def drag(self, low: float, high: float) -> None:
        """Show a region: computed anew where the user's module can, else what is stored of it."""
        if self.functions.diagram is None:
            self.region = (low, high)
            self._show()
            return
        self._later("computing the region ...", lambda: self._compute_region(low, high))

    def _compute_region(self, low: float, high: float) -> None:
        assert self.functions.diagram is not None
        others = self.whole.point(low, self.choices)
        found = self.functions.diagram(**{**others, self.whole.x: (low, high)})
        if not isinstance(found, xr.Dataset):
            what = "an xarray.Dataset, as `orbit_diagram` returns"
            raise refusal("diagram(...)", found, what, TypeError)
        self.shown = Diagram(found, "diagram(...)", x=self.whole.x, observable=self.whole.observable)
        self.region, self.lanes = None, self._lanes()
        self._show()

    def back(self) -> None:
        """The whole diagram as it is stored."""
        self.shown, self.region = self.whole, None
        self.lanes = self._lanes()
        self._show()

    def _show(self) -> None:
        self.page.back.visible = self.shown is not self.whole or self.region is not None
        self.draw()
        middle = self.lanes.x if self.region is None else self.lanes.part(*self.region).x
        inside = middle.size and middle.min() <= self.x <= middle.max()
        self.choose(self.x if inside or not middle.size else float(middle[middle.size // 2]))

    def _later(self, words: str, compute: Callable[[], None]) -> None:
        later(self.document, self.page.message, words, compute)


def columns_of(lanes: Lanes) -> dict[str, np.ndarray]:
    """The points of lanes as columns of the diagram."""
    counts = lanes.counts()
    used = np.arange(lanes.y.shape[1]) < counts[:, None]
    status = np.repeat(lanes.status, counts)
    return {
        "x": np.repeat(lanes.x, counts),
        "y": lanes.y[used],
        "bad": (status != 0).astype(np.int32),
        "status": status.astype(np.int32),
        "period": np.repeat(lanes.period, counts).astype(np.int32),
    }
