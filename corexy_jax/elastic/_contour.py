"""How far the head is from the lines that it should follow."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Array, Float

from stickslip.checks import (
    Given,
    Row,
    check_finite,
    check_known,
    numbers,
    one_row,
    shape_refusal,
)


def contour_errors(
    points: Given[Sequence[Any] | np.ndarray | Array], x: Row, y: Row
) -> Float[np.ndarray, " place"]:
    """Distance of each place of the head from the nearest of the lines between `points` [m].

    It says nothing about when the head is there: being late along a line is no error of the contour.

    **Arguments:** `points` [m]: `[point, 2]`, at least two; `x`, `y` [m]: rows of places, of the same
    length. **Raises** `TypeError`, `ValueError` naming the argument. It reads numbers and does not
    work under `jit`.
    """
    lines = numbers("points", check_known("points", check_finite("points", points))).astype(np.float64)
    if lines.ndim != 2 or lines.shape[1] != 2 or len(lines) < 2:
        raise shape_refusal("points", points, "of shape [point, 2], at least two points")
    places = []
    for name, given in (("x", x), ("y", y)):
        row = one_row(name, check_known(name, check_finite(name, given)))
        places.append(numbers(name, row).astype(np.float64))
    if places[0].shape != places[1].shape:
        raise shape_refusal("y", y, f"of shape {places[0].shape}, as x")
    begin, way = lines[:-1], np.diff(lines, axis=0)
    square = np.sum(way**2, axis=1)
    found = []
    for part in np.array_split(np.stack(places, axis=1), max(places[0].size // 1000, 1)):
        away = part[:, None, :] - begin[None, :, :]
        along = np.sum(away * way[None, :, :], axis=2) / np.where(square > 0.0, square, 1.0)[None, :]
        off = away - np.clip(along, 0.0, 1.0)[:, :, None] * way[None, :, :]
        found.append(np.sqrt(np.min(np.sum(off**2, axis=2), axis=1)))
    return np.concatenate(found)
