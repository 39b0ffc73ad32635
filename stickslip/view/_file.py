"""The page as one file without a server: packed points, thinned evenly to what fits."""

import importlib.resources
import itertools
import os
import pathlib
import sys
import traceback
from typing import Any, NamedTuple

import numpy as np
from bokeh.document import Document
from bokeh.embed import file_html
from bokeh.events import DocumentReady
from bokeh.models import CustomJS
from bokeh.resources import INLINE

from .._validation import refusal
from ._diagram import Diagram
from ._module import Functions, motion
from ._motion import failure
from ._page import page_of

LARGEST = 5_000_000  # bytes of the file
MOST_POINTS = LARGEST * 9 // 100  # of 4 bytes, a third more as text: what the page's programs leave


class Packed(NamedTuple):
    """The lanes of all choices one after another, every so many of them."""

    x: np.ndarray  # (lane,)
    start: np.ndarray  # (choice * lane + 1,), where the points of each lane begin
    status: np.ndarray
    period: np.ndarray
    why: np.ndarray
    y: np.ndarray  # (all points,), float32
    stride: int


def choices_of(diagram: Diagram) -> list[tuple[int, ...]]:
    """Every choice of the other coordinates, the last changing fastest."""
    return list(itertools.product(*(range(len(values)) for values in diagram.others.values())))


def pack_points(diagram: Diagram, most: int) -> Packed:
    """At most about so many points. Lanes are left out, never points of one, which follow each other.

    Errors: `ValueError` where two lanes of each choice are too much.
    """
    choices = choices_of(diagram)
    total = sum(int(diagram.lanes(chosen).counts().sum()) for chosen in choices)
    size = diagram.dataset.sizes[diagram.x]
    stride = max(1, -(-total // most))
    if size > 2 and -(-size // stride) < 2:
        what = f"with at most {most:,} points in two lanes of each of {len(choices)} choices"
        raise refusal("path", diagram.name, what, but=f"with {total:,} points in {size} lanes of each")
    parts = [diagram.lanes(chosen).every(stride) for chosen in choices]
    counts = [part.counts() for part in parts]
    points = [
        part.y[np.arange(part.y.shape[1]) < count[:, None]]
        for part, count in zip(parts, counts, strict=True)
    ]
    return Packed(
        x=parts[0].x,
        start=np.concatenate([[0], np.cumsum(np.concatenate(counts))]).astype(np.int32),
        status=np.concatenate([part.status for part in parts]).astype(np.int32),
        period=np.concatenate([part.period for part in parts]).astype(np.int32),
        why=np.concatenate([part.why for part in parts]).astype(np.int32),
        y=np.concatenate(points).astype(np.float32),
        stride=stride,
    )


def orbits_of(diagram: Diagram, functions: Functions, about: int = 40) -> list[dict[str, Any]]:
    """Orbits at evenly spaced parameters, `about` so many over all choices, or errors in words."""
    if functions.orbit is None:
        return []
    choices = choices_of(diagram)
    each = max(2, about // len(choices))
    x = diagram.lanes(choices[0]).x
    values = x[np.unique(np.linspace(0, x.size - 1, min(each, x.size)).round().astype(int))]
    found, known = [], {}
    for number, chosen in enumerate(choices):
        for value in values.tolist():
            point = diagram.point(value, chosen)
            at = tuple(point.items())
            if at not in known:  # sections are those of one orbit
                known[at] = _orbit(diagram, functions, point)
            found.append({"slice": number, "x": value, **known[at]})
    return found


def _orbit(
    diagram: Diagram, functions: Functions, point: dict[str, Any], most: int = 2000
) -> dict[str, Any]:
    """The orbit at a point in at most so many samples, or the error of the user's function."""
    assert functions.orbit is not None
    empty = np.zeros(0, np.float32)
    here: dict[str, Any] = {"t": empty, "first": empty, "second": empty, "error": ""}
    try:
        run = motion(functions.orbit(**point), diagram.observable)
    except Exception as error:  # whatever the user's function raises
        traceback.print_exc(file=sys.stderr)
        here["error"] = failure(error)
    else:
        stride = max(1, -(-run.t.size // most))
        second = empty if run.second is None else run.second
        here |= {"t": run.t, "first": run.first, "second": second, "labels": run.labels}
        for key in ("t", "first", "second"):
            here[key] = np.asarray(here[key][::stride], np.float32)
    return here


def document_of(diagram: Diagram, orbits: list[dict[str, Any]], most: int) -> Document:
    """The document of the file: all it knows is in one callback."""
    pack = pack_points(diagram, most)
    notes = [f"{pack.y.size:,} points of {pack.x.size:,} lanes, in 32 bits"]
    notes[0] += "." if pack.stride == 1 else f": one lane in {pack.stride} is in this file."
    if orbits:
        notes.append(
            f"{len(orbits)} orbits are in this file; that with the nearest parameter is shown."
        )
    page = page_of(diagram, notes, motion=bool(orbits), drag=False)
    labels = next((orbit["labels"] for orbit in orbits if "labels" in orbit), None)
    if labels is not None:
        page.orbit.xaxis.axis_label, page.orbit.yaxis.axis_label = labels[:2]
        page.plane.xaxis.axis_label, page.plane.yaxis.axis_label = labels[1:]
    unit = str(diagram.dataset[diagram.x].attrs.get("units", ""))
    kept = ("drawn", "marker", "orbit", "orbit_points", "plane", "plane_points", "returns")
    kept += ("return_points", "diagonal", "chosen", "message", "selects")
    code = importlib.resources.files("stickslip.view").joinpath("page.js").read_text(encoding="utf-8")
    callback = CustomJS(
        args={
            "page": {key: getattr(page, key) for key in kept},
            **{key: value for key, value in pack._asdict().items() if key != "stride"},
            **diagram.periods(),
            "words": list(diagram.words),
            "name": diagram.x,
            "unit": "" if unit == "1" else unit,
            "orbits": [{k: v for k, v in orbit.items() if k != "labels"} for orbit in orbits],
        },
        code=code,
    )
    # The second of two quick clicks is a double one, wherever it is.
    for click in ("tap", "doubletap"):
        page.diagram.js_on_event(click, callback)
    for select in page.selects:
        select.js_on_change("value", callback)
    document = Document()
    document.title = diagram.title
    document.add_root(page.root)
    document.js_on_event(DocumentReady, callback)
    return document


def write_file(diagram: Diagram, functions: Functions | None, path: pathlib.Path) -> int:
    """Write the page to `path`, all of it or nothing; its size in bytes.

    Errors: `ValueError` where the page cannot be made to fit.
    """
    orbits = orbits_of(diagram, functions or Functions(None, None))
    most = MOST_POINTS
    while True:
        text = file_html(document_of(diagram, orbits, most), INLINE, diagram.title).encode()
        if len(text) < LARGEST:
            break
        if most < 1000:
            what = f"a diagram whose page fits into {LARGEST:,} bytes"
            raise refusal("path", diagram.name, what, but=f"which makes {len(text):,}")
        most = int(0.7 * most)
    temporary = path.with_name(path.name + ".part")
    temporary.write_bytes(text)
    os.replace(temporary, path)
    return len(text)
