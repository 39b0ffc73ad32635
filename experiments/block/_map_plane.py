"""The plane of the map: how far followed curves may go, cells, and where lanes lie beside a curve."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

WIDER = 0.1  # of the map: so much farther curves are followed on each side


class Beside(NamedTuple):
    """Lanes beside a curve, one entry per lane.

    `distance` in cells; `side`: 1 to the left of the curve's direction, -1 to the right, 0 on it;
    `segment`: number of the point before the nearest one; `beyond`: nearest to an end, so that the
    curve says nothing.
    """

    distance: np.ndarray
    side: np.ndarray
    segment: np.ndarray
    beyond: np.ndarray


def bounds_of(parameters: Mapping[str, Any]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Of k3 [N/m] and the belt speed [m/s], wider than the map; neither falls below zero."""
    pairs = []
    for low, high in (("k3_min", "k3_max"), ("speed_min", "speed_max")):
        margin = WIDER * (parameters[high] - parameters[low])
        pairs.append((max(parameters[low] - margin, 0.0), parameters[high] + margin))
    return pairs[0], pairs[1]


def cell_of(k3: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Distance of two columns [N/m] and of two rows [m/s]."""
    return np.array([np.ptp(k3) / max(k3.size - 1, 1), np.ptp(speed) / max(speed.size - 1, 1)])


def beside(curve: np.ndarray, points: np.ndarray, cell: np.ndarray) -> Beside:
    """Where `points`, `[lane, 2]`, lie beside a curve, `[point, 2]`, joined by straight pieces."""
    nodes, places = curve / cell, points / cell
    closed = len(nodes) > 2 and np.linalg.norm(nodes[-1] - nodes[0]) < 1.0
    if len(nodes) < 2:
        nodes = np.concatenate([nodes, nodes])
    begin, chord = nodes[:-1], np.diff(nodes, axis=0)
    away = places[:, None, :] - begin
    length = np.maximum(np.sum(chord**2, axis=1), 1e-300)
    along = np.sum(away * chord, axis=2) / length
    left = away - np.clip(along, 0.0, 1.0)[..., None] * chord
    distances = np.linalg.norm(left, axis=2)
    nearest = np.argmin(distances, axis=1)
    rows = np.arange(len(places))
    cross = chord[nearest, 0] * away[rows, nearest, 1] - chord[nearest, 1] * away[rows, nearest, 0]
    before = (nearest == 0) & (along[rows, 0] < 0.0)
    after = (nearest == len(chord) - 1) & (along[rows, -1] > 1.0)
    beyond = (before | after) & (not closed)
    return Beside(distances[rows, nearest], np.sign(cross), nearest, beyond)
