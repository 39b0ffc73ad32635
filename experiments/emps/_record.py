"""A record of the benchmark, as it comes: MATLAB files of one format."""

import pathlib
from typing import NamedTuple

import numpy as np

from .._data import find

NAME = "DATA_EMPS.mat"
ORIGIN = (
    "It belongs to A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, Workshop on "
    "Nonlinear System Identification Benchmarks, 2019, nonlinearbenchmark.org."
)
STEP = 1e-3  # [s]


class Record(NamedTuple):
    """Position `q` and reference `reference` [m], command `u` [V] in steps of 1 ms; what turns the
    command into a force `gain` [N/V]; gains of the controller `k_p` [1/s], `k_v` [V s/m]."""

    q: np.ndarray
    reference: np.ndarray
    u: np.ndarray
    gain: float
    k_p: float
    k_v: float


def load(folder: pathlib.Path | None, name: str = NAME) -> Record:
    """The record `name`. Errors: `MissingDataError`; `ValueError` for another format."""
    import scipy.io  # few commands need it, and all import this file

    path = find(folder, "emps", name, ORIGIN)
    found = scipy.io.loadmat(path)
    wanted = ("qm", "qg", "vir", "t", "gtau", "kp", "kv")
    lost = [key for key in wanted if key not in found]
    if lost:
        raise ValueError(f"{path}: it must have the variables {', '.join(lost)}.")
    q, reference, u, t = (found[key].ravel().astype(np.float64) for key in wanted[:4])
    if not np.allclose(np.diff(t), STEP, rtol=1e-3):
        raise ValueError(f"{path}: t must rise in steps of {STEP} s.")
    return Record(q, reference, u, *(float(found[key].ravel()[0]) for key in wanted[4:]))
