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
    refusal,
    shape_refusal,
    whole_number,
)


def contour_errors(
    points: Given[Sequence[Any] | np.ndarray | Array],
    x: Row,
    y: Row,
    lines: Given[Row | None] = None,
    beside: int = 8,
) -> Float[np.ndarray, " place"]:
    """Distance of each place of the head from the nearest of the lines between `points` [m].

    It says nothing about when the head is there: being late along a line is no error of the contour.

    **Arguments**

    - `points` [m]: `[point, 2]`, at least two; `x`, `y` [m]: rows of places, of the same length.
    - `lines`: for each place the number of the line, from 0, that the head follows there. Only this one
      and those `beside` it, on either side, are looked at, so that a line of another time that happens
      to be nearer does not count. By default all are.

    **Raises** `TypeError`, `ValueError` naming the argument. It reads numbers and does not work under
    `jit`.
    """
    corners = numbers("points", check_known("points", check_finite("points", points))).astype(
        np.float64
    )
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 2:
        raise shape_refusal("points", points, "of shape [point, 2], at least two points")
    beside, last = whole_number("beside", beside, 0, 1000), len(corners) - 2
    rows = {"x": x, "y": y} | ({} if lines is None else {"lines": lines})
    given = {}
    for name, row in rows.items():
        row = one_row(name, check_known(name, check_finite(name, row)))
        given[name] = numbers(name, row).astype(np.float64)
        if given[name].shape != given["x"].shape:
            raise shape_refusal(name, rows[name], f"of shape {given['x'].shape}, as x")
    if lines is None:
        near = np.broadcast_to(np.arange(last + 1), (given["x"].size, last + 1))
    else:
        if not np.all((given["lines"] % 1.0 == 0.0) & (given["lines"] >= 0) & (given["lines"] <= last)):
            raise refusal("lines", lines, f"numbers of lines, integers from 0 to {last}")
        near = given["lines"].astype(int)[:, None] + np.arange(-beside, beside + 1)[None, :]
        near = np.clip(near, 0, last)
    places = np.stack([given["x"], given["y"]], axis=1)
    parts = max(near.size // 2_000_000, 1)
    found = [
        _distances(corners, *part)
        for part in zip(np.array_split(places, parts), np.array_split(near, parts), strict=True)
    ]
    return np.concatenate(found)


def _distances(corners: np.ndarray, places: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Of each of `places` from the nearest of its own lines, whose numbers are a row of `near`."""
    begin, way = corners[near], corners[near + 1] - corners[near]
    square = np.sum(way**2, axis=2)
    away = places[:, None, :] - begin
    along = np.sum(away * way, axis=2) / np.where(square > 0.0, square, 1.0)
    off = away - np.clip(along, 0.0, 1.0)[:, :, None] * way
    return np.sqrt(np.min(np.sum(off**2, axis=2), axis=1))
