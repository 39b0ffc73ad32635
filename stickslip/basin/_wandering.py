"""Attractors that never repeat: quasi-periodic by two exponents of zero, chaotic by a positive one."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..analysis import LyapunovSpectrum, Segments, lyapunov_spectrum
from ..hybrid import SaveAt, simulate
from ._accuracy import ACCURACY
from ._attractor import Attractor, Found, Search
from ._lanes import rows_of
from ._tube import Tube, tube_of


def wanderings_at(search: Search, t: float, y: np.ndarray, mode: int) -> Iterator[Found]:
    """The attractor on which the motion from a state is and never repeats, if it is on one.

    Its exponents are of a motion of the whole duration, and the tube is about the one after that. There
    is none where no exponent is zero but that along the motion, as of a periodic one, and where none is
    negative: without damping nothing comes nearer.
    """
    lanes, period = search.lanes, search.forcing_period
    count = ACCURACY.many
    length = search.duration / count
    if period is not None:
        length = period * max(round(length / period), 1)
    record = Segments(length, count, t0=float(t))
    spectrum = lyapunov_spectrum(
        lanes.system, lanes.unravel(y), record, scales=lanes.unravel(search.scale), mode0=mode,
        args=lanes.args, integrator=lanes.integrator,
    )  # fmt: skip
    kind, rate = _kind_of(spectrum, 1 if period is None else 0)
    if not kind:
        return
    tube = _tube_after(search, spectrum, period or search.duration / ACCURACY.places)
    if tube is not None:
        motion = Attractor(kind, kind, spectrum, int(np.asarray(spectrum.mode1)), tube=tube)
        yield Found(motion, rate, search.duration / ACCURACY.few)


def _kind_of(spectrum: LyapunovSpectrum, along: int) -> tuple[str, float]:
    """What exponents say of a motion of which so many are zero anyway; the slowest decay [1/s]."""
    moved = np.isin(spectrum.words, ("ok", "lost"))
    values = np.asarray(spectrum.exponents)[moved]
    # A deviation that only swings may be of another size at the end: by the factor e, it is taken.
    sure = 3.0 * np.nan_to_num(np.asarray(spectrum.error)[moved]) + 1.0 / float(spectrum.time[-1])
    decays = values[values < -sure]
    if not decays.size or "failed" in spectrum.words:
        return "", 0.0
    zeros = int(np.sum(np.abs(values) <= sure))
    kind = "chaos" if np.any(values > sure) else "torus" if zeros > along else ""
    return kind, float(np.max(decays))


def _tube_after(search: Search, spectrum: LyapunovSpectrum, step: float) -> Tube | None:
    """About the motion that goes on from the end of another, read at even times, under a force about
    each state; None if it fails."""
    lanes, rows = search.lanes, []
    each = ACCURACY.places // ACCURACY.rounds
    t, y, mode = float(spectrum.t1), spectrum.y1, spectrum.mode1
    for _ in range(ACCURACY.rounds):
        ts = t + step * np.arange(1, each + 1)
        run: Any = simulate(
            lanes.system, t, ts[-1], y, mode, lanes.args, integrator=lanes.integrator,
            saveat=SaveAt(ts=ts, max_events=None), throw=False,
        )  # fmt: skip
        if not bool(run.successful):
            return None
        out = run.outputs
        states, slopes = (rows_of(tree, each) for tree in (out.y, out.dy))
        rows.append((np.asarray(out.t), states, slopes, np.asarray(out.mode)))
        t, y, mode = float(ts[-1]), run.y1, run.mode1
    times, states, slopes, modes = (np.concatenate(part) for part in zip(*rows, strict=True))
    known = slopes if search.forcing_period is None else None
    return tube_of((times, states, known), modes, np.eye(states.shape[1]), search.scale, search.turn)
