"""The paper's claims C1 to C9 against what was computed."""

import jax.numpy as jnp
import numpy as np
import xarray as xr

from stickslip.analysis import Peak, Spectrum, spectral_peaks

from .._experiment import Statement
from ._model import CONTACT_PERIOD, SLIP_ABOVE, STICK, STICK_SLIP_BELOW

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
ENOUGH = 0.9  # part of the lanes of a range that must tell for a statement on all of it
FEWEST = 3  # lanes of a range, points of a lane, below which nothing is said
PERIODS = 5  # periods of contact a record must hold to be called regular or not
RESOLUTION = 0.0125  # coarsest spacing of a spectrum in which a line within 0.01 of 0.25 is told
ZERO = 0.01  # [1] an exponent that is below this with twice its error is not positive


def statement(id: str, variant: str, holds: bool | None, measured: str) -> Statement:
    """A claim in one reading of the equations."""
    return Statement(f"{id} ({variant})", CLAIMS[id], holds, measured)


def relative_width(points: np.ndarray) -> np.ndarray:
    """Spread of the points of each lane against their largest size; NaN for fewer than 3 points."""
    seen = np.isfinite(points)
    size = np.where(seen, np.abs(points), 0.0).max(axis=1)
    top = np.where(seen, points, -np.inf).max(axis=1)
    low = np.where(seen, points, np.inf).min(axis=1)
    enough = seen.sum(axis=1) >= FEWEST
    top, low = np.where(enough, top, np.nan), np.where(enough, low, np.nan)
    return (top - low) / np.where(size > 0, size, 1.0)


def everywhere(true: np.ndarray, told: np.ndarray, share: float = 1.0) -> bool | None:
    """Whether it is true in all lanes, or in more than `share` of them; None where that is not told.

    A lane that tells otherwise decides against "all", however few tell.
    """
    true, told = np.asarray(true, bool), np.asarray(told, bool)
    if share == 1.0 and bool((told & ~true).any()):
        return False
    if told.sum() < FEWEST or told.mean() < ENOUGH:
        return None
    return bool(true[told].mean() > share) if share < 1.0 else True


def judge_diagrams(dataset: xr.Dataset) -> list[Statement]:
    """C1 to C5. Lanes that failed, and lanes with fewer than 3 points, do not count."""
    found = []
    v, low = np.asarray(dataset.v), STICK_SLIP_BELOW
    for variant in map(str, dataset.variant.values):
        part = dataset.sel(variant=variant)
        ok = np.asarray(part.ok) == 1
        x, y, w = (
            np.where(ok[:, None], np.asarray(part[name].transpose("v", "point")), np.nan)
            for name in ("x", "y", "w")
        )
        widths = [relative_width(a) for a in (x, y, w)]
        told = [np.isfinite(a) for a in widths]
        tail = "".join(
            f"; {int((~known).sum())} of {v.size} lanes do not tell of {name}"
            for name, known in zip("xyw", told, strict=True)
            if not known.all()
        )
        found.append(_judge_x(variant, x[told[0]], widths[0], told[0], tail))
        found.append(_judge_w(variant, v, w, widths[2], told[2], low, tail))
        found += _judge_y(variant, part, v, widths[1], ok, tail)
    return found


def _judge_x(variant, x, width, told, tail) -> Statement:
    if not told.any():
        return statement("C1", variant, None, f"no lane tells{tail}")
    within, least = float(width[told].max()), float(np.nanmin(x))
    apart = float(np.nanmax(x) / least - 1) if least != 0 else np.inf
    holds = everywhere(np.full(told.shape, within < 1e-6 and apart < 1e-6), told)
    text = f"maxima of x differ by {within:.1e} within a lane, {apart:.1e} between lanes{tail}"
    return statement("C1", variant, holds, text)


def _judge_w(variant, v, w, spread, told, low, tail) -> Statement:
    if told.sum() < FEWEST:
        return statement("C2", variant, None, f"{int(told.sum())} lanes tell{tail}")
    single, v = spread < SINGLE, v[told]
    size = np.nanmax(w[told], axis=1)
    grows = np.polyfit(v, size, 1)[0] > 0 and np.std(size) > 0 and np.corrcoef(v, size)[0, 1] > 0.9
    holds = everywhere(single, told)
    holds = bool(grows) if holds else holds
    medians = ", ".join(
        f"{np.median(spread[told][rows]):.1%} {word}"
        for rows, word in ((v < low, "below 2.5e-3"), (v > low, "above"))
        if rows.any()
    )
    text = (
        f"w is one curve in {single[told].mean():.0%} of the lanes (median width of its maxima "
        f"{medians}); largest w {size[0]:.1e} at v = {v[0]:g}, {size[-1]:.1e} at {v[-1]:g}{tail}"
    )
    return statement("C2", variant, holds, text)


def _judge_y(variant, part, v, width, ok, tail) -> list[Statement]:
    low, high = STICK_SLIP_BELOW, SLIP_ABOVE
    less, more = 1 - BORDER, 1 + BORDER
    slow, middle, fast = v < less * low, (v > more * low) & (v < less * high), v > more * high
    sticks, share = np.asarray(part.sticks), np.asarray(part.stick_share)
    counted = ok & np.isfinite(sticks) & np.isfinite(share)
    wide = np.isfinite(width)
    cycles = float(part.attrs["duration"]) / CONTACT_PERIOD
    per_cycle = np.where(counted, sticks, 0) / cycles
    every, never = per_cycle > 0.98, sticks == 0
    found = []

    def add(id, rows, told, holds, text):
        """`text()` is asked for only where a lane tells."""
        if rows.any():
            some = bool((rows & told).any())
            words = text(rows & told) if some else "no lane tells"
            found.append(statement(id, variant, holds(rows) if some else None, words + tail))

    add(
        "C3", slow, counted, lambda r: everywhere(every[r], counted[r]),
        lambda r: f"the mass sticks {per_cycle[r].min():.2f} to {per_cycle[r].max():.2f} times per "
        f"contact, {share[r].min():.1%} to {share[r].max():.1%} of the time; at every "
        f"contact up to v = {_up_to(v, every):.4g}",
    )  # fmt: skip
    add(
        "C4a", middle, wide, lambda r: everywhere(width[r] > SINGLE, wide[r], 0.9),
        lambda r: f"maxima of y are more than one line in {(width[r] > SINGLE).mean():.0%} of the "
        f"lanes (median width {np.median(width[r]):.1%})",
    )  # fmt: skip
    add(
        "C4b", middle, counted, lambda r: everywhere(never[r], counted[r]),
        lambda r: f"after the transient it sticks {share[r].max():.2%} of the time at most",
    )  # fmt: skip
    both = counted & wide
    add(
        "C5", fast, both, lambda r: everywhere(never[r] & (width[r] < SINGLE), both[r]),
        lambda r: f"sticks in {(sticks[r] > 0).mean():.0%} of the lanes, {share[r].max():.1%} of the "
        f"time at most; maxima of y are one line in {(width[r] < SINGLE).mean():.0%} of the lanes",
    )  # fmt: skip
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
        unknown = _cannot_tell(dataset, part, ("y_amplitude", "w_amplitude"))
        if unknown or begins.size < 3:
            found.append(
                statement("C6", variant, None if unknown else False, unknown or "no regular stick")
            )
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


def _cannot_tell(dataset: xr.Dataset, part: xr.Dataset, names: tuple[str, ...]) -> str:
    """Why a motion says nothing: too short, not finite, or at rest; empty if it does."""
    length = float(dataset.time[-1]) - float(dataset.attrs["dropped"]) if dataset.time.size else 0.0
    if length < PERIODS * CONTACT_PERIOD:
        return f"the record of {length:g} is shorter than {PERIODS} periods of contact"
    late = np.asarray(dataset.time) >= dataset.attrs["dropped"]
    for name in names:
        values = np.asarray(part[name])
        values = values[late] if part[name].dims == ("time",) else values
        if not np.isfinite(values).all():
            return f"{name} is not finite"
        if not np.any(values):
            return f"{name} is zero throughout"
    return ""


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
    dt = float(dataset.time[1] - dataset.time[0]) if dataset.time.size > 1 else np.nan
    for variant in map(str, dataset.variant.values):
        part = dataset.sel(variant=variant)
        W_f, W_b = (np.asarray(part[name])[late] for name in ("W_f", "W_b"))
        stuck = np.asarray(part["mode"])[late] == STICK
        unknown = _cannot_tell(dataset, part, ("W_f", "W_b"))
        if unknown or not stuck.any():
            found.append(statement("C7", variant, None, unknown or "the mass never sticks"))
            continue
        in_stick = np.abs(W_f[stuck]).max()
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
        unknown = _cannot_tell(dataset, part, ("y_amplitude",))
        spacing = float(part.frequency[1] - part.frequency[0])
        if not unknown and spacing > RESOLUTION:
            unknown = f"the lines of the spectrum are {spacing:.3f} apart"
        if unknown:
            found.append(statement("C8", variant, None, unknown))
            continue
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


def is_positive(value: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each exponent is above twice its error, and whether it tells.

    One that is below `ZERO` with twice its error, or `-inf`, is told not to be positive.
    """
    positive = value > 2 * error
    below = (value + 2 * error < ZERO) | np.isneginf(value)
    return positive, positive | below


def judge_positive(variant: str, value: np.ndarray, error: np.ndarray, more: str = "") -> Statement:
    """C9a, from the greatest exponent at each speed."""
    finite = value[np.isfinite(value)]
    positive, told = is_positive(value, error)
    if not finite.size:
        return statement("C9a", variant, None, "no exponent is a number")
    text = (
        f"greatest of y and the beam {finite.min():+.1e} to {finite.max():+.1e}, "
        f"above twice its error at {positive.mean():.0%} of the speeds"
    )
    if not told.all():
        text += f", not told at {(~told).mean():.0%}"
    return statement("C9a", variant, everywhere(positive, told), text + more)


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
        letter = np.asarray(part.letter)
        mass = np.where(np.isfinite(values), values, np.inf).min(axis=1)
        more = "".join(
            f"; {name} {series.min():+.4f} to {series.max():+.4f}"
            for name, series in (
                ("the mass by itself", mass[np.isfinite(mass)]),
                ("(2.25) to the letter", letter[np.isfinite(letter)]),
            )
            if series.size
        )
        found.append(judge_positive(variant, greatest, doubt, more))
        slope = np.array([[_slope(v[r], a[r]) for a in (greatest, letter)] for r in ranges])
        text = "slopes over v in the three ranges: " + "; ".join(
            f"{name} {', '.join(f'{s:+.2g} ± {e:.1g}' for s, e in slope[:, i])}"
            for i, name in enumerate(("greatest exponent", "(2.25)"))
        )
        signed = slope[:, 0, 0] * np.array([-1, 1, -1])
        # A slope within twice its error has no sign.
        certain = np.abs(slope[:, 0, 0]) > 2 * slope[:, 0, 1]
        holds = None
        if (certain & (signed < 0)).any():
            holds = False
        elif (certain & (signed > 0)).all():
            holds = True
        found.append(statement("C9b", variant, holds, text))
    return found


def _slope(v: np.ndarray, value: np.ndarray) -> tuple[float, float]:
    """Slope of a straight line and its standard error from the residuals; NaN where it is not told."""
    seen = np.isfinite(value)
    if seen.sum() < 5 or seen.mean() < ENOUGH:
        return np.nan, np.nan
    v, value = v[seen] - v[seen].mean(), value[seen]
    slope = float(v @ value / (v @ v))
    residual = value - value.mean() - slope * v
    return slope, float(np.sqrt(residual @ residual / (v.size - 2) / (v @ v)))
