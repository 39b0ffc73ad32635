"""The paper's claims C1 to C9 against what was computed."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
import xarray as xr

from stickslip.analysis import Peak, Spectrum, spectral_peaks

from .._statement import Claim, Statement, Untold, Verdict, statement
from .._thresholds import Beam
from ._lanes import Lanes, everywhere
from ._model import CONTACT_PERIOD, STICK, VARIANTS

MIDDLE = f"[{Beam.STICK_SLIP_BELOW:g}, {Beam.SLIP_ABOVE:g}]"
BEAM = np.arange(1, 5) ** 2 * np.pi / 2  # frequencies of its first modes
SHOWN = 6  # lines of a spectrum


@statement("C1", "x: limit cycle at every v, not affected by the beam.")
def x_is_a_cycle(lanes: Lanes) -> Verdict:
    """Maxima of x within a lane and between lanes."""
    told = lanes.told["x"]
    if not told.any():
        return None, f"no lane is known{lanes.tail}"
    x = lanes.points["x"][told]
    within, least = float(lanes.width["x"][told].max()), float(np.nanmin(x))
    apart = float(np.nanmax(x) / least - 1) if least != 0 else np.inf
    same = within < Beam.EXACT and apart < Beam.EXACT
    text = f"maxima of x differ by {within:.1e} within a lane, {apart:.1e} between lanes{lanes.tail}"
    return everywhere(np.full(told.shape, same), told), text


@statement("C2", "w(z_A): regular, its cycle grows with v.")
def w_grows(lanes: Lanes) -> Verdict:
    """Width of the maxima of w, and their size over the speed."""
    told = lanes.told["w"]
    if told.sum() < Beam.FEWEST:
        return None, f"{int(told.sum())} lanes are known{lanes.tail}"
    width, v = lanes.width["w"], lanes.v[told]
    single = width < Beam.SINGLE
    size = np.nanmax(lanes.points["w"][told], axis=1)
    grows = (
        np.polyfit(v, size, 1)[0] > 0 and np.std(size) > 0 and np.corrcoef(v, size)[0, 1] > Beam.GROWS
    )
    holds = everywhere(single, told)
    border = Beam.STICK_SLIP_BELOW
    medians = ", ".join(
        f"{np.median(width[told][rows]):.1%} {word}"
        for rows, word in ((v < border, f"below {border:g}"), (v > border, "above"))
        if rows.any()
    )
    return (bool(grows) if holds else holds), (
        f"w is one curve in {single[told].mean():.0%} of the lanes (median width of its maxima "
        f"{medians}); largest w {size[0]:.1e} at v = {v[0]:g}, {size[-1]:.1e} at {v[-1]:g}{lanes.tail}"
    )


@statement("C3", f"y: pure stick-slip for v < {Beam.STICK_SLIP_BELOW:g}.")
def y_sticks(lanes: Lanes) -> Verdict:
    """Sticks a contact below the first border."""
    rows, told = lanes.below(), lanes.counted
    every = lanes.per_cycle > Beam.EVERY
    seen = _seen(rows, told, lanes)
    return everywhere(every[rows], told[rows]), (
        f"the mass sticks {lanes.per_cycle[seen].min():.2f} to {lanes.per_cycle[seen].max():.2f} "
        f"times per contact, {lanes.share[seen].min():.1%} to {lanes.share[seen].max():.1%} of the "
        f"time; at every contact up to v = {_up_to(lanes.v, every):.4g}{lanes.tail}"
    )


@statement("C4a", f"y: period doubling or irregular for v in {MIDDLE}.")
def y_is_irregular(lanes: Lanes) -> Verdict:
    """Width of the maxima of y between the borders."""
    rows, told, width = lanes.between(), lanes.told["y"], lanes.width["y"]
    seen = _seen(rows, told, lanes)
    holds = everywhere(width[rows] > Beam.SINGLE, told[rows], Beam.IRREGULAR)
    return holds, (
        f"maxima of y are more than one line in {(width[seen] > Beam.SINGLE).mean():.0%} of the "
        f"lanes (median width {np.median(width[seen]):.1%}){lanes.tail}"
    )


@statement("C4b", f"y: stick is visible in the first few time steps only, for v in {MIDDLE}.")
def y_sticks_at_first(lanes: Lanes) -> Verdict:
    """Sticks after the transient between the borders."""
    rows, told = lanes.between(), lanes.counted
    seen = _seen(rows, told, lanes)
    text = f"after the transient it sticks {lanes.share[seen].max():.2%} of the time at most"
    return everywhere((lanes.sticks == 0)[rows], told[rows]), text + lanes.tail


@statement("C5", f"y: pure slip on a limit cycle for v > {Beam.SLIP_ABOVE:g}.")
def y_slips(lanes: Lanes) -> Verdict:
    """Sticks and width of the maxima of y above the second border."""
    rows, told = lanes.above(), lanes.counted & lanes.told["y"]
    single = lanes.width["y"] < Beam.SINGLE
    seen = _seen(rows, told, lanes)
    return everywhere(((lanes.sticks == 0) & single)[rows], told[rows]), (
        f"sticks in {(lanes.sticks[seen] > 0).mean():.0%} of the lanes, {lanes.share[seen].max():.1%} "
        f"of the time at most; maxima of y are one line in {single[seen].mean():.0%} of the lanes"
        f"{lanes.tail}"
    )


def _seen(rows: np.ndarray, told: np.ndarray, lanes: Lanes) -> np.ndarray:
    """Rows that are known; raises `Untold` without one."""
    if not (rows & told).any():
        raise Untold(f"no lane is known{lanes.tail}")
    return rows & told


# With the range that each is on, where it is not all of them.
DIAGRAMS: tuple[tuple[Claim, Callable[[Lanes], np.ndarray] | None], ...] = (
    (x_is_a_cycle, None),
    (w_grows, None),
    (y_sticks, Lanes.below),
    (y_is_irregular, Lanes.between),
    (y_sticks_at_first, Lanes.between),
    (y_slips, Lanes.above),
)


def is_found(variant: str) -> bool:
    """Whether this reading is that of parameters which a search found."""
    return variant not in VARIANTS


def judge_diagrams(dataset: xr.Dataset) -> list[Statement]:
    """C1 to C5, of the ranges that are there."""
    found = []
    for variant in map(str, dataset.variant.values):
        lanes = Lanes.of(dataset.sel(variant=variant))
        found += [
            claim(variant, lanes, found=is_found(variant))
            for claim, rows in DIAGRAMS
            if rows is None or rows(lanes).any()
        ]
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


@statement(
    "C6",
    f"v = {Beam.SLOW:g}: stick-slip period {Beam.PERIOD:g}; superharmonics of 1/{Beam.PERIOD:g} in y, "
    "some near beam frequencies, and in w_A.",
)
def superharmonics(dataset: xr.Dataset, part: xr.Dataset) -> Verdict:
    """Lines of y and w at multiples of the frequency of stick."""
    _must_tell(dataset, part, ("y_amplitude", "w_amplitude"))
    begins = np.asarray(part.stick_begins)
    begins = begins[np.isfinite(begins) & (begins > dataset.attrs["dropped"])]
    if begins.size < Beam.FEWEST:
        return False, "no regular stick"
    period = float(np.mean(np.diff(begins)))
    bases = {"f_s": 1 / period}
    y, w = (peaks_of(part, name, bases) for name in ("y", "w"))
    in_y, in_w = ([p for p in found if p.number > 1] for found in (y, w))
    close = [
        (p.number, float(f)) for p in in_y for f in BEAM if abs(p.frequency - f) < Beam.NEAR_BEAM * f
    ]
    text = (
        f"period {period:.4f}; lines of y at {lines(y[:SHOWN])}; of w at {lines(w[:SHOWN])}; near the "
        "beam: " + (", ".join(f"{n} f_s to {f:.2f}" for n, f in close) or "none")
    )
    same = abs(period - Beam.PERIOD) < Beam.SAME_PERIOD
    enough = len(in_y) >= Beam.LINES_OF_Y and len(in_w) >= Beam.LINES_OF_W
    return same and enough and bool(close), text


def judge_stick_slip(dataset: xr.Dataset) -> list[Statement]:
    """C6, from y and w."""
    return _judge_motion(superharmonics, dataset)


def _judge_motion(claim: Claim, dataset: xr.Dataset) -> list[Statement]:
    variants = map(str, dataset.variant.values)
    return [claim(v, dataset, dataset.sel(variant=v), found=is_found(v)) for v in variants]


def _must_tell(dataset: xr.Dataset, part: xr.Dataset, names: tuple[str, ...]) -> None:
    """Raises `Untold` where a motion is too short, not finite, or at rest."""
    length = float(dataset.time[-1]) - float(dataset.attrs["dropped"]) if dataset.time.size else 0.0
    if length < Beam.PERIODS * CONTACT_PERIOD:
        least = f"{Beam.PERIODS:g} periods of contact"
        raise Untold(f"the record of {length:g} is shorter than {least}")
    late = np.asarray(dataset.time) >= dataset.attrs["dropped"]
    for name in names:
        values = np.asarray(part[name])
        values = values[late] if part[name].dims == ("time",) else values
        if not np.isfinite(values).all():
            raise Untold(f"{name} is not finite")
        if not np.any(values):
            raise Untold(f"{name} is zero throughout")


def change_over(signal: np.ndarray, dt: float, period: float) -> float:
    """Root mean square of the change of a signal over a period, against the signal's own."""
    t = dt * np.arange(signal.size)
    inside = t + period <= t[-1]
    later = np.interp(t[inside] + period, t, signal)
    size = np.sqrt(np.mean((signal - signal.mean()) ** 2))
    return float(np.sqrt(np.mean((later - signal[inside]) ** 2)) / size) if size > 0 else 0.0


@statement("C7", f"v = {Beam.SLOW:g}: W_f regular and non-zero only in slip; W_b irregular.")
def powers(dataset: xr.Dataset, part: xr.Dataset) -> Verdict:
    """Power of friction in stick, and how much both powers change over a period of contact."""
    _must_tell(dataset, part, ("W_f", "W_b"))
    late = np.asarray(dataset.time) >= dataset.attrs["dropped"]
    dt = float(dataset.time[1] - dataset.time[0])
    W_f, W_b = (np.asarray(part[name])[late] for name in ("W_f", "W_b"))
    stuck = np.asarray(part["mode"])[late] == STICK
    if not stuck.any():
        raise Untold("the mass never sticks")
    in_stick = np.abs(W_f[stuck]).max()
    f, b = (change_over(W, dt, CONTACT_PERIOD) for W in (W_f, W_b))
    return bool(in_stick == 0 and f < Beam.REGULAR < b), (
        f"W_f in stick at most {in_stick:.1e} (elsewhere {np.abs(W_f).max():.1e}); change over a "
        f"period of contact: W_f {f:.1%}, W_b {b:.1%} of its size"
    )


def judge_powers(dataset: xr.Dataset) -> list[Statement]:
    """C7."""
    return _judge_motion(powers, dataset)


@statement("C8", f"v = {Beam.FAST:g}: a frequency {Beam.LOW_FREQUENCY:g} and its superharmonics.")
def low_frequency(dataset: xr.Dataset, part: xr.Dataset) -> Verdict:
    """Rank of that line in the spectrum of y, and its superharmonics."""
    _must_tell(dataset, part, ("y_amplitude",))
    spacing = float(part.frequency[1] - part.frequency[0])
    if spacing > Beam.RESOLUTION:
        raise Untold(f"the lines of the spectrum are {spacing:.3f} apart")
    peaks = peaks_of(part, "y", {})
    near = [p for p in peaks if abs(p.frequency - Beam.LOW_FREQUENCY) < Beam.SAME_FREQUENCY]
    if not near:
        around = f"{Beam.SAME_FREQUENCY:g} of {Beam.LOW_FREQUENCY:g}"
        return False, f"no line within {around}; lines at {lines(peaks[:SHOWN])}"
    peaks = peaks_of(part, "y", {"f": near[0].frequency})
    above = [p for p in peaks if p.number > 1]
    rank = [p.frequency for p in peaks].index(near[0].frequency) + 1
    return rank == 1 and len(above) >= Beam.LINES_OF_W, (
        f"line at {near[0].frequency:.4f}, the {rank}. highest; lines at {lines(peaks[:SHOWN])}; "
        f"{len(above)} of {len(peaks)} are its superharmonics"
    )


def judge_slow_frequency(dataset: xr.Dataset) -> list[Statement]:
    """C8, from y."""
    return _judge_motion(low_frequency, dataset)


def is_positive(value: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each exponent is above `Beam.ERRORS` times its error, and whether that is known.

    One that is below `Beam.ZERO` with that doubt, or `-inf`, is known not to be positive.
    """
    positive = value > Beam.ERRORS * error
    below = (value + Beam.ERRORS * error < Beam.ZERO) | np.isneginf(value)
    return positive, positive | below


@statement("C9a", "Maximum Lyapunov exponent: positive at every v.")
def positive_everywhere(value: np.ndarray, error: np.ndarray, more: str = "") -> Verdict:
    """Greatest exponent at each speed, and its error."""
    finite = value[np.isfinite(value)]
    positive, told = is_positive(value, error)
    if not finite.size:
        return None, "no exponent is a number"
    text = (
        f"greatest of y and the beam {finite.min():+.1e} to {finite.max():+.1e}, "
        f"above twice its error at {positive.mean():.0%} of the speeds"
    )
    if not told.all():
        text += f", unknown at {(~told).mean():.0%}"
    return everywhere(positive, told), text + more


@statement(
    "C9b",
    "Maximum Lyapunov exponent: falls in the stick-slip range, rises in the bifurcating range, falls "
    "in pure slip.",
)
def falls_rises_falls(v: np.ndarray, greatest: np.ndarray, letter: np.ndarray) -> Verdict:
    """Slopes of the greatest exponent, and of (2.25) to the letter, over the speed."""
    low, high = Beam.STICK_SLIP_BELOW, Beam.SLIP_ABOVE
    ranges = (v < low, (v >= low) & (v <= high), v > high)
    slope = np.array([[_slope(v[r], a[r]) for a in (greatest, letter)] for r in ranges])
    text = "slopes over v in the three ranges: " + "; ".join(
        f"{name} {', '.join(f'{s:+.2g} ± {e:.1g}' for s, e in slope[:, i])}"
        for i, name in enumerate(("greatest exponent", "(2.25)"))
    )
    signed = slope[:, 0, 0] * np.array([-1, 1, -1])
    # A slope within its doubt has no sign.
    certain = np.abs(slope[:, 0, 0]) > Beam.ERRORS * slope[:, 0, 1]
    if (certain & (signed < 0)).any():
        return False, text
    return (True if (certain & (signed > 0)).all() else None), text


def judge_exponents(dataset: xr.Dataset) -> list[Statement]:
    """C9, by the exponents and by (2.25) to the letter."""
    found = []
    v = np.asarray(dataset.v)
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
        found.append(positive_everywhere(variant, greatest, doubt, more))
        found.append(falls_rises_falls(variant, v, greatest, letter))
    return found


def _slope(v: np.ndarray, value: np.ndarray) -> tuple[float, float]:
    """Slope of a straight line and its standard error from the residuals; NaN where it is not told."""
    seen = np.isfinite(value)
    if seen.sum() < Beam.FEWEST_SPEEDS or seen.mean() < Beam.ENOUGH:
        return np.nan, np.nan
    v, value = v[seen] - v[seen].mean(), value[seen]
    slope = float(v @ value / (v @ v))
    residual = value - value.mean() - slope * v
    return slope, float(np.sqrt(residual @ residual / (v.size - 2) / (v @ v)))
