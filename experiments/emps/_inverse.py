"""Inverse dynamics (IDIM-LS): the force as a linear function of filtered derivatives."""

from typing import Any

import numpy as np

from ._record import STEP, Record

CUT_OFF, ORDER, KEPT = 100.0, 4, 10  # [Hz], of the filter; one sample in so many
ENDS = 50  # samples that the filter falsifies


def inverse_dynamics(record: Record, asymmetric: bool = False) -> tuple[dict, dict, float]:
    """Least squares of `gain u = M a + F_v v + F_c sgn(v) + offset`; asymmetric with a viscous and a
    dry term for each direction, in place of the offset, which these hold already.

    Position filtered forwards and backwards, then central differences, then every signal decimated by
    the same filter, so that what is lost is lost on both sides. **Returns** estimates, standard errors
    and the relative error of the force.
    """
    # Here: every command imports this file, and few need this.
    import scipy.signal

    taps: Any = scipy.signal.butter(ORDER, 2.0 * CUT_OFF * STEP)
    q = scipy.signal.filtfilt(taps[0], taps[1], record.q)
    v = np.gradient(q, STEP)
    a = np.gradient(v, STEP)
    forward, backward = v > 0.0, v < 0.0
    columns = {"mass": a}
    if asymmetric:
        columns |= {
            "viscous_forward": v * forward, "viscous_backward": v * backward,
            "dry_forward": forward * 1.0, "dry_backward": -1.0 * backward,
        }  # fmt: skip
    else:
        columns |= {"viscous": v, "dry": np.sign(v), "offset": np.ones_like(v)}
    matrix = np.stack(list(columns.values()), axis=1)[ENDS:-ENDS]
    force = record.gain * record.u[ENDS:-ENDS]
    matrix = scipy.signal.decimate(matrix, KEPT, axis=0)
    force = scipy.signal.decimate(force, KEPT)
    found = np.linalg.lstsq(matrix, force, rcond=None)[0]
    error = force - matrix @ found
    variance = error @ error / (force.size - found.size)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(matrix.T @ matrix)))
    relative = float(np.linalg.norm(error) / np.linalg.norm(force))
    return dict(zip(columns, found, strict=True)), dict(zip(columns, errors, strict=True)), relative
