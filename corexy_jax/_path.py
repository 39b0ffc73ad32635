"""Curves that the collar may follow."""

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from stickslip.checks import (
    Given,
    Numeric,
    check_callable,
    check_finite,
    check_known,
    check_type,
    one_concrete,
    one_row,
    refusal,
    shape_refusal,
)

Points = Sequence[Sequence[float]] | np.ndarray | Array
MOST_TURNS = 1e3  # of an arc [rad]
SAME = 1e-9  # part of the largest coordinate below which two points are one
STRAIGHT = 1e-9  # turn of a corner [rad] below which there is none


class Path:
    r"""A curve $r(s)$ in the plane, from $s = 0$ to `end`.

    >>> quarter = Path.arc((0.0, 0.0), 0.1, 0.2, 0.5)
    >>> [round(float(c), 4) for c in quarter.function(0.0)]
    [0.098, 0.0199]
    >>> round(quarter.end, 4)
    0.05

    **Arguments**

    - `function(s)`: x and y [m], written with `jax.numpy`; twice differentiable but at the `jumps`.
      $s$ is the way along the curve [m] or any other parameter along which it never stands still.
    - `end`: of $s$, which begins with 0.
    - `jumps`: increasing values of $s$ at which the curvature jumps, as where an arc begins.

    `Path.through` is a smooth curve through points, `Path.rounded` a chain of lines with round corners,
    `Path.arc` a part of a circle.

    **Raises** `TypeError`, `ValueError` for anything else.
    """

    def __init__(
        self,
        function: Given[Callable[[Any], Any]],
        end: Numeric,
        jumps: Given[Sequence[float] | np.ndarray] = (),
    ):
        self.function = check_callable("function", function, "f(s)", 0.0)
        self.end = float(one_concrete("end", end, "positive"))
        check_type("jumps", jumps, tuple | list | np.ndarray, "a row of numbers")
        if len(jumps):
            check_finite("jumps", one_row("jumps", jumps, least=1))
        self.jumps = tuple(float(s) for s in jumps)
        inside = (0.0, *self.jumps, self.end)
        if any(not b > a for a, b in itertools.pairwise(inside)):
            raise refusal("jumps", jumps, f"increasing, above 0 and below end = {self.end}")
        self.jets = jax.jit(jax.vmap(self._jet))

    def __repr__(self) -> str:
        return f"Path(of {self.end:.6g}, with {len(self.jumps)} jumps of its curvature)"

    def _place(self, s: Any) -> Any:
        place = jnp.stack([jnp.asarray(c, jnp.float64) for c in self.function(s)])
        if place.shape != (2,):
            raise shape_refusal("function(s)", place, "x and y, two numbers")
        return place

    def _jet(self, s: Any) -> Any:
        one = jnp.ones_like(s)
        first = lambda s: jax.jvp(self._place, (s,), (one,))[1]  # noqa: E731
        return self._place(s), *jax.jvp(first, (s,), (one,))

    @classmethod
    def arc(
        cls, centre: Given[Sequence[float]], radius: Numeric, start: Numeric, turn: Numeric
    ) -> "Path":
        """A part of a circle about `centre` [m] with the `radius` [m], from the angle `start` [rad] by
        `turn` [rad], to the left if it is positive. **Raises** `TypeError`, `ValueError` for anything
        else."""
        check_finite("centre", centre)
        middle = np.asarray(centre, np.float64)
        if middle.shape != (2,):
            raise shape_refusal("centre", centre, "x and y, two numbers")
        size = float(one_concrete("radius", radius, "positive"))
        first, by = (float(one_concrete(n, a, "finite")) for n, a in (("start", start), ("turn", turn)))
        if not 0.0 < abs(by) <= MOST_TURNS:
            raise refusal("turn", turn, f"not zero, and up to {MOST_TURNS}")

        def place(s):
            angle = first + np.sign(by) * s / size
            return middle[0] + size * jnp.cos(angle), middle[1] + size * jnp.sin(angle)

        return cls(place, size * abs(by))

    @classmethod
    def through(cls, points: Given[Points]) -> "Path":
        """The cubic spline through `points` [m], `[point, 2]`, over the length of the chords; its ends
        are straight. **Raises** `TypeError`, `ValueError` for anything else."""
        from scipy.interpolate import CubicSpline  # few need it

        rows = rows_of_points("points", points)
        s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1)))
        table = jnp.asarray(CubicSpline(s, rows, bc_type="natural").c)  # [power, piece, 2]
        begins = jnp.asarray(s[:-1])

        def place(at):
            piece = jnp.maximum(
                jnp.searchsorted(begins, jax.lax.stop_gradient(at), side="right") - 1, 0
            )
            a, b, c, d = table[:, piece]
            h = at - begins[piece]
            x, y = d + h * (c + h * (b + h * a))
            return x, y

        return cls(place, s[-1])

    @classmethod
    def rounded(cls, points: Given[Points], radius: Numeric) -> "Path":
        """Straight lines from point to point, `[point, 2]` [m], whose corners are arcs with the
        `radius` [m]. Where the last point is the first, all corners are round: the path begins and ends
        within the first line. **Raises** `TypeError`, `ValueError` for anything else, and
        where two arcs need more than the line between them."""
        rows, size = rows_of_points("points", points), float(one_concrete("radius", radius, "positive"))
        if len(rows) > 2 and np.linalg.norm(rows[-1] - rows[0]) <= SAME * np.abs(rows).max():
            begin = _within_first_line(rows[:-1], size)
            rows = np.vstack([begin, rows[1:-1], rows[0], begin])
        ways = np.diff(rows, axis=0)
        lengths = np.linalg.norm(ways, axis=1)
        along = ways / lengths[:, None]
        turns = [_turn(a, b) for a, b in itertools.pairwise(along)]
        if any(abs(turn) > np.pi - 1e-6 for turn in turns):
            raise refusal("points", rows.tolist(), "points at none of which the path turns back")
        cuts = np.array([0.0, *(size * np.tan(0.5 * abs(turn)) for turn in turns), 0.0])
        left = lengths - cuts[:-1] - cuts[1:]
        if np.any(left < -1e-12 * lengths):
            k = int(np.argmin(left))
            raise refusal("radius", size, f"so small that the corners fit on the line from points[{k}]")
        parts: list[tuple[float, np.ndarray, np.ndarray, float]] = []
        for k, (begin, d) in enumerate(zip(rows, along, strict=False)):
            if left[k] > 1e-12 * lengths[k]:
                parts.append((left[k], begin + cuts[k] * d, d, 0.0))
            if k < len(turns) and abs(turns[k]) > STRAIGHT:
                corner = rows[k + 1] - cuts[k + 1] * d
                parts.append((size * abs(turns[k]), corner, d, np.sign(turns[k]) / size))
        s = np.append(0.0, np.cumsum([part[0] for part in parts]))
        begins, places, directions, bends = (
            jnp.asarray(np.array(a)) for a in (s[:-1], *list(zip(*parts, strict=True))[1:])
        )

        def place(at):
            part = jnp.maximum(jnp.searchsorted(begins, jax.lax.stop_gradient(at), side="right") - 1, 0)
            h, d, bend = at - begins[part], directions[part], bends[part]
            safe = jnp.where(bend == 0.0, 1.0, bend)
            ahead = jnp.where(bend == 0.0, h, jnp.sin(safe * h) / safe)
            aside = jnp.where(bend == 0.0, 0.0, (1.0 - jnp.cos(safe * h)) / safe)
            x, y = places[part]
            return x + ahead * d[0] - aside * d[1], y + ahead * d[1] + aside * d[0]

        return cls(place, s[-1], s[1:-1])


def _within_first_line(corners: np.ndarray, radius: float) -> np.ndarray:
    """The middle of what the arcs at both of its ends leave of the first line of a closed chain."""
    before, line, after = (
        corners[0] - corners[-1],
        corners[1] - corners[0],
        corners[2 % len(corners)] - corners[1],
    )
    length = np.linalg.norm(line)
    cuts = [radius * np.tan(0.5 * abs(_turn(a, b))) for a, b in ((before, line), (line, after))]
    return corners[0] + 0.5 * (length + cuts[0] - cuts[1]) * line / length


def derivatives(path: Path, s: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places and their first and second derivatives by s, `[row, 2]` each."""
    one, two, three = (np.asarray(a) for a in path.jets(jnp.atleast_1d(jnp.asarray(s, jnp.float64))))
    return one, two, three


def _turn(a: np.ndarray, b: np.ndarray) -> float:
    """Angle [rad] from one direction to another."""
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


def rows_of_points(name: str, points: Any) -> np.ndarray:
    """Points `[point, 2]`, at least two, none where the one before it is."""
    check_known(name, points)
    check_finite(name, points)
    found = np.asarray(points, np.float64)
    if found.ndim != 2 or found.shape[0] < 2 or found.shape[1] != 2:
        raise shape_refusal(name, points, "of shape [point, 2], at least two points")
    for i, (a, b) in enumerate(itertools.pairwise(found)):
        if not np.linalg.norm(b - a) > 0.0:
            raise refusal(f"{name}[{i + 1}]", b.tolist(), "another place than the point before it")
    return found
