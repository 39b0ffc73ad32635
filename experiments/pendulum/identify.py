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

from .._data import listed, numbered
from .._experiment import Context, Experiment
from .._starts import Start, starts_told
from .._statement import Verdict, judge_all, statement
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


def _scored(law: str, fit: Fit, segments: list[Segment], every: int) -> str:
    """Error on the rest of the segments of a further record, whose states alone are fitted."""
    known = {name: float(fit.values[name]) for name in terms_of(law)}
    task = problem(law, segments, every, hidden=HIDDEN, known=known)
    rows = rest_of(task, task.fit(method=METHOD), segments, every)
    sizes = ", ".join(f"{1e3 * size:.2f}" for size in rms(rows))
    return f"root mean square error on the last {HIDDEN:.0%} of each segment {sizes} mrad"


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    every_one, later_ones = load(context.data)
    chosen = numbered("records", parameters["records"], range(1, 1 + len(every_one)))
    if not chosen:
        raise ValueError("--set records=: it must name a segment at least.")
    first, second = [every_one[n - 1] for n in chosen], later_ones[: len(chosen)]
    others = {name: load(context.data, name) for name in listed("scored", parameters["scored"])}
    every = parameters["every"]
    fits, rest, later, left_out = {}, {}, {}, {}
    laws = tuple(LAWS)[:: 1 if parameters["all"] else len(LAWS) - 1]
    for law in laws:
        fits[law] = fit_of(law, first, every)
        rest[law], later[law] = rests_of(law, first, second, every)
        left_out[law] = folds_of(law, first, every) if parameters["folds"] else []
    held = {law: np.concatenate(rows) for law, rows in rest.items()}
    compared = compare(fits, held_out=held, sigma=SIGMA, noise_known=False)
    print(compared)
    said = starts_told(
        fitted=Start("fitted", "angle and velocity at the begin of each segment"),
        rest_of_segments=Start("fitted", f"to the first {1.0 - HIDDEN:.0%} of each segment"),
        left_out=Start("given", "by a cubic through the first samples of the segment"),
    )
    for name, (one, two) in others.items():
        for law in laws:
            print(f"{name}, {law}: {_scored(law, fits[law], [*one, *two], every)}")
    names = list(TERMS)
    values = {law: fit.values for law, fit in fits.items()}
    errors = {law: fit.standard_errors() for law, fit in fits.items()}

    def table(rows: dict[str, Any]) -> np.ndarray:
        return np.array([[float(rows[law].get(n, np.nan)) for n in names] for law in laws])

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
        "law": list(laws), "term": names, "segment": list(chosen),
        "later": np.arange(1, 1 + len(second)), "time": time,
    }  # fmt: skip
    return xr.Dataset(data, coords, {"starts": said})


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 3.8))
    motion, bars = axes
    colours = dict(zip(LAWS, ("#888888", "#b7791f", "#3d7a4b", "#1f4e9c"), strict=True))
    for law in data.law.values:
        colour = colours[str(law)]
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


def _laws(data: xr.Dataset) -> list[str]:
    """Names of the laws, the richest last."""
    return [str(law) for law in data.law.values]


def _errors(data: xr.Dataset, name: str, over: str) -> dict[str, float]:
    """Root mean square of an error over segments, by law [mrad]."""
    row = _whole(data[name], over).values
    return {law: 1e3 * float(v) for law, v in zip(_laws(data), row, strict=True)}


def _listed(found: dict[str, float]) -> str:
    return ", ".join(f"{law} {v:.2f} mrad" for law, v in found.items())


@statement("R2.1", "Every fit converges.")
def every_fit_converges(data: xr.Dataset) -> Verdict:
    """How many do."""
    told = f"{int(data.successful.sum())} of {data.law.size}"
    return bool(data.successful.all()), told


@statement("R2.2", "AIC, BIC and the rest of each segment choose dry friction with drag.")
def dry_friction_with_drag_is_chosen(data: xr.Dataset) -> Verdict:
    """The law that each of them chooses."""
    laws, rest = _laws(data), _errors(data, "rest", "segment")
    chosen = [laws[int(np.argmin(data[key].values))] for key in ("aic", "bic")]
    chosen.append(min(rest, key=lambda law: rest[law]))
    return set(chosen) == {laws[-1]}, f"chosen: {'; '.join(chosen)}. Rest: {_listed(rest)}"


@statement("R2.3", f"That law predicts the rest of each segment to {MRAD:g} mrad.")
def predicts_the_rest(data: xr.Dataset) -> Verdict:
    """Error of the richest law."""
    rest = _errors(data, "rest", "segment")[_laws(data)[-1]]
    return rest < MRAD, f"{rest:.2f} mrad"


@statement("R2.4", f"It predicts the rest of the segments for validation to {MRAD:g} mrad.")
def predicts_the_validation(data: xr.Dataset) -> Verdict:
    """Errors of all laws."""
    later = _errors(data, "validation", "later")
    return later[_laws(data)[-1]] < MRAD, _listed(later)


@statement("R2.5", "It predicts a segment that was left out best.")
def predicts_what_was_left_out(data: xr.Dataset) -> Verdict:
    """Errors of all laws; open without the fits that leave segments out."""
    out, richest = _errors(data, "left_out", "segment"), _laws(data)[-1]
    best = None if np.isnan(out[richest]) else min(out, key=lambda law: out[law]) == richest
    return best, _listed(out)


@statement(
    "R2.6",
    f"With viscous friction alone the gravity term is that published to {Measured.SWING_GRAVITY:.0%}.",
)
def gravity_is_as_published(data: xr.Dataset) -> Verdict:
    """Relative differences from what is published."""
    viscous = data.estimate.sel(law="viscous")
    off = {n: float(viscous.sel(term=n)) / value - 1.0 for n, value in PUBLISHED.items()}
    told = ", ".join(f"{name} {v:+.2%}" for name, v in off.items())
    return abs(off["gravity"]) < Measured.SWING_GRAVITY, told


@statement("R2.7", f"Dry friction is there: more than {Measured.SURE:g} standard errors from zero.")
def dry_friction_is_there(data: xr.Dataset) -> Verdict:
    """Estimates by the richest law with their standard errors."""
    law = _laws(data)[-1]
    value = {n: float(data.estimate.sel(law=law, term=n)) for n in terms_of(law)}
    error = {n: float(data.standard_error.sel(law=law, term=n)) for n in terms_of(law)}
    told = ", ".join(f"{n} {value[n]:.4g} +- {error[n]:.2g}" for n in value)
    return value["dry"] > Measured.SURE * error["dry"], told


judge = judge_all("R2.")


EXPERIMENT = Experiment(
    name="identify-pendulum",
    title="Free pendulum: the friction of its bearing from a measured decay",
    parameters={"records": "1,2,3,4", "scored": "", "every": 20, "all": True, "folds": True},
    # Of the laws the poorest and the richest, of the segments one of each kind.
    quick={"records": "1", "all": False, "folds": False},
    compute=compute,
    draw=draw,
    judge=judge,
    brought=True,
)  # fmt: skip
