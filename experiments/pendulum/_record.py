"""The record of a pendulum that swings out: segments of one decay, as they come."""

import pathlib
from typing import NamedTuple

import numpy as np

from .._data import find

NAME = "SinglePendulumDataForParameterEstimation.mat"
ORIGIN = (
    "It belongs to K. Kaheman, U. Fasel, J. J. Bramburger, B. Strom, J. N. Kutz, S. L. Brunton, The "
    "Experimental Multi-Arm Pendulum on a Cart, arXiv 2205.06231 (MIT licence), with its repository."
)
STEP = 1e-3  # [s]


class Segment(NamedTuple):
    """Angle `phi` [rad] from where the pendulum hangs and its velocity `v_phi` [rad/s], each 1 ms."""

    phi: np.ndarray
    v_phi: np.ndarray


def load(folder: pathlib.Path | None, name: str = NAME) -> tuple[list[Segment], list[Segment]]:
    """Of the record `name`, segments to identify with, and segments to validate with.

    Errors: `MissingDataError`; `ValueError` for another format.
    """
    import scipy.io  # few commands need it, and all import this file

    path = find(folder, "multiarm_pendulum", name, ORIGIN)
    found = scipy.io.loadmat(path)
    lost = [key for key in ("Y_id", "Y_vad", "dt") if key not in found]
    if lost:
        raise ValueError(f"{path}: it must have the variables {', '.join(lost)}.")
    if not np.allclose(found["dt"], STEP, rtol=1e-9):
        raise ValueError(f"{path}: dt must be {STEP} s.")
    first, second = ([_segment(path, cell) for cell in found[key].ravel()] for key in ("Y_id", "Y_vad"))
    return first, second


def _segment(path: pathlib.Path, cell: np.ndarray) -> Segment:
    if cell.ndim != 2 or cell.shape[0] != 2 or not np.all(np.isfinite(cell)):
        raise ValueError(f"{path}: every segment must be two rows of finite numbers.")
    # The record counts the angle from where the pendulum stands on its head.
    return Segment(cell[0].astype(np.float64) - np.pi, cell[1].astype(np.float64))
