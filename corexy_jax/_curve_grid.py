"""A curve cut where something changes, and into short pieces, with its derivatives at their ends."""

import itertools
from typing import NamedTuple

import numpy as np

from stickslip.checks import refusal

from ._leg import LINES, STILL
from ._path import Path, derivatives

LOOKS = 400  # places of each part at which the directions are looked at
BISECTIONS = 60
INSIDE = 1e-9  # part of a piece by which its ends are looked at from within
LEAST = 4  # pieces of a part


class Grid(NamedTuple):
    """Pieces of a curve between `s`, `[piece + 1]`, and the `place` there.

    For each piece the sense of motion of every line, `[piece, line]`, 0 where the line stands still
    along all of it; first and second derivatives by s at both ends as seen from within,
    `[piece, end, axis]`. `parts`: numbers of the nodes at which senses or curvature change, with the
    ends.
    """

    s: np.ndarray
    place: np.ndarray
    senses: np.ndarray
    first: np.ndarray
    second: np.ndarray
    parts: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        return np.diff(self.s)


def cut(path: Path, steps: int) -> Grid:
    """The curve in about so many pieces, shorter towards the ends, where the collar is slow.

    Errors: `ValueError` for a curve that stands still or jumps.
    """
    bounds = [0.0]
    for low, high in itertools.pairwise((0.0, *path.jumps, path.end)):
        bounds += [*_turning(path, low, high), high]
    s, parts = [0.0], [0]
    for k, (low, high) in enumerate(itertools.pairwise(bounds)):
        count = max(LEAST, round(steps * (high - low) / path.end))
        u = np.linspace(0.0, 1.0, count + 1)[1:]
        # Quadratic towards the ends of the whole: even in time where the acceleration is.
        begins, ends = k == 0, k == len(bounds) - 2
        if begins and ends:
            u = u * u * (3.0 - 2.0 * u)
        elif begins:
            u = u * u
        elif ends:
            u = u * (2.0 - u)
        s += list(low + (high - low) * u)
        s[-1] = high
        parts.append(len(s) - 1)
    nodes = np.array(s)
    low, high = nodes[:-1], nodes[1:]
    off = INSIDE * (high - low)
    _, first, second = derivatives(path, np.concatenate([low + off, high - off]))
    _, middle, _ = derivatives(path, 0.5 * (low + high))
    place = derivatives(path, nodes)[0]
    first, second = (np.stack(np.split(a, 2), axis=1) for a in (first, second))
    sizes = np.linalg.norm(first, axis=2)
    if not np.all(np.isfinite(first) & np.isfinite(second)) or np.any(sizes <= 0.0):
        raise refusal("path", path, "a curve that nowhere stands still, with two derivatives")
    # A jump of the direction, of which the collar would need one of its speed.
    jump = np.linalg.norm(first[1:, 0] / sizes[1:, :1] - first[:-1, 1] / sizes[:-1, 1:], axis=1)
    bend = np.max(np.linalg.norm(second, axis=2)) * np.max(high - low) / np.min(sizes)
    if np.any(jump > 1e-6 * (1.0 + bend)):
        at = float(nodes[1 + int(np.argmax(jump))])
        raise refusal("path", path, f"a curve whose direction does not jump, as at s = {at:g}")
    senses = _senses(middle)
    for j, line in enumerate(LINES):
        # What stands still along a piece does so exactly.
        for i in np.flatnonzero(senses[:, j] == 0.0):
            for rows in (first, second):
                rows[i] -= np.outer(rows[i] @ line, line) / (line @ line)
    return Grid(nodes, place, senses, first, second, np.array(parts))


def _senses(first: np.ndarray) -> np.ndarray:
    turns = first @ LINES.T / np.linalg.norm(first, axis=1, keepdims=True)
    return np.where(np.abs(turns) < STILL, 0.0, np.sign(turns))


def _turning(path: Path, low: float, high: float) -> list[float]:
    """Where between two values of s a line comes to stand for an instant, increasing."""
    off = INSIDE * (high - low)
    s = np.linspace(low + off, high - off, LOOKS)
    senses = _senses(derivatives(path, s)[1])
    found = []
    for j in range(len(LINES)):
        row = senses[:, j]
        for i in np.flatnonzero(row[:-1] * row[1:] < 0.0):
            a, b, sense = s[i], s[i + 1], row[i]
            for _ in range(BISECTIONS):
                middle = 0.5 * (a + b)
                here = float(LINES[j] @ derivatives(path, middle)[1][0])
                a, b = (middle, b) if here * sense > 0.0 else (a, middle)
            found.append(0.5 * (a + b))
        for i in np.flatnonzero((row[1:-1] == 0.0) & (row[:-2] != 0.0)):
            if row[i + 2] != 0.0:
                found.append(s[i + 1])
    # A root that falls on a bound is the bound.
    return sorted(s for s in found if low + 10.0 * off < s < high - 10.0 * off)
