"""Records of the double pendulum under torques in both joints, as they come: tables of the bench."""

import pathlib
from typing import Any, NamedTuple

import numpy as np

from .._data import find

NAME = "design_C.0_20220914_trajectory_{:02d}.csv"
ORIGIN = (
    "It belongs to F. Wiebe et al., Open Source Dual-Purpose Acrobot and Pendubot Platform, IEEE "
    "Robotics & Automation Magazine 31, 2024, 10.1109/MRA.2023.3341257 (BSD licence), with its "
    "repository."
)
COLUMNS = ("time", "pos_meas1", "pos_meas2", "tau_meas1", "tau_meas2")
ORDER = 4  # of the filter
STEP = 2e-3  # [s]; a few stamps are late, by up to 3.5 ms


class Motion(NamedTuple):
    """Angles `q` [rad] of the first joint from where it hangs and of the second from the first link,
    and torques `tau` [N m] by the currents of the motors, two rows each, in steps of 2 ms."""

    q: np.ndarray
    tau: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """From the begin of the record [s]."""
        return STEP * np.arange(self.q.shape[1])

    def until(self, end: float) -> "Motion":
        """Its part up to the time `end` [s]."""
        count = round(end / STEP)
        return Motion(self.q[:, :count], self.tau[:, :count])


def load(folder: pathlib.Path | None, number: int) -> Motion:
    """The record of a trajectory. Errors: `MissingDataError`; `ValueError` for another format."""
    path = find(folder, "dfki_double_pendulum", NAME.format(number), ORIGIN)
    with path.open(encoding="utf-8") as lines:
        heads = next(lines, "").strip().split(",")
    lost = [name for name in COLUMNS if name not in heads]
    if lost:
        raise ValueError(f"{path}: it must have the columns {', '.join(lost)}.")
    try:
        table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        raise ValueError(f"{path}: every line must be {len(heads)} numbers: {error}.") from None
    time, *rows = (table[:, heads.index(name)] for name in COLUMNS)
    if not np.all(np.isfinite(table)) or np.any(np.diff(time) <= 0.0):
        raise ValueError(f"{path}: the numbers must be finite, and the times must increase.")
    if np.median(np.diff(time)) > 1.01 * STEP:
        raise ValueError(f"{path}: the times must rise in steps of {STEP} s.")
    even = STEP * np.arange(int((time[-1] - time[0]) / STEP))
    q1, q2, tau1, tau2 = (np.interp(even, time - time[0], row) for row in rows)
    return Motion(np.stack([q1, q2]), np.stack([tau1, tau2]))


def low_passed(rows: np.ndarray, cut_off: float) -> np.ndarray:
    """Rows of samples without what is faster than `cut_off` [Hz], filtered forwards and backwards."""
    # Here: every command imports this file, and few need this.
    import scipy.signal

    taps: Any = scipy.signal.butter(ORDER, 2.0 * cut_off * STEP)
    return scipy.signal.filtfilt(taps[0], taps[1], rows)
