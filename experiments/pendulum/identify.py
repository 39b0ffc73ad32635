"""Which friction a free pendulum has: four laws, chosen by what they predict of a decay.

Every law is fitted to the segments for identification, with the state at the begin of each. It has to
predict

- the rest of each of these segments, from a fit to their first part;
- the rest of the segments for validation, which have smaller swings than any other: only their states
  are fitted, to their first part;
- a whole segment that was left out, from the state that its first tenth of a second gives. Without the
  first segment, which alone swings beyond a right angle, that is an extrapolation.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip.identification import Fit, LevenbergMarquardt, compare

from .._experiment import Context, Experiment, Statement
from .._thresholds import Measured
from ._pendulum import LAWS, SIGMA, TERMS, predicted, problem, rest_of
from ._record import STEP, Segment, load

# From mass, length and inertia of K. Kaheman et al., arXiv 2205.06231: with viscous friction alone.
A, M, INERTIA, DAMPING, G = 0.147754901, 0.147584572, 1.09119e-4, 2.2394e-4, 9.81001
WHOLE = M * A * A + INERTIA
PUBLISHED = {"gravity": M * A * G / WHOLE, "viscous": DAMPING / WHOLE}
METHOD = LevenbergMarquardt(max_steps=100)
HIDDEN = 0.4  # part of a segment that is to be predicted
MRAD = 1e3 * Measured.SWING_LEFT_OUT


def terms_of(law: str) -> tuple[str, ...]:
    return ("gravity", "zero", *LAWS[law])


def fit_of(law: str, segments: list[Segment], every: int) -> Fit:
    return problem(law, segments, every).fit(method=METHOD)


def rms(rows: list[np.ndarray]) -> list[float]:
    return [float(np.sqrt(np.mean(row**2))) for row in rows]


def rests_of(law: str, first: list[Segment], second: list[Segment], every: int):
    """Errors on the rest of the segments for identification, and of those for validation."""
    task = problem(law, first, every, hidden=HIDDEN)
    fit = task.fit(method=METHOD)
    known = {name: float(fit.values[name]) for name in terms_of(law)}
    again = problem(law, second, every, hidden=HIDDEN, known=known)
    return (
        rest_of(task, fit, first, every),
        rest_of(again, again.fit(method=METHOD), second, every),
    )


def folds_of(law: str, segments: list[Segment], every: int) -> list[np.ndarray]:
    """Errors on each segment, left out of the fit."""
    found = []
    for i, segment in enumerate(segments):
        fit = fit_of(law, [s for j, s in enumerate(segments) if j != i], every)
        known = {name: float(fit.values[name]) for name in terms_of(law)}
        found.append(predicted(known, segment, every) - segment.phi[::every])
    return found


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    first, second = load(context.data)
    every = parameters["every"]
    fits, rest, later, left_out = {}, {}, {}, {}
    for law in LAWS:
        fits[law] = fit_of(law, first, every)
        rest[law], later[law] = rests_of(law, first, second, every)
        left_out[law] = folds_of(law, first, every) if parameters["folds"] else []
    held = {law: np.concatenate(rows) for law, rows in rest.items()}
    compared = compare(fits, held_out=held, sigma=SIGMA, noise_known=False)
    print(compared)
    names = list(TERMS)
    values = {law: fit.values for law, fit in fits.items()}
    errors = {law: fit.standard_errors() for law, fit in fits.items()}

    def table(rows: dict[str, Any]) -> np.ndarray:
        return np.array([[float(rows[law].get(n, np.nan)) for n in names] for law in LAWS])

    def by_segment(rows: dict[str, list[np.ndarray]], count: int) -> np.ndarray:
        return np.array([rms(found) or [np.nan] * count for found in rows.values()])

    in_rad = {"units": "rad"}
    data = {
        "estimate": (("law", "term"), table(values)),
        "standard_error": (("law", "term"), table(errors)),
        "successful": ("law", [bool(fit.successful) for fit in fits.values()]),
        "aic": ("law", compared.table["aic"]),
        "bic": ("law", compared.table["bic"]),
        "fitted": (
            "law",
            [SIGMA * rms([np.asarray(f.data_residual)])[0] for f in fits.values()],
            in_rad,
        ),
        "rest": (("law", "segment"), by_segment(rest, len(first)), in_rad),
        "left_out": (("law", "segment"), by_segment(left_out, len(first)), in_rad),
        "validation": (("law", "later"), by_segment(later, len(second)), in_rad),
        "error": (("law", "time"), np.array([rows[0] for rows in later.values()]), in_rad),
        "unit": ("term", [TERMS[n][0] for n in names]),
    }
    size, shown = second[0].phi[::every].size, later["viscous"][0].size
    time = STEP * every * np.arange(size - shown, size)
    coords = {
        "law": list(LAWS), "term": names, "segment": np.arange(1, 1 + len(first)),
        "later": np.arange(1, 1 + len(second)), "time": time,
    }  # fmt: skip
    return xr.Dataset(data, coords)


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 3.8))
    motion, bars = axes
    colours = ["#888888", "#b7791f", "#3d7a4b", "#1f4e9c"]
    for law, colour in zip(data.law.values, colours, strict=True):
        motion.plot(data.time, 1e3 * data.error.sel(law=law), lw=0.8, color=colour, label=str(law))
    motion.set(
        xlabel="time [s]", ylabel="error of the angle [mrad]",
        title="rest of the first segment for validation",
    )  # fmt: skip
    place = np.arange(data.law.size)
    shown = {
        "fitted": data.fitted, "rest": _whole(data.rest, "segment"),
        "rest, validation": _whole(data.validation, "later"),
        "one segment left out": _whole(data.left_out, "segment"),
    }  # fmt: skip
    for i, (name, row) in enumerate(shown.items()):
        bars.barh(place + 0.2 * (i - 1.5), 1e3 * row, 0.19, label=name)
    bars.axvline(MRAD, color="0.5", lw=0.8)
    bars.set_yticks(place, [str(law).replace(", ", ",\n") for law in data.law.values], fontsize=8)
    bars.set(xlabel="root mean square error [mrad]", xscale="log")
    bars.invert_yaxis()
    for axis in axes:
        axis.legend(frameon=False, fontsize=7)
    return figure


def _whole(row: xr.DataArray, over: str) -> xr.DataArray:
    return (row**2).mean(over) ** 0.5


def judge(data: xr.Dataset) -> list[Statement]:
    laws = [str(law) for law in data.law.values]
    richest = laws[-1]

    def told(row: xr.DataArray) -> dict[str, float]:
        return {law: 1e3 * float(v) for law, v in zip(laws, row.values, strict=True)}

    def listed(found: dict[str, float]) -> str:
        return ", ".join(f"{law} {v:.2f} mrad" for law, v in found.items())

    rest, later = told(_whole(data.rest, "segment")), told(_whole(data.validation, "later"))
    out = told(_whole(data.left_out, "segment"))
    chosen = [laws[int(np.argmin(data[key].values))] for key in ("aic", "bic")]
    chosen.append(min(rest, key=lambda law: rest[law]))
    viscous, last = data.estimate.sel(law="viscous"), data.estimate.sel(law=richest)
    off = {n: float(viscous.sel(term=n)) / value - 1.0 for n, value in PUBLISHED.items()}
    error = data.standard_error.sel(law=richest)
    return [
        Statement("R2.1", "Every fit converges.", bool(data.successful.all()),
                  f"{int(data.successful.sum())} of {len(laws)}"),
        Statement("R2.2", "AIC, BIC and the rest of each segment choose dry friction with drag.",
                  set(chosen) == {richest}, f"chosen: {'; '.join(chosen)}. Rest: {listed(rest)}"),
        Statement("R2.3", f"That law predicts the rest of each segment to {MRAD:g} mrad.",
                  rest[richest] < MRAD, f"{rest[richest]:.2f} mrad"),
        Statement("R2.4", f"It predicts the rest of the segments for validation to {MRAD:g} mrad.",
                  later[richest] < MRAD, listed(later)),
        Statement("R2.5", "It predicts a segment that was left out best.",
                  None if np.isnan(out[richest]) else min(out, key=lambda law: out[law]) == richest,
                  listed(out)),
        Statement("R2.6", "With viscous friction alone the gravity term is that published to "
                  f"{Measured.SWING_GRAVITY:.0%}.", abs(off["gravity"]) < Measured.SWING_GRAVITY,
                  ", ".join(f"{name} {100 * v:+.2f}%" for name, v in off.items())),
        Statement("R2.7", f"Dry friction is there: more than {Measured.SURE:g} standard "
                  "errors from zero.",
                  float(last.sel(term="dry")) > Measured.SURE * float(error.sel(term="dry")),
                  ", ".join(f"{n} {float(last.sel(term=n)):.4g} +- {float(error.sel(term=n)):.2g}"
                            for n in terms_of(richest))),
    ]  # fmt: skip


EXPERIMENT = Experiment(
    name="identify-pendulum",
    title="Free pendulum: the friction of its bearing from a measured decay",
    parameters={"every": 20, "folds": True},
    quick={"folds": False},
    compute=compute,
    draw=draw,
    judge=judge,
    brought=True,
)  # fmt: skip
