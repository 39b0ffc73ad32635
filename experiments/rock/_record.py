"""A record of a step of the speed, as it comes: a table of a laboratory."""

import pathlib
from typing import NamedTuple

import numpy as np

from .._data import find

NAME = "velstep4_BRAVA_expb819_basalt.txt"
ORIGIN = (
    "It belongs to P. Giacomel, D. Faulkner, V. Lambert, M. Allen, Geosphere 2024, 10.1130/GES02739.1 "
    "(MIT licence), with its repository."
)
HEADS = ("Time(s)", "Displ(microns)", "Friction", "Normal_stress(MPa)")
NEAR = 3.0  # so far from the step the displacement shows its time [s]


class Step(NamedTuple):
    """Time [s] and displacement [m] of the load point from the begin on, and the coefficient."""

    time: np.ndarray
    displacement: np.ndarray
    friction: np.ndarray


def load(folder: pathlib.Path | None, name: str = NAME) -> Step:
    """The record `name`. Errors: `MissingDataError`; `ValueError` for another format."""
    path = find(folder, "rsf_velocity_steps", name, ORIGIN)
    with path.open(encoding="utf-8") as lines:
        heads = tuple(next(lines, "").split())
    if heads != HEADS:
        raise ValueError(f"{path}: its first line must be {' '.join(HEADS)}.")
    try:
        table = np.loadtxt(path, skiprows=1, ndmin=2)
    except ValueError as error:
        raise ValueError(f"{path}: every line must be {len(HEADS)} numbers: {error}.") from None
    if not np.all(np.isfinite(table)) or np.any(np.diff(table[:, 0]) <= 0.0):
        raise ValueError(f"{path}: the numbers must be finite, and the times must increase.")
    return Step(table[:, 0] - table[0, 0], 1e-6 * (table[:, 1] - table[0, 1]), table[:, 2])


def step_of(step: Step) -> tuple[float, float, float]:
    """Time of the step [s], and the speeds before and after it [m/s], by the displacement alone.

    Two lines near the step, joined; further away the encoder jumps by whole micrometres.
    """
    import scipy.optimize  # few commands need it, and all import this file

    t, x = step.time, 1e6 * step.displacement
    speeds = _speeds(t, x)
    rough = float(t[np.argmax(speeds > 0.5 * (np.median(speeds[:50]) + np.median(speeds[-50:])))])
    near = np.abs(t - rough) < NEAR

    def miss(p):
        late = t[near] - rough - p[0]
        return p[1] + p[2] * np.minimum(late, 0.0) + p[3] * np.maximum(late, 0.0) - x[near]

    begin = [0.0, np.interp(rough, t, x), speeds[near][0], speeds[near][-1]]
    late, _, before, after = scipy.optimize.least_squares(miss, begin).x
    return rough + float(late), 1e-6 * float(before), 1e-6 * float(after)


def _speeds(t: np.ndarray, x: np.ndarray, over: float = 1.0) -> np.ndarray:
    """Mean speed over the time `over` [s] around each sample."""
    return (np.interp(t + over / 2, t, x) - np.interp(t - over / 2, t, x)) / over
