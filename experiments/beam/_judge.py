"""The paper's claims C1 to C9 against what was computed."""

import jax.numpy as jnp
import numpy as np
import xarray as xr

from stickslip.analysis import Peak, Spectrum, spectral_peaks

from .._experiment import Statement
from ._model import SLIP_ABOVE, STICK, STICK_SLIP_BELOW

CLAIMS = {
    "C1": "x: limit cycle at every v, not affected by the beam.",
    "C2": "w(z_A): regular, its cycle grows with v.",
    "C3": "y: pure stick-slip for v < 2.5e-3.",
    "C4a": "y: period doubling or irregular for v in [2.5e-3, 9e-3].",
    "C4b": "y: stick is visible in the first few time steps only, for v in [2.5e-3, 9e-3].",
    "C5": "y: pure slip on a limit cycle for v > 9e-3.",
    "C6": "v = 0.0005: stick-slip period 0.54; superharmonics of 1/0.54 in y, some near beam "
    "frequencies, and in w_A.",
    "C7": "v = 0.0005: W_f regular and non-zero only in slip; W_b irregular.",
    "C8": "v = 0.005: a frequency 0.25 and its superharmonics.",
    "C9a": "Maximum Lyapunov exponent: positive at every v.",
    "C9b": "Maximum Lyapunov exponent: falls in the stick-slip range, rises in the bifurcating range, "
    "falls in pure slip.",
}
SINGLE = 0.01  # points that differ by less than this part of their size are one branch
NEAR = 0.05  # a superharmonic this near to a frequency of the beam counts as close
BORDER = 0.05  # the text gives the borders of the ranges to two digits: not judged this close
REGULAR = 0.1  # change over a period, against the size, below which a signal is regular


def statement(id: str, variant: str, holds: bool | None, measured: str) -> Statement:
    """A claim in one reading of the equations."""
    return Statement(f"{id} ({variant})", CLAIMS[id], holds, measured)


def relative_width(points: np.ndarray) -> np.ndarray:
    """Spread of the points of each lane against their largest size."""
    size = np.nanmax(np.abs(points), axis=1)
    return (np.nanmax(points, axis=1) - np.nanmin(points, axis=1)) / np.where(size > 0, size, 1.0)


def judge_diagrams(dataset: xr.Dataset) -> list[Statement]:
    """C1 to C5."""
    found = []
    v, low = np.asarray(dataset.v), STICK_SLIP_BELOW
    for variant in map(str, dataset.variant.values):
        part = dataset.sel(variant=variant)
        x, y, w = (np.asarray(part[name].transpose("v", "point")) for name in ("x", "y", "w"))
        failed = int((np.asarray(part.ok) == 0).sum())
        tail = f"; {failed} of {v.size} lanes failed" if failed else ""
        width = float(relative_width(x).max())
        apart = float(np.nanmax(x) / np.nanmin(x) - 1)
        holds = width < 1e-6 and apart < 1e-6
        text = f"maxima of x differ by {width:.1e} within a lane, {apart:.1e} between lanes{tail}"
        found.append(statement("C1", variant, bool(holds), text))
        spread, size = relative_width(w), np.nanmax(w, axis=1)
        single = spread < SINGLE
        growth = np.polyfit(v, size, 1)[0] > 0 and np.corrcoef(v, size)[0, 1] > 0.9
        text = (
            f"w is one curve in {single.mean():.0%} of the lanes (median width of its maxima "
            f"{np.median(spread[v < low]):.1%} below 2.5e-3, {np.median(spread[v > low]):.0%} above); "
            f"largest w {size[0]:.1e} at v = {v[0]:g}, {size[-1]:.1e} at {v[-1]:g}{tail}"
        )
        found.append(statement("C2", variant, bool(single.all() and growth), text))
        found += _judge_y(variant, part, v, relative_width(y), tail)
    return found


def _judge_y(variant, part, v, width, tail) -> list[Statement]:
    low, high = STICK_SLIP_BELOW, SLIP_ABOVE
    less, more = 1 - BORDER, 1 + BORDER
    slow, middle, fast = v < less * low, (v > more * low) & (v < less * high), v > more * high
    sticks, share = np.asarray(part.sticks), np.asarray(part.stick_share)
    cycles = float(part.attrs["duration"]) / 0.5405
    per_cycle = sticks / cycles
    every = per_cycle > 0.98
    found = []
    if slow.any():
        text = (
            f"the mass sticks {per_cycle[slow].min():.2f} to {per_cycle[slow].max():.2f} times per "
            f"contact, {share[slow].min():.1%} to {share[slow].max():.1%} of the time; at every "
            f"contact up to v = {_up_to(v, every):.4g}{tail}"
        )
        found.append(statement("C3", variant, bool(every[slow].all()), text))
    if middle.any():
        irregular = width > SINGLE
        text = (
            f"maxima of y are more than one line in {irregular[middle].mean():.0%} of the lanes "
            f"(median width {np.median(width[middle]):.1%}){tail}"
        )
        found.append(statement("C4a", variant, bool(irregular[middle].mean() > 0.9), text))
        text = f"after the transient it sticks {share[middle].max():.2%} of the time at most{tail}"
        found.append(statement("C4b", variant, bool((sticks[middle] == 0).all()), text))
    if fast.any():
        single = width[fast] < SINGLE
        text = (
            f"sticks in {(sticks[fast] > 0).mean():.0%} of the lanes, {share[fast].max():.1%} of the "
            f"time at most; maxima of y are one line in {single.mean():.0%} of the lanes{tail}"
        )
        holds = bool((sticks[fast] == 0).all() and single.all())
        found.append(statement("C5", variant, holds, text))
    return found


def _up_to(v: np.ndarray, true: np.ndarray) -> float:
    """Greatest v up to which it is true, NaN if not even at the first."""
    wrong = np.flatnonzero(~true)
    last = v.size if wrong.size == 0 else int(wrong[0])
    return float(v[last - 1]) if last else float("nan")


def peaks_of(part: xr.Dataset, name: str, bases: dict[str, float], count: int = 10) -> list[Peak]:
    """Highest lines of an observable's spectrum."""
    frequency, amplitude = (
        jnp.asarray(np.asarray(part[key])) for key in ("frequency", f"{name}_amplitude")
    )
    spectrum = Spectrum(frequency, amplitude, "hann")
    return spectral_peaks(spectrum, count=count, bases=bases, tolerance=1.5)


def lines(peaks: list[Peak]) -> str:
    """Peaks as words."""
    return ", ".join(f"{p.frequency:.3f}" + (f" ({p.name})" if p.name else "") for p in peaks)


def judge_stick_slip(dataset: xr.Dataset) -> list[Statement]:
    """C6, from y and w at v = 0.0005."""
    found = []
    beam = np.arange(1, 5) ** 2 * np.pi / 2
    for variant in map(str, dataset.variant.values):
        part = dataset.sel(variant=variant)
        begins = np.asarray(part.stick_begins)
        begins = begins[np.isfinite(begins) & (begins > dataset.attrs["dropped"])]
        if begins.size < 3:
            found.append(statement("C6", variant, False, "no regular stick"))
            continue
        period = float(np.mean(np.diff(begins)))
        bases = {"f_s": 1 / period}
        y, w = (peaks_of(part, name, bases) for name in ("y", "w"))
        in_y = [p for p in y if p.number > 1]
        in_w = [p for p in w if p.number > 1]
        close = [(p.number, float(f)) for p in in_y for f in beam if abs(p.frequency - f) < NEAR * f]
        text = (
            f"period {period:.4f}; lines of y at {lines(y[:5])}; of w at {lines(w[:5])}; near the "
            "beam: " + (", ".join(f"{n} f_s to {f:.2f}" for n, f in close) or "none")
        )
        holds = abs(period - 0.54) < 0.005 and len(in_y) >= 3 and len(in_w) >= 2 and bool(close)
        found.append(statement("C6", variant, holds, text))
    return found


def change_over(signal: np.ndarray, dt: float, period: float) -> float:
    """Root mean square of the change of a signal over a period, against the signal's own."""
    t = dt * np.arange(signal.size)
    inside = t + period <= t[-1]
    later = np.interp(t[inside] + period, t, signal)
    size = np.sqrt(np.mean((signal - signal.mean()) ** 2))
    return float(np.sqrt(np.mean((later - signal[inside]) ** 2)) / size) if size > 0 else 0.0


def judge_powers(dataset: xr.Dataset) -> list[Statement]:
    """C7, at v = 0.0005."""
    found = []
    late = np.asarray(dataset.time) >= dataset.attrs["dropped"]
    dt = float(dataset.time[1] - dataset.time[0])
    for variant in map(str, dataset.variant.values):
        part = dataset.sel(variant=variant)
        W_f, W_b = (np.asarray(part[name])[late] for name in ("W_f", "W_b"))
        in_stick = np.abs(W_f[np.asarray(part["mode"])[late] == STICK]).max(initial=0.0)
        f, b = (change_over(W, dt, 0.54054) for W in (W_f, W_b))
        text = (
            f"W_f in stick at most {in_stick:.1e} (elsewhere {np.abs(W_f).max():.1e}); change over a "
            f"period of contact: W_f {f:.1%}, W_b {b:.1%} of its size"
        )
        found.append(statement("C7", variant, bool(in_stick == 0 and f < REGULAR < b), text))
    return found


def judge_slow_frequency(dataset: xr.Dataset) -> list[Statement]:
    """C8, from y at v = 0.005."""
    found = []
    for variant in map(str, dataset.variant.values):
        part = dataset.sel(variant=variant)
        peaks = peaks_of(part, "y", {})
        near = [p for p in peaks if abs(p.frequency - 0.25) < 0.01]
        if not near:
            text = f"no line within 0.01 of 0.25; lines at {lines(peaks[:5])}"
            found.append(statement("C8", variant, False, text))
            continue
        peaks = peaks_of(part, "y", {"f": near[0].frequency})
        above = [p for p in peaks if p.number > 1]
        rank = [p.frequency for p in peaks].index(near[0].frequency) + 1
        text = (
            f"line at {near[0].frequency:.4f}, the {rank}. highest; lines at {lines(peaks[:6])}; "
            f"{len(above)} of {len(peaks)} are its superharmonics"
        )
        found.append(statement("C8", variant, bool(rank == 1 and len(above) >= 2), text))
    return found


def judge_exponents(dataset: xr.Dataset) -> list[Statement]:
    """C9, by the exponents and by (2.25) to the letter."""
    found = []
    v = np.asarray(dataset.v)
    ranges = (v < STICK_SLIP_BELOW, (v >= STICK_SLIP_BELOW) & (v <= SLIP_ABOVE), v > SLIP_ABOVE)
    for variant in map(str, dataset.variant.values):
        part = dataset.sel(variant=variant)
        values = np.asarray(part.exponents.transpose("v", "exponent"))
        error = np.asarray(part.error.transpose("v", "exponent"))
        at = np.argmax(np.where(np.isfinite(values), values, -np.inf), axis=1)
        rows = np.arange(v.size)
        greatest, doubt = values[rows, at], error[rows, at]
        positive = greatest > 2 * doubt
        letter = np.asarray(part.letter)
        finite = np.where(np.isfinite(values), values, np.nan)
        mass = np.nanmin(finite, axis=1)
        text = (
            f"greatest of y and the beam {np.nanmin(greatest):+.1e} to {np.nanmax(greatest):+.1e}, "
            f"above twice its error at {positive.mean():.0%} of the speeds; the mass by itself "
            f"{np.nanmin(mass):+.3f} to {np.nanmax(mass):+.3f}; (2.25) to the letter "
            f"{np.nanmin(letter):+.4f} to {np.nanmax(letter):+.4f}"
        )
        found.append(statement("C9a", variant, bool(positive.all()), text))
        slopes = [
            (np.polyfit(v[r], greatest[r], 1)[0], np.polyfit(v[r], letter[r], 1)[0])
            if r.sum() >= 3
            else (np.nan, np.nan)
            for r in ranges
        ]
        slope = np.array(slopes)
        signs = np.array([-1, 1, -1])
        known = bool(np.isfinite(slope).all())
        text = "slopes over v in the three ranges: " + "; ".join(
            f"{name} {', '.join(f'{s:+.2g}' for s in slope[:, i])}"
            for i, name in enumerate(("greatest exponent", "(2.25)"))
        )
        holds = bool((np.sign(slope[:, 0]) == signs).all()) if known else None
        found.append(statement("C9b", variant, holds, text))
    return found
