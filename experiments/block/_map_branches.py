"""Branches over k3 at one belt speed, from a lane of the map, and what of them is to be trusted."""

from collections.abc import Iterator, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray as xr

from stickslip.continuation import (
    Branch,
    BranchPoint,
    Follow,
    OrbitGuess,
    Shooting,
    continue_orbit,
)
from stickslip.systems import BlockState

from ._branches import precise
from ._map import system_at
from ._map_plane import bounds_of

# Two orbits of a branch whose periods differ by more than this part are not neighbours.
LEAP = 0.1
TRIES = 20  # lanes that a branch is tried from
BEYOND = 2.0  # columns: so much farther than its lanes a branch of doubled orbits is followed


def basic_branch(motions: xr.Dataset, speed: float, parameters: Mapping[str, Any]) -> Branch:
    """The branch over k3 from a settled lane near the belt speed [m/s].

    Raises `LookupError` where none of the first lanes leads to a branch.
    """
    options = _options(parameters, parameters["step"])
    for k3, guess in _guesses(motions, speed):
        system = system_at(parameters["friction"], k3, speed)
        try:
            branch = continue_orbit(system, guess, "k3", **options)
            for end in branch["EP"]:
                # Of a doubled orbit: it ends at the orbit itself, whose branch is followed instead.
                if end.words.startswith("repeats"):
                    branch = continue_orbit(system, end, "k3", **options)
                    break
        except ValueError:
            continue
        return branch
    raise LookupError(f"no lane near the belt speed {speed:g} m/s leads to a branch of orbits")


def doubled_branches(
    motions: xr.Dataset, speed: float, turns: int, parameters: Mapping[str, Any]
) -> Iterator[Branch]:
    """Branches over k3 of orbits of so many `turns`, one for each interval of lanes that have them.

    Each is followed a little beyond its interval, where the orbit loses its stability or ends. Farther
    on it may be so unstable that each step is a struggle.
    """
    row = motions.sel(V_b=speed, method="nearest")
    motion, k3 = np.asarray(row.motion), np.asarray(row.k3)
    seconds = np.asarray(row.seconds)
    low, high = bounds_of(parameters)[0]
    margin = BEYOND * float(np.ptp(k3)) / max(k3.size - 1, 1)
    for begin, end in intervals(motion == turns):
        middle = (begin + end) // 2
        # Orbits of two families side by side, told by their periods.
        if np.any(np.abs(np.diff(seconds[begin : end + 1])) > LEAP * seconds[middle]):
            continue
        system = system_at(parameters["friction"], float(k3[middle]), speed)
        options = _options(parameters, parameters["fine_step"])
        options["bounds"] = max(k3[begin] - margin, low), min(k3[end] + margin, high)
        try:
            branch = continue_orbit(system, _guess(row, middle), "k3", **options)
        except ValueError:  # no orbit there, or not this near the lane's
            continue
        yield branch


def intervals(wanted: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def trusted(branch: Branch) -> Iterator[BranchPoint]:
    """Special points of a branch up to where it leaps to another one: there its period does."""
    periods = np.asarray(branch.orbits.period)
    leaps = np.abs(np.diff(periods)) > LEAP * periods[:-1]
    last = int(np.argmax(leaps)) if leaps.any() else len(periods)
    for point in branch.specials:
        near = abs(float(point.orbit.period) - periods[point.index]) <= LEAP * periods[point.index]
        if near and point.index < last:
            yield point


def side_of(branch: Branch, point: BranchPoint) -> int:
    """Towards which k3, 1 or -1, the orbits of a branch are unstable beside one of its points.

    Of a fold, towards which k3 there are orbits. 0 where that is not one side.
    """
    if not 0 <= point.index < len(branch) - 1:
        return 0
    at = [point.index, point.index + 1]
    stable, k3 = np.asarray(branch.orbits.stable)[at].astype(bool), branch.values[at]
    if point.label == "LP":
        sides = np.sign(k3 - point.value)
        return int(sides[0]) if sides[0] == sides[1] else 0
    if stable[0] == stable[1]:
        return 0
    return int(np.sign(k3[int(stable[0])] - k3[int(stable[1])]))


def _guesses(motions: xr.Dataset, speed: float) -> Iterator[tuple[float, OrbitGuess]]:
    """Settled lanes of the nearest belt speed, those of the fewest points and lowest k3 first."""
    row = motions.sel(V_b=speed, method="nearest")
    motion, seconds = np.asarray(row.motion), np.asarray(row.seconds)
    periodic = np.flatnonzero((motion > 0) & np.isfinite(seconds))
    for i in periodic[np.argsort(motion[periodic], kind="stable")][:TRIES]:
        yield float(row.k3[i]), _guess(row, i)


def _guess(row: xr.Dataset, i: int) -> OrbitGuess:
    ends = (jnp.asarray(float(row[f"end_{name}"][i])) for name in BlockState._fields)
    return OrbitGuess(BlockState(*ends), float(row.seconds[i]))


def _options(parameters: Mapping[str, Any], step: float) -> dict[str, Any]:
    return {
        "bounds": bounds_of(parameters)[0],
        "follow": Follow(step=step, max_points=parameters["max_orbits"]),
        "shooting": Shooting(integrator=precise(parameters)),
    }
