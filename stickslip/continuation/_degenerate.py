"""Where a curve of special points meets another one: functions whose zeros these points are."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from ._family import Test
from ._point import Point
from ._points import multipliers_of


def folding(point: Point) -> float:
    """Area that the parameters see of the plane of orbits: zero where the plane is folded."""
    return float(np.linalg.det(point.tangent[:, -2:]))


def _multipliers(place: Any) -> np.ndarray:
    return multipliers_of(place.point.orbit)


def _without(found: np.ndarray, target: float) -> np.ndarray:
    """All multipliers but the one nearest to a number."""
    return np.delete(found, int(np.argmin(np.abs(found - target)))) if found.size else found


def _pairs(found: np.ndarray) -> float:
    # A product over all pairs is smooth where two of them change places; a single pair is not.
    product = 1.0 + 0.0j
    for i in range(found.size):
        for j in range(i):
            product *= found[i] * found[j] - 1.0
    return float(np.real(product))


def _turn(place: Any) -> float:
    """Twice the cosine of the angle of the pair whose product is 1."""
    found = _multipliers(place)
    pairs = [(abs(a * b - 1.0), a + b) for i, a in enumerate(found) for b in found[:i]]
    return float(np.real(min(pairs, key=lambda p: p[0])[1]))


def degenerate(label: str, before: Any) -> list[Test]:
    """Tests of a place behind another one, at which the curve of a label ends, or which it passes."""

    def others(target: float) -> Callable[[Any], np.ndarray]:
        return lambda place: _without(_multipliers(place), target)

    def product(found: Callable[[Any], np.ndarray], root: float) -> Callable[[Any], float]:
        return lambda place: float(np.real(np.prod(found(place) - root)))

    def pairs(found: Callable[[Any], np.ndarray]) -> Callable[[Any], float]:
        return lambda place: _pairs(found(place))

    ends = functools.partial(Test, ends=True)
    if label == "LP":
        forward = before.rates
        return [
            # At a cusp the parameters turn back, while the curve goes on.
            ends("CP", lambda place: float(forward @ place.rates), "cusp, where two folds meet"),
            ends("LPPD", product(others(1.0), -1.0), "a multiplier is -1"),
            ends("R1", product(others(1.0), 1.0), "a second multiplier is 1"),
            ends("LPNS", pairs(others(1.0)), "a pair is on the unit circle"),
        ]
    if label == "PD":
        return [
            ends("LPPD", product(_multipliers, 1.0), "a multiplier is 1"),
            ends("R2", product(others(-1.0), -1.0), "a second multiplier is -1"),
            ends("PDNS", pairs(others(-1.0)), "a pair is on the unit circle"),
        ]
    if label == "NS":
        return [
            ends("R1", lambda place: _turn(place) - 2.0, "the pair meets at 1, resonance 1:1"),
            ends("R2", lambda place: _turn(place) + 2.0, "the pair meets at -1, resonance 1:2"),
            Test(
                "R3", lambda place: _turn(place) + 1.0, "the pair is a third root of 1, resonance 1:3"
            ),
            Test("R4", _turn, "the pair is a fourth root of 1, resonance 1:4"),
        ]
    if label in ("GR", "SQ"):
        return [
            ends("LP", product(_multipliers, 1.0), "a multiplier is 1"),
            ends("PD", product(_multipliers, -1.0), "a multiplier is -1"),
        ]
    return []
