"""Names of the changes of a mode sequence: which of the sliding bifurcations it is."""

import difflib
from typing import Any

import jax
import numpy as np
from jax.flatten_util import ravel_pytree

from ..hybrid import AbstractHybridSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._point import Point


def kind_of(system: AbstractHybridSystem, one: Point, two: Point) -> str:
    """Name of the border between two orbits of different mode sequences; empty if it has none.

    By what the longer sequence has more than the shorter one (di Bernardo, Budd, Champneys and
    Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, chapter 8):

    - `crossing-sliding`: a stick between two slips of different directions, where the speed passes
      through zero;
    - `grazing-sliding`: a stick in the middle of a slip that goes on;
    - `switching-sliding`: a slip between another slip and a stick;
    - `adding-sliding`: a slip in the middle of a stick;
    - `grazing`: an impact, or a short visit to another mode that is as much of a slip.
    """
    short, long = sorted((one, two), key=lambda p: int(p.orbit.events.count))
    few, many = _cycle(short), _cycle(long)
    if len(few) == len(many):
        # Where a slip turns round anyway, at a wall, an impact is one event in place of another.
        return "grazing" if impacts(one) != impacts(two) else ""
    if len(many) > ACCURACY.samples:
        return ""
    # An orbit without events is in one mode: what is added begins and ends in it.
    alone = [] if few else [i for i in range(len(many)) if many[i - 1] == int(short.orbit.mode0)]
    added = [(alone[0], len(many))] if alone else _added_parts(few, many)
    if added is None:
        return ""
    jumps, lasts = _jumps(long), _lasts(long)
    kinds = {_kind_of_cut(system, many, i, j, jumps, lasts) for i, j in added}
    return kinds.pop() if len(kinds) == 1 else ""


def _kind_of_cut(
    system: Any, modes: list[int], at: int, count: int, jumps: np.ndarray, lasts: np.ndarray
) -> str:
    """Name of one part, or of the same part as it may be cut out as well a little earlier or later.

    Of slip, stick, slip the first two are what a slip lacks, or the last two; of stick, slip, stick,
    slip it is a stick or a slip that is new. That one is which lasts the shorter.
    """
    total = len(modes)
    found = []
    for shift in range(1 - count, count) if count < total else (0,):
        # The rest is the same where the modes at both ends of each such cut are.
        ends = range(shift) if shift > 0 else range(shift, 0)
        if all(modes[(at + k) % total] == modes[(at + k + count) % total] for k in ends):
            kind = _kind_of_part(system, modes, (at + shift) % total, count, jumps)
            inside = sum(float(lasts[(at + shift + k) % total]) for k in range(count - 1))
            found += [(inside, kind)] if kind else []
    return min(found)[1] if found else ""


def _lasts(point: Point) -> np.ndarray:
    """Time from each event to the next one [s]."""
    times = np.asarray(point.orbit.events.t)[: int(point.orbit.events.count)]
    return np.diff(np.append(times, times[0] + float(point.orbit.period)))


def _cycle(point: Point) -> list[int]:
    """Modes along the period, in the order of its events."""
    return np.asarray(point.orbit.events.mode_after)[: int(point.orbit.events.count)].tolist()


def _added_parts(few: list[int], many: list[int]) -> list[tuple[int, int]] | None:
    """Parts of the longer cycle that the shorter one lacks; None if that is not all the difference."""
    for k in range(len(few)):
        turned = few[k:] + few[:k]
        for first in range(len(many)):
            whole = many[first:] + many[:first]
            parts = difflib.SequenceMatcher(None, turned, whole, autojunk=False).get_opcodes()
            if all(part[0] in ("equal", "insert") for part in parts) and parts[0][0] == "equal":
                return [
                    ((part[3] + first) % len(many), part[4] - part[3])
                    for part in parts
                    if part[0] == "insert"
                ]
    return None


def _jumps(point: Point) -> np.ndarray:
    """Whether the state jumps, at each event."""
    log, size = point.orbit.events, np.asarray(point.anchor.extent)
    flat = jax.vmap(lambda y: ravel_pytree(y)[0])
    before, after = (np.asarray(flat(y)) for y in (log.y_before, log.y_after))
    return np.max(np.abs(after - before) / size, axis=1) > ENGINE.zero


def impacts(point: Point) -> int:
    """Events at which the state jumps."""
    return int(np.sum(_jumps(point)[: int(point.orbit.events.count)]))


def _kind_of_part(system: Any, modes: list[int], at: int, count: int, jumps: np.ndarray) -> str:
    """Name of one part that is added to a cycle of modes."""
    total = len(modes)
    places = [(at + i) % total for i in range(count)]
    if any(jumps[i] for i in places):
        return "grazing"
    # How many contacts stick: a mechanism names its modes by the state of each contact.
    held = [system.mode_names[mode].count("stick") for mode in modes]
    before = modes[at - 1] if count < total else modes[places[-1]]
    at_rest = held[at - 1] if count < total else held[places[-1]]
    inside = held[at]
    if count == 2 and modes[places[-1]] == before:
        return {1: "grazing-sliding", 0: "grazing", -1: "adding-sliding"}[
            int(np.sign(inside - at_rest))
        ]
    if count == 1:
        after = held[(at + 1) % total]
        if inside > at_rest and inside > after:
            return "crossing-sliding"
        if inside == at_rest < after or inside == after < at_rest:
            return "switching-sliding"
    return ""
