"""Simulated lanes of the map against the located curves."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from .._statement import Statement, Untold, Verdict, statement
from .._thresholds import BlockMap
from ._map import UNTOLD
from ._map_plane import beside, cell_of


class Beside(NamedTuple):
    """Lanes beside a curve, `[k3, V_b]`.

    `distance` [cells]; `side`: 1 where the orbit is unstable, -1 where it is stable, 0 beyond the
    ends; `period` [s] of the orbit on the curve nearby.
    """

    distance: np.ndarray
    side: np.ndarray
    period: np.ndarray


def beside_doublings(dataset: xr.Dataset) -> Beside:
    """Every lane beside the nearest curve of the basic orbit's doublings.

    Raises `Untold` where there is none that says on which side the orbit is stable.
    """
    best = None
    for number in _doublings(dataset):
        new = _beside(dataset, number)
        if best is None:
            best = new
        else:
            nearer = new.distance < best.distance
            best = Beside(*(np.where(nearer, a, b) for a, b in zip(new, best, strict=True)))
    if best is None:
        raise Untold(f"no curve of doublings of the orbit is known ({dataset.attrs['curves']})")
    return best


def _doublings(dataset: xr.Dataset) -> list[int]:
    """Curves of the basic orbit's doublings that have two sides."""
    of_it = np.asarray(dataset.curve_label).astype(str) == "PD"
    of_it &= np.asarray(dataset.curve_level) == 0
    sides = np.asarray(dataset.curve_side) != 0
    counts = np.bincount(np.asarray(dataset.along_curve), minlength=of_it.size)
    return np.flatnonzero(of_it & sides & (counts >= 2)).tolist()


def _beside(dataset: xr.Dataset, number: int) -> Beside:
    k3, speed = np.asarray(dataset.k3), np.asarray(dataset.V_b)
    cell, shape = cell_of(k3, speed), (k3.size, speed.size)
    lanes = np.stack(np.meshgrid(k3, speed, indexing="ij"), axis=-1).reshape(-1, 2)
    points = dataset.isel(along=np.flatnonzero(np.asarray(dataset.along_curve) == number))
    curve = np.stack([np.asarray(points.along_k3), np.asarray(points.along_V_b)], axis=1)
    start = np.array([float(dataset.curve_k3[number]), float(dataset.curve_V_b[number])])
    # A little from the start, towards the k3 of the side that is told.
    start[0] += 0.1 * float(dataset.curve_side[number]) * cell[0]
    told = beside(curve, start[None, :], cell).side[0]
    found = beside(curve, lanes, cell)
    side = np.where(found.beyond, 0.0, found.side * told)
    period = np.asarray(points.along_period)[found.segment]
    return Beside(*(a.reshape(shape) for a in (found.distance, side, period)))


def compared_lanes(dataset: xr.Dataset) -> tuple[np.ndarray, Beside, str]:
    """Settled lanes on a side of the curve, a cell from it or more; the others in words."""
    place = beside_doublings(dataset)
    motion = np.asarray(dataset.motion.transpose("k3", "V_b"))
    near = (place.side != 0) & (place.distance < BlockMap.NEAR)
    slow = (place.side != 0) & ~near & (motion <= UNTOLD)
    words = f"apart: {int(near.sum())} lanes nearer than a cell, {int(slow.sum())} not settled"
    return (place.side != 0) & ~near & ~slow, place, words


def basic(dataset: xr.Dataset, place: Beside, turns: int = 1) -> np.ndarray:
    """Whether each lane has so many points per period and so many times the period of the orbit."""
    motion, seconds = (np.asarray(dataset[k].transpose("k3", "V_b")) for k in ("motion", "seconds"))
    ratio = np.where(np.isfinite(seconds), seconds, 0.0) / (turns * place.period)
    return (motion == turns) & (np.abs(ratio - 1.0) < BlockMap.SAME_PERIOD)


@statement("X3", "Where the curve of doublings says that the basic orbit is unstable, no lane has it.")
def unstable_is_not_simulated(dataset: xr.Dataset) -> Verdict:
    """Lanes of the basic orbit on the unstable side of the curve."""
    compared, place, words = compared_lanes(dataset)
    there = compared & (place.side > 0)
    if there.sum() < BlockMap.FEWEST:
        raise Untold(f"{int(there.sum())} lanes lie there")
    has = int((there & basic(dataset, place)).sum())
    return has == 0, f"{has} of {int(there.sum())} lanes have it; {words}"


@statement(
    "X4",
    "The curve of doublings parts the lanes of the basic orbit from those of twice its period.",
)
def periods_are_parted(dataset: xr.Dataset) -> Verdict:
    """Share of the lanes of one and of two periods that lie on the right side."""
    compared, place, words = compared_lanes(dataset)
    one, two = (compared & basic(dataset, place, turns) for turns in (1, 2))
    if min(one.sum(), two.sum()) < BlockMap.FEWEST:
        raise Untold(f"{int(one.sum())} lanes have one period, {int(two.sum())} two")
    wrong = [int((one & (place.side > 0)).sum()), int((two & (place.side < 0)).sum())]
    share = 1.0 - sum(wrong) / int(one.sum() + two.sum())
    text = f"{wrong[0]} of {int(one.sum())} lanes of one period, {wrong[1]} of {int(two.sum())} of two "
    text += f"on the wrong side, {share:.2%} agree; {words}"
    return share >= BlockMap.AGREE, text


@statement(
    "X5",
    "The curve of doublings, begun at another belt speed, goes through the doublings that a branch "
    "finds at the paper's.",
)
def goes_through_the_paper(dataset: xr.Dataset) -> Verdict:
    """Differences of k3 at the paper's belt speed."""
    branch, curve = np.asarray(dataset.paper_by_branch), np.asarray(dataset.paper_by_curve)
    if not branch.size:
        raise Untold(f"no doubling at the paper's belt speed is known ({dataset.attrs['curves']})")
    away = np.abs(branch - curve)
    pairs = ", ".join(f"{b:.6f} and {c:.6f}" for b, c in zip(branch, curve, strict=True))
    return bool(np.all(away <= BlockMap.LOCATED)), f"k3 by the branch and by the curve: {pairs}"


def judge_map(dataset: xr.Dataset) -> list[Statement]:
    """X3, X4 and X5."""
    each = (unstable_is_not_simulated, periods_are_parted, goes_through_the_paper)
    return [claim("", dataset) for claim in each]
