"""Mass and friction of the positioning system, by inverse dynamics and by simulation, and what is left.

- Inverse dynamics: filtered derivatives and linear least squares, as the authors of the record do.
- By simulation under the known controller: its command is compared with the measured one.
- By simulation open loop from the measured command, which the benchmark scores by the position. There a
  force of 0.01 N too much is an error of a millimetre at the end.

Without `all` one law is fitted by position, and none to a part of the command or to a simulated one.
`--set records=FILE,...` fits several records together; the first is shown. `--set scored=FILE,...`
scores all laws on further records of the same format too, to which none is fitted. Every score is told
from the state that the first samples give and from rest.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip.identification import (
    Fit,
    LevenbergMarquardt,
    Unknown,
    WhitenessTest,
    autocorrelation,
    compare,
    least_squares,
    ljung_box,
    profile,
    report,
)

from .._data import listed
from .._experiment import Context, Experiment
from .._starts import Start, starts_told
from .._statement import Untold, Verdict, judge_all, statement
from .._thresholds import Measured
from ._inverse import inverse_dynamics
from ._record import NAME, Record, load
from ._residuals import SIGMA, blocks, by_command, by_position, commands, joined
from ._stage import FIRST, position

PUBLISHED = {
    "symmetric": {"mass": 95.1089, "viscous": 203.5034, "dry": 20.3935, "offset": -3.1648},
    "asymmetric": {
        "mass": 95.1540, "viscous_forward": 166.7061, "dry_forward": 20.1440,
        "viscous_backward": 240.4236, "dry_backward": 20.6277,
    },
}  # fmt: skip
UNITS = {"mass": "kg", "offset": "N", "rise": "N", "v_s": "m/s"}
UNKNOWNS = (
    "mass", "viscous", "dry", "offset", "viscous_forward", "viscous_backward", "dry_forward",
    "dry_backward", "rise", "v_s",
)  # fmt: skip
RICHER = "asymmetric with rise"
LAGS = 20


def unit_of(name: str) -> str:
    return UNITS.get(name, "N s/m" if name.startswith("viscous") else "N")


def starts(law: str, rng: np.random.Generator, spread: float) -> dict[str, Unknown]:
    """Unknowns that begin `spread` above or below what is published."""
    found = {}
    for name, value in PUBLISHED[law].items():
        start = value * (1.0 + spread * rng.choice([-1.0, 1.0]))
        bounds = (None, None) if name == "offset" else (0.0, None)
        found[name] = Unknown(start, bounds=bounds, unit=unit_of(name))
    return found


def part(record: Record, begin: int, end: int) -> Record:
    return record._replace(**{key: getattr(record, key)[begin:end] for key in ("q", "reference", "u")})


def score(values: dict[str, Any], record: Record, moving: float = 1.0) -> float:
    """Root mean square error of the position [m], open loop, after the samples for the state; from the
    state that these give, or with `moving` 0 from rest."""
    at_rest_or_not = np.float64(moving)
    error = np.asarray(position(of_both_sides(values), record, 1, at_rest_or_not)) - record.q
    return float(np.sqrt(np.mean(error[FIRST:] ** 2)))


def of_both_sides(values: dict[str, Any]) -> dict[str, Any]:
    """The same law told by direction, so that all laws share a program."""
    told = {name: np.float64(value) for name, value in values.items()}
    for kind in ("viscous", "dry"):
        if kind in told:
            value = told.pop(kind)
            told |= {f"{kind}_forward": value, f"{kind}_backward": value}
    return {"offset": np.float64(0.0)} | told


def best_of(residual: Any, law: str, parameters: dict[str, Any], steps: int = 60) -> list[Fit]:
    """Fits from the random starts, the best first."""
    rng = np.random.default_rng(parameters["seed"])
    method = LevenbergMarquardt(max_steps=steps)
    fits = [
        least_squares(residual, starts(law, rng, parameters["spread"]), method)
        for _ in range(parameters["starts"])
    ]
    return sorted(fits, key=lambda fit: float(fit.cost))


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    if not 0.2 <= parameters["split"] <= 0.8:
        raise ValueError(f"--set split={parameters['split']}: it must be from 0.2 to 0.8.")
    fitted = listed("records", parameters["records"])
    if not fitted:
        raise ValueError("--set records=: it must name a record.")
    records = [load(context.data, name) for name in fitted]
    further = {name: load(context.data, name) for name in listed("scored", parameters["scored"])}
    kept = parameters["kept"]
    if parameters["duration"] < 24.84:
        records = [part(record, 0, round(parameters["duration"] * 1000)) for record in records]
    measured = joined(records, lambda record: blocks(record.u, kept))
    columns: dict[str, dict[str, Any]] = {}
    residuals, fits = {}, {}
    for law in PUBLISHED:
        values, errors, relative = inverse_dynamics(records, law == "asymmetric")
        columns[f"inverse dynamics, {law}"] = {"values": values, "errors": errors, "left": relative}
        found = best_of(by_command(records, measured, kept), law, parameters)
        fits[law] = found[0]
        residuals[law] = np.asarray(found[0].residual)
        apart = max(
            abs(float(fit.values[name] / found[0].values[name]) - 1.0)
            for fit in found for name in fit.names
        )  # fmt: skip
        columns[f"by command, {law}"] = _column(found[0], apart)
    if parameters["all"]:
        # What the true law leaves: its own run with white noise of the size that was found.
        truth = {name: fits["asymmetric"].values[name] for name in fits["asymmetric"].names}
        noise = np.random.default_rng(parameters["seed"] + 1).normal(size=measured.size)
        made = np.asarray(commands(truth, records, kept)) + SIGMA * noise
        again = best_of(by_command(records, made, kept), "asymmetric", parameters | {"starts": 1})[0]
        residuals["asymmetric, simulated"] = np.asarray(again.residual)
    splits = [round(parameters["split"] * record.q.size) for record in records]
    firsts = [part(record, 0, split) for record, split in zip(records, splits, strict=True)]
    record, split = records[0], splits[0]  # what is shown
    over = {"all": record, "first": firsts[0], "second": part(record, split, record.q.size)}
    over |= dict(zip(fitted[1:], records[1:], strict=True))
    over |= further
    models: dict[str, Any] = {}
    ends = {}
    for law, values in PUBLISHED.items():
        models[f"published, {law}"] = values
    for law, fit in fits.items() if further else ():
        # To the whole command, so that only a further record has not been seen.
        models[f"command, {law}"] = fit.values
    for law in PUBLISHED if parameters["all"] else ("asymmetric",):
        found = best_of(by_position(firsts, kept), law, parameters | {"starts": 1, "spread": 0.0})[0]
        columns[f"by position, {law}"] = _column(found, 0.0)
        name = f"position of the first part, {law}"
        models[name] = found.values
        ends[law] = found
    shown = ends["asymmetric"]
    if parameters["all"]:
        shown = _with_rise(by_position(firsts, kept), shown)
        columns[f"by position, {RICHER}"] = _column(shown, 0.0)
        models[f"position of the first part, {RICHER}"] = shown.values
    held_out = {}
    # Fitted to the first part of the command of each, scored on the rest of the same runs.
    early = joined(
        records, lambda record: np.arange(n := record.u.size // kept) < n * 6 // 10
    )  # fmt: skip
    for law in PUBLISHED if parameters["all"] else ():
        whole = by_command(records, measured, kept)
        method = LevenbergMarquardt(max_steps=40)
        known = least_squares(lambda p, whole=whole: whole(p)[early], _near(fits[law]), method)
        held_out[law] = SIGMA * np.asarray(whole(known.values))[~early]
        models[f"command of the first part, {law}"] = known.values
    compared = compare(fits, held_out=held_out or None, sigma=SIGMA, noise_known=False)
    intervals = None
    if parameters["profile"]:
        intervals = profile(
            by_command(records, measured, kept), fits["asymmetric"], points=2, max_steps=100
        )
    steps = joined(records, lambda record: np.gradient(blocks(record.reference, kept)))
    last = {"command [V]": held_out["asymmetric"]} if held_out else None
    told = report(
        fits["asymmetric"], profile=intervals, series={"command": residuals["asymmetric"]},
        whiteness=WhitenessTest(inputs={"reference": steps}),
        held_out=last, comparison=compared,
        title="EMPS, asymmetric friction, by the command of the controller",
    )  # fmt: skip
    print(told)
    said = starts_told(fitted=GIVEN, scored=GIVEN)
    scores = {name: [score(values, r) for r in over.values()] for name, values in models.items()}
    for name, one in (dict(zip(fitted, records, strict=True)) | further).items():
        print(_ranking(name, one, models))
    computed = np.asarray(position(of_both_sides(shown.values), record, 1))[::kept]
    return _dataset(
        columns, residuals, scores, compared, record, computed, split, kept, str(told), list(over)
    ).assign_attrs(starts=said)


GIVEN = Start("given", f"place and speed by the first {FIRST} samples")


def _ranking(name: str, record: Record, models: dict[str, Any]) -> str:
    """The laws by their error of the position over a record, from both starts: one decides on it."""
    starts = {GIVEN: 1.0, Start("rest"): 0.0}
    lines = [f"{name}, error of the position open loop"]
    for start, moving in starts.items():
        found = sorted((1e3 * score(values, record, moving), law) for law, values in models.items())
        told = ", ".join(f"{law} {error:.3g} mm" for error, law in found)
        lines.append(f"  {start}: {told}")
    return "\n".join(lines)


def _near(fit: Fit) -> dict[str, Unknown]:
    return {
        name: Unknown(float(fit.values[name]), bounds=fit.space.bounds[i])
        for i, name in enumerate(fit.names)
    }


def _with_rise(residual: Any, fit: Fit) -> Fit:
    """Friction that rises towards rest on top of a law that was fitted."""
    start = _near(fit) | {
        "rise": Unknown(0.5, bounds=(0.0, None)), "v_s": Unknown(5e-3, bounds=(1e-4, 0.1)),
    }  # fmt: skip
    return least_squares(residual, start, LevenbergMarquardt(max_steps=60))


def _column(fit: Fit, apart: float) -> dict[str, Any]:
    return {
        "values": {name: float(v) for name, v in fit.values.items()},
        "errors": {name: float(v) for name, v in fit.standard_errors().items()},
        "left": float(fit.reduced_chi_squared), "apart": apart,
    }  # fmt: skip


def _dataset(
    columns, residuals, scores, compared, record, computed, split, kept, told, over
) -> xr.Dataset:
    def table(key):
        return np.array([[c[key].get(n, np.nan) for n in UNKNOWNS] for c in columns.values()], float)

    tests = [ljung_box(row, LAGS) for row in residuals.values()]
    own = [np.asarray(autocorrelation(row, LAGS).values) for row in residuals.values()]
    band = np.asarray(autocorrelation(next(iter(residuals.values())), LAGS).band)
    data = {
        "estimate": (("fit", "unknown"), table("values")),
        "standard_error": (("fit", "unknown"), table("errors")),
        "left": ("fit", [c["left"] for c in columns.values()]),
        "apart": ("fit", [c.get("apart", np.nan) for c in columns.values()]),
        "p_value": ("series", [float(t.p_value) for t in tests]),
        "ljung_box": ("series", [float(t.statistic) for t in tests]),
        "residual": (("series", "row"), list(residuals.values())),
        "autocorrelation": (("series", "lag"), own),
        "band": ("lag", band),
        "score": (("model", "over"), np.array(list(scores.values())), {"units": "m"}),
        "measured": ("time", record.q[::kept], {"units": "m"}),
        "computed": ("time", computed, {"units": "m"}),
        "unit": ("unknown", [unit_of(name) for name in UNKNOWNS]),
    }
    none = np.full(len(compared.names), np.nan)
    for column in ("aic", "bic", "held_out"):
        data[column] = ("law", compared.table.get(column, none))
    coords = {
        "fit": list(columns), "unknown": list(UNKNOWNS), "series": list(residuals),
        "lag": np.arange(LAGS + 1), "model": list(scores), "over": over,
        "law": list(compared.names), "time": ("time", 1e-3 * np.arange(record.q.size)[::kept]),
    }  # fmt: skip
    return xr.Dataset(data, coords, {"split": 1e-3 * split, "report": told, "step": 1e-3 * kept})


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 7.2))
    motion, ratio, own, bars = axes.flat
    time = data.time.values
    motion.plot(time, 1e3 * (data.computed - data.measured), lw=0.9, color="#1f4e9c")
    motion.axvline(data.attrs["split"], color="0.6", lw=0.7)
    motion.set(
        xlabel="time [s]", ylabel="error of the position [mm]",
        title=f"open loop, {RICHER if RICHER in str(data.fit.values) else 'asymmetric'} law, fitted "
        "left of the line",
    )  # fmt: skip
    colours = ["#1f4e9c", "#b7791f", "#3d7a4b", "#c0392b", "#6b4fa0", "#555555", "#888888"]
    for i, name in enumerate(data.fit.values):
        law = "asymmetric" if "asymmetric" in str(name) else "symmetric"
        names = list(PUBLISHED[law])
        part_of = data.sel(fit=name, unknown=names)
        known = np.array([PUBLISHED[law][n] for n in names])
        place = np.array([UNKNOWNS.index(n) for n in names]) + 0.1 * (i - 3)
        ratio.errorbar(
            place, 100 * (part_of.estimate / known - 1.0),
            200 * part_of.standard_error / np.abs(known),
            fmt="o", ms=3, lw=1.0, color=colours[i % len(colours)], label=str(name),
        )  # fmt: skip
    ratio.axhline(0.0, color="0.6", lw=0.7)
    ratio.set_xticks(range(8), [n.replace("_", "\n") for n in UNKNOWNS[:8]], fontsize=7)
    ratio.set(ylabel="off what is published [%], 2 s.e.", ylim=(-20, 20), title="estimates")
    for i, name in enumerate(data.series.values):
        row = data.sel(series=name)
        own.plot(
            data.lag[1:], row.autocorrelation[1:], "o-", ms=3, lw=0.8, color=colours[i],
            label=f"{name}: p = {float(row.p_value):.2g}",
        )  # fmt: skip
    own.fill_between(data.lag[1:], -data.band[1:], data.band[1:], color="0.88", lw=0)
    step = data.attrs["step"]
    own.set(xlabel=f"lag [{step:g} s]", title="autocorrelation of the residuals of the command")
    place = np.arange(data.model.size)
    parts = [str(name) for name in data.over.values if name != "all"]
    wide = 0.72 / len(parts)
    for k, over in enumerate(parts):
        place_of = place + wide * (k - 0.5 * (len(parts) - 1))
        label = f"{over} part" if over in ("first", "second") else over
        bars.barh(place_of, 1e3 * data.score.sel(over=over), 0.94 * wide, label=label)
    bars.set_yticks(place, [str(m).replace(", ", "\n") for m in data.model.values], fontsize=7)
    bars.invert_yaxis()
    bars.set(xlabel="root mean square error, open loop [mm]", title="score of the benchmark")
    for axis in (ratio, own, bars):
        axis.legend(frameon=False, fontsize=6)
    for axis in axes.flat:
        axis.title.set_size(9)
    return figure


def _off(data: xr.Dataset, fit: str, law: str) -> dict[str, float]:
    """Relative differences of a fit from what is published, by parameter."""
    row, known = data.estimate.sel(fit=f"{fit}, {law}"), PUBLISHED[law]
    return {n: abs(float(row.sel(unknown=n)) / known[n] - 1.0) for n in known}


def _listed(found: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2%}" for name, value in found.items())


def _scores(data: xr.Dataset, over: str) -> dict[str, float]:
    """Error of the position in open loop, by model [mm]."""
    row = data.score.sel(over=over).values
    return {str(m): 1e3 * float(v) for m, v in zip(data.model.values, row, strict=True)}


@statement("R1.1", f"Inverse dynamics gives the published values to {Measured.EMPS_INVERSE:.1%}.")
def inverse_dynamics_as_published(data: xr.Dataset) -> Verdict:
    """Relative differences."""
    off = _off(data, "inverse dynamics", "symmetric")
    return max(off.values()) < Measured.EMPS_INVERSE, _listed(off)


@statement(
    "R1.2",
    f"Simulation from starts 50% off gives M to {Measured.EMPS_MASS:.0%}, "
    f"Fv and Fc to {Measured.EMPS_FRICTION:.0%}.",
)
def simulation_as_published(data: xr.Dataset) -> Verdict:
    """Relative differences."""
    off = _off(data, "by command", "symmetric")
    friction = max(off["viscous"], off["dry"])
    return off["mass"] < Measured.EMPS_MASS and friction < Measured.EMPS_FRICTION, _listed(off)


@statement("R1.3", f"All starts end at the same estimate, to {Measured.SAME:g}.")
def starts_end_alike(data: xr.Dataset) -> Verdict:
    """Largest relative difference between the estimates."""
    apart = float(data.apart.sel(fit="by command, symmetric"))
    return apart < Measured.SAME, f"{apart:.2g} apart"


@statement("R1.4", "Friction differs between the directions, and the comparison prefers it.")
def friction_is_asymmetric(data: xr.Dataset) -> Verdict:
    """What AIC, BIC and the part held out choose, and how far the estimates are from the published."""
    laws = [str(law) for law in data.law.values]
    if data.held_out.isnull().all():
        raise Untold("nothing was held out of the fits to the command")
    chosen = [laws[int(np.argmin(data[name].values))] for name in ("aic", "bic", "held_out")]
    off = _off(data, "by command", "asymmetric")
    return (
        set(chosen) == {"asymmetric"} and max(off.values()) < Measured.EMPS_ASYMMETRY,
        f"AIC, BIC, held-out choose {', '.join(chosen)}; off what is published {_listed(off)}",
    )


@statement(
    "R1.5",
    "The residuals of the symmetric law are not white; those of a run of the true law with white noise "
    "are.",
)
def whiteness_finds_the_wrong_law(data: xr.Dataset) -> Verdict:
    """Probabilities of the residuals, if they were white."""
    p = dict(zip(map(str, data.series.values), map(float, data.p_value), strict=True))
    if "asymmetric, simulated" not in p:
        raise Untold("the true law was not simulated")
    return (
        p["symmetric"] < Measured.WHITE < p["asymmetric, simulated"],
        ", ".join(f"{name}: p = {value:.2g}" for name, value in p.items()),
    )


@statement(
    "R1.6",
    "Open loop, the asymmetric law fitted to the command of the first part scores better on the second "
    "than the published symmetric law, fitted to both.",
)
def predicts_the_second_part(data: xr.Dataset) -> Verdict:
    """Errors of all models."""
    rest = _scores(data, "second")
    if "command of the first part, asymmetric" not in rest:
        raise Untold("the law was not fitted to the command of the first part")

    def listed(found: dict[str, float]) -> str:
        return ", ".join(f"{m} {v:.2f} mm" for m, v in found.items())

    return (
        rest["command of the first part, asymmetric"] < rest["published, symmetric"],
        f"second part: {listed(rest)}; whole record: {listed(_scores(data, 'all'))}",
    )


judge = judge_all("R1.")


EXPERIMENT = Experiment(
    name="identify-emps",
    title="EMPS: mass and friction of a positioning system from its measured record",
    parameters={
        "starts": 4, "spread": 0.5, "kept": 50, "split": 0.6, "duration": 24.84, "profile": True,
        "all": True, "records": NAME, "scored": "", "seed": 0,
    },
    # Two of four strokes: by command both laws, by position the asymmetric one alone.
    quick={"starts": 1, "split": 0.5, "duration": 12.5, "profile": False, "all": False},
    compute=compute,
    draw=draw,
    judge=judge,
    brought=True,
)  # fmt: skip
