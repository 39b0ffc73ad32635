"""Moving pictures as GIF, and what the mechanisms in them are made of."""

import dataclasses
import os
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

STICK, SLIP, DARK, PALE = "#1f4e9c", "#c0392b", "0.25", "0.8"
DPI = 80  # of the frames


@dataclasses.dataclass(frozen=True)
class Movie:
    """A figure, what changes it into frame number `i`, how many there are, and how many a second."""

    figure: Figure
    update: Callable[[int], Any]
    frames: int
    per_second: int


def still(animate: Callable[[Any], Movie]) -> Callable[[Any], Figure]:
    """What draws one frame of an animation, that in the middle."""

    def draw(data: Any) -> Figure:
        movie = animate(data)
        movie.update(movie.frames // 2)
        return movie.figure

    return draw


def write_gif(movie: Movie, path: pathlib.Path) -> pathlib.Path:
    """All frames in one GIF, all of it or nothing; no program but Pillow is needed."""
    movie.update(0)
    movie.figure.canvas.draw()
    # Laid out once: titles that change must not move the axes.
    movie.figure.set_layout_engine("none")
    animation = FuncAnimation(movie.figure, movie.update, frames=movie.frames, repeat=False)
    temporary = path.with_name(f"{path.stem}.part.gif")
    animation.save(temporary, writer=PillowWriter(fps=movie.per_second), dpi=DPI)
    os.replace(temporary, path)
    return path


def coil(start: Any, end: Any, turns: int = 6, width: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A spring between two points, as a zigzag of so many turns."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    along = np.concatenate([[0.0, 0.15], np.linspace(0.15, 0.85, 2 * turns + 1)[1:-1], [0.85, 1.0]])
    across = np.concatenate([[0.0, 0.0], np.tile([0.5, -0.5], turns)[: 2 * turns - 1], [0.0, 0.0]])
    way = end - start
    normal = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-300)
    points = start + along[:, None] * way + width * across[:, None] * normal
    return points[:, 0], points[:, 1]


def along_path(corners: Any, lengths: Any) -> tuple[np.ndarray, np.ndarray]:
    """Points at such lengths from the beginning of a path through corners."""
    corners = np.asarray(corners, float)
    sides = np.hypot(*np.diff(corners, axis=0).T)
    reached = np.concatenate([[0.0], np.cumsum(sides)])
    return np.interp(lengths, reached, corners[:, 0]), np.interp(lengths, reached, corners[:, 1])
