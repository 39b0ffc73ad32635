"""Inverse dynamics (IDIM-LS): the force as a linear function of filtered derivatives."""

from typing import Any

import numpy as np

from ._record import STEP, Record

CUT_OFF, ORDER, KEPT = 100.0, 4, 10  # [Hz], of the filter; one sample in so many
ENDS = 50  # samples that the filter falsifies


def inverse_dynamics(records: list[Record], asymmetric: bool = False) -> tuple[dict, dict, float]:
    """Least squares of `gain u = M a + F_v v + F_c sgn(v) + offset` over the records; asymmetric with a
    viscous and a dry term for each direction, in place of the offset, which these hold already.

    Position filtered forwards and backwards, then central differences, then every signal decimated by
    the same filter, so that what is lost is lost on both sides. **Returns** estimates, standard errors
    and the relative error of the force.
    """
    names, matrices, forces = [], [], []
    for record in records:
        columns, force = _rows(record, asymmetric)
        names = list(columns)
        matrices.append(np.stack(list(columns.values()), axis=1))
        forces.append(force)
    matrix, force = np.concatenate(matrices), np.concatenate(forces)
    found = np.linalg.lstsq(matrix, force, rcond=None)[0]
    error = force - matrix @ found
    variance = error @ error / (force.size - found.size)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(matrix.T @ matrix)))
    relative = float(np.linalg.norm(error) / np.linalg.norm(force))
    return dict(zip(names, found, strict=True)), dict(zip(names, errors, strict=True)), relative


def _rows(record: Record, asymmetric: bool) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """What the unknowns are multiplied by, and the force [N], at the samples that are kept."""
    # Here: every command imports this file, and few need this.
    import scipy.signal

    taps: Any = scipy.signal.butter(ORDER, 2.0 * CUT_OFF * STEP)
    q = scipy.signal.filtfilt(taps[0], taps[1], record.q)
    v = np.gradient(q, STEP)
    forward, backward = v > 0.0, v < 0.0
    columns = {"mass": np.gradient(v, STEP)}
    if asymmetric:
        columns |= {
            "viscous_forward": v * forward, "viscous_backward": v * backward,
            "dry_forward": forward * 1.0, "dry_backward": -1.0 * backward,
        }  # fmt: skip
    else:
        columns |= {"viscous": v, "dry": np.sign(v), "offset": np.ones_like(v)}

    def kept(row):
        return scipy.signal.decimate(row[ENDS:-ENDS], KEPT)

    return {name: kept(row) for name, row in columns.items()}, kept(record.gain * record.u)
