"""Moving pictures, and the files that they are saved in."""

import dataclasses
import os
import pathlib
from collections.abc import Callable
from typing import Any, ClassVar

from matplotlib import rc_context
from matplotlib.animation import Animation, FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from .._paths import the_file
from .._types import Given, Path
from .._validation import check_callable, check_count, check_type, refusal
from . import _axes

STICK, SLIP = _axes.BLUE, _axes.RED
LOOK: dict[Any, Any] = {"animation.embed_limit": float("inf"), "savefig.bbox": None}


@dataclasses.dataclass(frozen=True, eq=False)
class Movie:
    """A figure that changes from frame to frame. A notebook shows it as the last line of a cell.

    `animate` makes one of any motion; what it does not draw is drawn by hand:

    >>> from matplotlib.figure import Figure
    >>> figure = Figure()
    >>> (dot,) = figure.add_subplot(xlim=(0.0, 1.0)).plot([0.0], [0.0], "o")
    >>> Movie(figure, lambda i: dot.set_xdata([i / 10]), frames=11, per_second=20)
    Movie: 11 frames in 0.55 s

    **Arguments:** `figure` of matplotlib; `update(i)` changes it into frame `i`, from 0; `frames`, how
    many there are; `per_second`, how many of them are shown in a second.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    figure: Given[Figure]
    update: Given[Callable[[int], Any]]
    frames: Given[int]
    per_second: Given[int]

    most: ClassVar[int] = 3000  # frames of a file that is still read

    def __post_init__(self) -> None:
        check_type("figure", self.figure, Figure, "a figure of matplotlib")
        check_callable("update", self.update, "update(i)", 0)
        check_count("frames", self.frames, 1, self.most)
        check_count("per_second", self.per_second, 1)

    def __repr__(self) -> str:
        return f"Movie: {self.frames:,} frames in {self.frames / self.per_second:g} s"

    def still(self, frame: Given[int | None] = None) -> Figure:
        """The figure as one `frame` has it, by default that in the middle.

        **Raises** `ValueError` for a number that no frame has.
        """
        if frame is not None:
            check_count("frame", frame, 0, self.frames - 1)
        self.update(self.frames // 2 if frame is None else frame)
        return self.figure

    def save(self, path: Path, *, dpi: int = 80) -> pathlib.Path:
        """Save all frames: as a GIF where `path` ends with `.gif`, as a page with buttons and a slider
        where it ends with `.html`. Neither needs another program; the signs on the buttons come from
        the net, without which they are blank.

        **Arguments:** `path` of the file, which is written over, all of it or nothing; `dpi`, dots per
        inch. A GIF counts in hundredths of a second: 10, 20, 25 or 50 frames a second it shows in time.

        **Returns** the path. **Raises** `TypeError`, `ValueError` for a path with another ending,
        `OSError` where it cannot be written.
        """
        found = the_file("path", path)
        if found.suffix not in (".gif", ".html"):
            raise refusal("path", path, "the path of a file that ends with .gif or .html")
        check_count("dpi", dpi, 1)
        temporary = found.with_name(f"{found.stem}.part{found.suffix}")
        if found.suffix == ".gif":
            with rc_context(LOOK):
                self._animation().save(temporary, writer=PillowWriter(fps=self.per_second), dpi=dpi)
        else:
            temporary.write_text(self._page(dpi), encoding="utf-8")
        os.replace(temporary, found)
        return found

    def _repr_html_(self) -> str:
        return self._page("figure")

    def _page(self, dpi: int | str) -> str:
        with rc_context({**LOOK, "savefig.dpi": dpi}):
            return self._animation().to_jshtml(fps=self.per_second, embed_frames=True)

    def _animation(self) -> Animation:
        self.update(0)
        # Laid out once: titles that change must not move the axes.
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")
        return FuncAnimation(self.figure, self.update, frames=self.frames, repeat=False)
