"""Where a curve of special points meets another one: functions whose zeros these points are."""

from collections.abc import Callable

import numpy as np

from ._curve import Place
from ._follow import Point
from ._points import multipliers_of

Named = tuple[str, Callable[[Place], float]]


def folding(point: Point) -> float:
    """Area that the parameters see of the plane of orbits: zero where the plane is folded."""
    return float(np.linalg.det(point.tangent[:, -2:]))


def _multipliers(place: Place) -> np.ndarray:
    return multipliers_of(place.point.orbit)


def _without(found: np.ndarray, target: float) -> np.ndarray:
    """All multipliers but the one nearest to a number."""
    return np.delete(found, int(np.argmin(np.abs(found - target)))) if found.size else found


def _product(found: np.ndarray, root: float) -> float:
    return float(np.real(np.prod(found - root)))


def _pairs(found: np.ndarray) -> float:
    product = 1.0 + 0.0j
    for i in range(found.size):
        for j in range(i):
            product *= found[i] * found[j] - 1.0
    return float(np.real(product))


def _turn(place: Place) -> float:
    """Twice the cosine of the angle of the pair whose product is 1."""
    found = _multipliers(place)
    pairs = [(abs(a * b - 1.0), a + b) for i, a in enumerate(found) for b in found[:i]]
    return float(np.real(min(pairs, key=lambda p: p[0])[1]))


def passed_by(label: str) -> list[Named]:
    """Functions of a place, by name of their zero, at which the curve of a label goes on."""
    if label != "NS":
        return []
    return [
        ("R3: the pair is a third root of 1, resonance 1:3", lambda p: _turn(p) + 1.0),
        ("R4: the pair is a fourth root of 1, resonance 1:4", _turn),
    ]


def degenerate(label: str, before: Place) -> list[Named]:
    """Functions of a place, by name of their zero, at which the curve of a label ends."""
    if label == "LP":
        forward = before.way[-2:]
        return [
            # At a cusp the parameters turn back, while the curve goes on.
            ("CP: cusp, where two folds meet", lambda p: float(forward @ p.way[-2:])),
            ("LPPD: a multiplier is -1", lambda p: _product(_without(_multipliers(p), 1.0), -1.0)),
            ("R1: a second multiplier is 1", lambda p: _product(_without(_multipliers(p), 1.0), 1.0)),
            ("LPNS: a pair is on the unit circle", lambda p: _pairs(_without(_multipliers(p), 1.0))),
        ]
    if label == "PD":
        return [
            ("LPPD: a multiplier is 1", lambda p: _product(_multipliers(p), 1.0)),
            (
                "R2: a second multiplier is -1",
                lambda p: _product(_without(_multipliers(p), -1.0), -1.0),
            ),
            ("PDNS: a pair is on the unit circle", lambda p: _pairs(_without(_multipliers(p), -1.0))),
        ]
    if label == "NS":
        return [
            ("R1: the pair meets at 1, resonance 1:1", lambda p: _turn(p) - 2.0),
            ("R2: the pair meets at -1, resonance 1:2", lambda p: _turn(p) + 2.0),
        ]
    if label in ("GR", "SQ"):
        return [
            ("LP: a multiplier is 1", lambda p: _product(_multipliers(p), 1.0)),
            ("PD: a multiplier is -1", lambda p: _product(_multipliers(p), -1.0)),
        ]
    return []
