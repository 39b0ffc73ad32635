"""Inverse dynamics (IDIM-LS): the torques as linear functions of filtered derivatives."""

from collections.abc import Sequence

import numpy as np

from ._arm import GEAR, GRAVITY, LINK, UNITS
from ._record import STEP, Motion, low_passed

# Driven near its resonances, the pendulum needs a torque that is a tenth of what gravity and inertia
# take each: noise of the accelerations, which counts against the inertia, must be far below that.
CUT_OFF, KEPT = 3.0, 10  # [Hz], of the filter for both sides; one sample in so many
FIRST_CUT_OFF = 25.0  # of the filter before the derivatives [Hz]
ENDS = 100  # samples that the filters falsify


def rows_of(motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Matrix, its columns for the zeros of the encoders, right side: both joints, `UNITS` in order.

    Where the encoders show too much by $z_1$ and $z_2$, gravity is less by $g\cos q_1$ times the first
    moment times $z_1$, and by $g\cos(q_1 + q_2)$ times the second one times $z_1 + z_2$.
    """

    q1, q2 = low_passed(motion.q, FIRST_CUT_OFF)
    (v1, v2), none = (np.gradient(q, STEP) for q in (q1, q2)), np.zeros_like(q1)
    a1, a2 = np.gradient(v1, STEP), np.gradient(v2, STEP)
    cos, sin = LINK * np.cos(q2), LINK * np.sin(q2)
    lower, moved = GRAVITY * np.sin(q1 + q2), -GRAVITY * np.cos(q1 + q2)
    first = {
        "moment_1": GRAVITY * np.sin(q1),
        "moment_2": cos * (2.0 * a1 + a2) - sin * (2.0 * v1 + v2) * v2 + lower,
        "inertia_1": a1, "inertia_2": a1 + a2, "inertia_motor": -GEAR * a2,
        "viscous_1": v1, "dry_1": np.sign(v1),
    }  # fmt: skip
    second = {
        "moment_2": cos * a1 + sin * v1**2 + lower,
        "inertia_2": a1 + a2, "inertia_motor": GEAR * (GEAR * a2 - a1),
        "viscous_2": v2, "dry_2": np.sign(v2),
    }  # fmt: skip
    matrix = np.stack([[row.get(name, none) for name in UNITS] for row in (first, second)])
    zeros = np.stack([[-GRAVITY * np.cos(q1), moved], [none, moved]])
    kept = slice(ENDS, -ENDS, KEPT)
    matrix, zeros, torque = (
        low_passed(rows, CUT_OFF)[..., kept] for rows in (matrix, zeros, motion.tau)
    )
    return np.concatenate(list(matrix), axis=1).T, np.concatenate(list(zeros), axis=1).T, torque.ravel()


def inverse_dynamics(motions: Sequence[Motion], zeros: bool = True) -> tuple[dict, dict, float]:
    """Least squares of the torques in all records, with zeros of the encoders of each. **Returns**
    estimates, standard errors as for white noise, and the relative error of the torques."""
    import scipy.linalg  # few commands need it, and all import this file

    parts = [rows_of(motion) for motion in motions]
    matrix = np.concatenate([part[0] for part in parts])
    torque = np.concatenate([part[2] for part in parts])
    if zeros:
        matrix = np.hstack([matrix, np.asarray(scipy.linalg.block_diag(*(part[1] for part in parts)))])
    found = np.linalg.lstsq(matrix, torque, rcond=None)[0]
    error = torque - matrix @ found
    variance = error @ error / (torque.size - found.size)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(matrix.T @ matrix)))
    relative = float(np.linalg.norm(error) / np.linalg.norm(torque))
    return (
        dict(zip(UNITS, found[: len(UNITS)], strict=True)),
        dict(zip(UNITS, errors[: len(UNITS)], strict=True)),
        relative,
    )
