"""Attractors that never repeat: quasi-periodic by two exponents of zero, chaotic by a positive one."""

from collections.abc import Iterator
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..analysis import LyapunovSpectrum, Segments, lyapunov_spectrum
from ..hybrid import SaveAt, simulate
from ._accuracy import ACCURACY
from ._attractor import Attractor, Found, Search, motions_at
from ._lanes import rows_of
from ._tube import Tube, tube_of


def wanderings_at(search: Search, t: float, y: np.ndarray, mode: int) -> Iterator[Found]:
    """The attractor on which the motion from a state is and never repeats, if it is on one.

    Its exponents are of a motion of the whole duration; those of a quasi-periodic one are asked again
    of a motion eight times as long. The tube is about the motion after that. There is none where no
    exponent is zero but that along the motion, as of a periodic one, and where none is negative:
    without damping nothing comes nearer.
    """
    lanes, period = search.lanes, search.forcing_period
    count = ACCURACY.many
    length = search.duration / count
    if period is not None:
        length = period * max(round(length / period), 1)
    along = 1 if period is None else 0

    def growth(t: Any, y: Any, mode: Any, length: float) -> LyapunovSpectrum:
        return lyapunov_spectrum(
            lanes.system, y, Segments(length, count, t0=jnp.asarray(t)), mode0=mode,
            scales=lanes.unravel(search.scale), args=lanes.args, integrator=lanes.integrator,
        )  # fmt: skip

    end = spectrum = growth(t, lanes.unravel(y), jnp.asarray(mode, lanes.mode_type), length)
    kind, rate = _kind_of(spectrum, along)
    if kind == "torus":
        # A chaotic motion may by chance not have grown for a while. The exponents shown are those of
        # the first record: over the longer segments of this one deviations that decay are lost.
        end = growth(end.t1, end.y1, end.mode1, ACCURACY.few * length)
        kind = kind * (_kind_of(end, along)[0] == kind)
    if not kind:
        return
    last, tube = _tube_after(search, end, period or search.duration / ACCURACY.places)
    if tube is None:
        return
    # A motion that seemed never to repeat may have been a long way to one that does.
    later = motions_at(search, last, tube.start[-1], int(tube.mode[-1]))
    settled = [found for found in later if found.rate < 0.0]
    yield from settled
    if not settled:
        motion = Attractor(kind, kind, spectrum, int(tube.mode[-1]), tube=tube)
        yield Found(motion, rate, search.duration / ACCURACY.few)


def _kind_of(spectrum: LyapunovSpectrum, along: int) -> tuple[str, float]:
    """The kind of a motion by its exponents, of which so many are zero anyway, and the rate of its
    slowest decay [1/s]."""
    moved = np.isin(spectrum.words, ("ok", "lost"))
    values = np.asarray(spectrum.exponents)[moved]
    # A deviation that only swings may be of another size at the end: by the factor e, it is taken.
    zero = 1.0 / float(spectrum.time[-1])
    sure = 3.0 * np.nan_to_num(np.asarray(spectrum.error)[moved]) + zero
    decays, still = values[values < -sure], np.abs(values) <= zero
    if not decays.size or "failed" in spectrum.words:
        return "", 0.0
    if np.any(values > sure):
        return "chaos", float(np.max(decays))
    torus = np.sum(still) > along and np.all(still | (values < -sure))
    return "torus" * bool(torus), float(np.max(decays))


def _tube_after(search: Search, spectrum: LyapunovSpectrum, step: float) -> tuple[float, Tube | None]:
    """The end [s] of the motion that goes on from the end of another, and about it the tube through
    even times, under a force about each state; None if it fails."""
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
            return t, None
        out = run.outputs
        states, slopes = (rows_of(tree, each) for tree in (out.y, out.dy))
        rows.append((np.asarray(out.t), states, slopes, np.asarray(out.mode)))
        t, y, mode = float(ts[-1]), run.y1, run.mode1
    times, states, slopes, modes = (np.concatenate(part) for part in zip(*rows, strict=True))
    known = slopes if search.forcing_period is None else None
    across = np.eye(states.shape[1])
    return t, tube_of((times, states, known), modes, across, search.scale, search.turn)
