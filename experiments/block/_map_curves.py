"""Curves of special points of the block's orbits over k3 and the belt speed."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from stickslip.continuation import (
    Branch,
    BranchPoint,
    Follow,
    Shooting,
    continue_point,
)

from ._branches import precise
from ._map import system_at
from ._map_branches import LEAP, basic_branch, doubled_branches, side_of, trusted
from ._map_plane import beside, bounds_of, cell_of

FOLLOWED = ("PD", "LP", "NS", "GR")  # points of a branch whose curves are followed
PLANE = ("k3", "V_b")
AT = 0.1  # cells from a curve at which a point is on it
ALONG = ("curve", *PLANE, "period", "largest")
CURVE = ("label", "level", *PLANE, "side")
TIP = ("curve", *PLANE, "words")
UNITS = {"k3": "N/m", "V_b": "m/s", "period": "s", "by_branch": "N/m", "by_curve": "N/m"}


@dataclasses.dataclass(frozen=True)
class Followed:
    """A curve, the point at which it starts, and how many doublings led to its orbits.

    `side`: towards which k3, 1 or -1, the orbits of its branch are unstable at the start; of a fold,
    towards which k3 there are orbits; 0 where that is not one side.
    """

    curve: Branch
    start: BranchPoint
    level: int
    side: int


def followed(motions: xr.Dataset, parameters: Mapping[str, Any]) -> xr.Dataset:
    """Curves along `along` and `curve`, their ends along `tip`, doublings at the paper's speed.

    Branches over k3 at the belt speed `curve_speed`, of the basic orbit and of so many doublings, show
    the special points from which the curves are followed. Along `paper` are the doublings of the basic
    orbit at the paper's belt speed: `paper_by_branch` k3 by a branch at that speed, `paper_by_curve` k3
    at which the nearest curve comes to that speed, NaN where none does.

    Where no lane leads to an orbit there are none, and the attribute `curves` says so.
    """
    speed = parameters["curve_speed"]
    try:
        branch = basic_branch(motions, speed, parameters)
    except LookupError as reason:
        return as_table([], [], speed).assign_attrs(curves=f"none: {reason}")
    found = _curves(motions, branch, parameters)
    pairs = _at_the_paper_speed(motions, branch, parameters)
    counted = f"{len(found)} followed from branches at the belt speed {speed:g} m/s"
    return as_table(found, pairs, speed).assign_attrs(curves=counted)


def _curves(motions: xr.Dataset, basic: Branch, parameters) -> list[Followed]:
    speed, cell = parameters["curve_speed"], cell_of(motions.k3.values, motions.V_b.values)
    found: list[Followed] = []
    branches = [basic]
    for level in range(parameters["doublings"] + 1):
        for branch in branches:
            for point in trusted(branch):
                if point.label not in FOLLOWED or _met(found, point, speed, cell):
                    continue
                if point.label == "LP" and _is_birth(found, point, speed, cell):
                    continue
                curve = _curve(point, speed, parameters)
                if curve is not None:
                    found.append(Followed(curve, point, level, side_of(branch, point)))
        if level < parameters["doublings"]:
            branches = list(doubled_branches(motions, speed, 2 ** (level + 1), parameters))
    return found


def _met(found: list[Followed], point: BranchPoint, speed: float, cell: np.ndarray) -> bool:
    """Whether a curve of the same orbits already goes through a point."""
    for one in found:
        if one.curve.label != point.label:
            continue
        place = beside(one.curve.values, np.array([[point.value, speed]]), cell)
        period = float(np.asarray(one.curve.orbits.period)[place.segment[0]])
        if place.distance[0] < 1.0 and abs(float(point.orbit.period) / period - 1.0) < LEAP:
            return True
    return False


def _is_birth(found: list[Followed], point: BranchPoint, speed: float, cell: np.ndarray) -> bool:
    """Whether the parameter turns at a point because there the orbits are born by a doubling."""
    here = np.array([[point.value, speed]])
    return any(
        one.curve.label == "PD" and beside(one.curve.values, here, cell).distance[0] < AT
        for one in found
    )


def _curve(point: BranchPoint, speed: float, parameters, **options: Any) -> Branch | None:
    """The curve through a point at a belt speed; None where none can be followed."""
    system = system_at(parameters["friction"], point.value, speed)
    bounds = options.pop("bounds", bounds_of(parameters))
    follow = Follow(parameters["curve_step"], parameters["curve_points"], **options)
    shooting = Shooting(integrator=precise(parameters))
    try:
        return continue_point(system, point, PLANE, bounds, follow=follow, shooting=shooting)
    except ValueError:
        return None


def paper_speed(friction: str) -> float:
    """Belt speed of set A [m/s]."""
    return float(type(system_at(friction, 85.0, 1.0)).constructed(85.0).V_b)


def _at_the_paper_speed(motions, basic: Branch, parameters) -> list[tuple[float, float]]:
    """k3 of each doubling at the paper's speed by a branch, and by curves from another speed."""
    speed, wanted = parameters["curve_speed"], paper_speed(parameters["friction"])
    k3, (low, high) = bounds_of(parameters)
    if not low < wanted < high or wanted == speed:
        return []
    try:
        branch = basic_branch(motions, wanted, parameters)
    except LookupError:
        return []
    # The bound on the belt speed is met exactly: there the curve ends.
    options = {
        "bounds": (k3, (low, wanted) if speed < wanted else (wanted, high)),
        "both": speed > wanted,
    }
    curves = [_curve(p, speed, parameters, **options) for p in trusted(basic) if p.label == "PD"]
    ends = [end for curve in curves if curve is not None for end in curve.ends]
    met = np.array([end.values[0] for end in ends if abs(end.values[1] - wanted) < 1e-12 * wanted])
    pairs = []
    for point in trusted(branch):
        if point.label == "PD":
            away = np.abs(met - point.value)
            pairs.append((point.value, float(met[np.argmin(away)]) if met.size else np.nan))
    return pairs


def as_table(found: list[Followed], pairs: list[tuple[float, float]], speed: float) -> xr.Dataset:
    """Points of all curves along `along`, the curves along `curve`, their ends along `tip`."""
    along: list[tuple] = []
    curves: list[tuple] = []
    tips: list[tuple] = []
    for number, one in enumerate(found):
        curve = one.curve
        sizes = np.abs(np.asarray(curve.orbits.multipliers)).max(axis=1)
        rows = zip(curve.values, np.asarray(curve.orbits.period), sizes, strict=True)
        along += [(number, *values, period, size) for values, period, size in rows]
        curves.append((curve.label, one.level, one.start.value, speed, one.side))
        tips += [(number, *end.values, end.words) for end in curve.ends]
    return xr.Dataset({
        **_columns("along", ALONG, along),
        **_columns("curve", CURVE, curves),
        **_columns("tip", TIP, tips),
        **_columns("paper", ("by_branch", "by_curve"), pairs),
    })  # fmt: skip


def _columns(axis: str, keys: tuple[str, ...], rows: list[tuple]) -> dict[str, tuple]:
    kinds = {"curve": int, "level": int, "side": int, "label": str, "words": str}
    return {
        f"{axis}_{key}": (
            axis,
            np.array([row[i] for row in rows], dtype=kinds.get(key, float)),
            {"units": UNITS[key]} if key in UNITS else {},
        )
        for i, key in enumerate(keys)
    }
