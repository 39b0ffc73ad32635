"""Inertia and friction of a double pendulum by inverse dynamics and by simulation; a motion held out.

- Inverse dynamics: filtered derivatives and linear least squares.
- By simulation of whole records from rest under the measured torques, from where inverse dynamics ends
  and from starts further away, with single and with multiple shooting.
  Without `all` the zeros of the encoders are unknown, and the gain of a motor is not.
- Trajectory 5, the last, was held out before anything was fitted. It is predicted from rest. The zeros
  of its encoders, which are others in every record, are told by its first seconds; so it was decided
  after a model without zeros had been scored on it, whose score is given too.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip.identification import (
    Fit,
    LevenbergMarquardt,
    MultipleShooting,
    WhitenessTest,
    compare,
    ljung_box,
    report,
)

from .._data import numbered
from .._experiment import Context, Experiment
from .._starts import Start, starts_told
from .._statement import Untold, Verdict, judge_all, statement
from .._thresholds import Measured
from ._arm import DRY, GEAR, INERTIAL, LINK, SIGMA, UNITS, ZEROS, errors, problem, shot
from ._inverse import inverse_dynamics
from ._record import Motion, load

# What F. Wiebe et al. identified: `model_3.0` and `model_h1.0` of this design. Their dry friction is
# `cf atan(100 v)`, which saturates at a half of pi times `cf`.
MODELS = {
    "published, 3.0": {
        "m1": 0.6416937799349799, "r1": 0.2, "I1": 0.02671076499939512, "m2": 0.563935954099688,
        "r2": 0.3212669909674605, "I2": 0.053878129629650884, "Ir": 9.937281205437459e-05,
        "b1": 0.001, "cf1": 0.093, "b2": 0.001, "cf2": 0.078,
    },
    "published, h1.0": {
        "m1": 0.5476215952387185, "r1": 0.2, "I1": 0.024210710672023246, "m2": 0.5978621372377623,
        "r2": 0.275, "I2": 0.053450262258304355, "Ir": 6.287203962819607e-05,
        "b1": 0.011078054769767294, "cf1": 0.09284176227841016, "b2": 0.004396496974140761,
        "cf2": 0.07708291842936994,
    },
}  # fmt: skip
FIRST = 3.0  # of the record held out, which shows the zeros of its encoders [s]
METHOD = LevenbergMarquardt(max_steps=100)
MULTIPLE = MultipleShooting(20, guess=shot, polish=METHOD)
INVERSE, SIMULATED = "inverse dynamics", "simulation"
BARE, GAINED = "simulation, no zeros", "simulation, motor gain"
NAMES = (*UNITS, "gain")
MRAD = 1e3 * Measured.ARM_LEFT_OUT
INERTIA_TO, FRICTION_TO = f"{Measured.ARM_INERTIA:.0%}", f"{Measured.ARM_FRICTION:.0%}"
LAGS = 20


def base_of(model: dict[str, float]) -> dict[str, float]:
    """The parameters that a motion shows, from masses, centres and inertias."""
    return {
        "moment_1": model["m1"] * model["r1"] + model["m2"] * LINK,
        "moment_2": model["m2"] * model["r2"],
        "inertia_1": model["I1"] + model["m2"] * LINK**2 + model["Ir"] * (GEAR**2 + 1.0),
        "inertia_2": model["I2"],
        "inertia_motor": model["Ir"],
        "viscous_1": model["b1"], "dry_1": 0.5 * np.pi * model["cf1"],
        "viscous_2": model["b2"], "dry_2": 0.5 * np.pi * model["cf2"],
    }  # fmt: skip


PUBLISHED = {name: base_of(model) for name, model in MODELS.items()}
REFERENCE = "published, 3.0"


def predicted(values: dict[str, Any], motion: Motion, every: int, zeros: bool) -> np.ndarray:
    """Errors [rad] on a record held out, both angles; with zeros of its encoders by its first part."""
    known = {name: max(float(values[name]), 0.0) for name in UNITS}
    known["gain"] = float(values.get("gain", 1.0))
    task = problem([motion], known, every, known=known, last=FIRST)
    found = dict.fromkeys(task.unknowns, 0.0)
    if zeros:
        found = task.fit(method=METHOD).values
    return errors(task, found, [motion])[0]


def from_afar(task: Any, ends: Fit, parameters: dict[str, Any]) -> dict[str, list[float]]:
    """Sums of squares over that of the fit, from random starts up to `spread` off: with single and with
    multiple shooting."""
    rng = np.random.default_rng(parameters["seed"])
    ways = ("single shooting", "multiple shooting")
    if not parameters["afar"]:
        return {name: [np.nan] * parameters["starts"] for name in ways}
    found: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(parameters["starts"]):
        start = {
            name: 0.0 if name.startswith(ZEROS)
            else float(ends.values[name]) * (1.0 + parameters["spread"] * rng.uniform(-1.0, 1.0))
            for name in task.unknowns
        }  # fmt: skip
        for name, method in zip(found, (METHOD, MULTIPLE), strict=True):
            fit = task.fit(method=method, start=start)
            found[name].append(float(fit.cost / ends.cost))
    return found


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    fitted = numbered("records", parameters["records"])
    scored = numbered("scored", parameters["scored"])
    if not fitted or not scored or {*fitted} & {*scored}:
        raise ValueError(
            f"--set scored={parameters['scored']}: it must name trajectories that are not among "
            f"records={parameters['records']}, and each list one at least."
        )
    motions = [load(context.data, number).until(parameters["duration"]) for number in fitted]
    held_out, *further = (load(context.data, n).until(parameters["duration"]) for n in scored)
    every = parameters["every"]
    values, deviations, relative = inverse_dynamics(motions)
    *_, without = inverse_dynamics(motions, zeros=False)
    columns: dict[str, tuple[Any, Any]] = {name: (row, {}) for name, row in PUBLISHED.items()}
    columns[INVERSE] = (values, deviations)
    task = problem(motions, values, every)
    tasks = {SIMULATED: task}
    if parameters["all"]:
        tasks[BARE] = problem(motions, values, every, zeros=False)
        tasks[GAINED] = problem(motions, values, every, gain=True)
    fits = {name: one.fit(method=METHOD) for name, one in tasks.items()}
    for name, fit in fits.items():
        columns[name] = (fit.values, fit.standard_errors())
    rows = {name: predicted(row, held_out, every, name != BARE) for name, (row, _) in columns.items()}
    time = held_out.time[::every]
    later = time > FIRST
    compared = compare(
        fits, held_out={name: rows[name][:, later].ravel() for name in fits}, sigma=SIGMA,
        noise_known=False,
    )  # fmt: skip
    far = from_afar(task, fits[SIMULATED], parameters)
    parts = task.parts(np.asarray(fits[SIMULATED].residual))
    series = {
        f"{name} of trajectory {number}": np.asarray(parts[str(i + 1)][name][1])
        for i, number in enumerate(fitted)
        for name in ("q1", "q2")
    }
    told = report(
        fits[SIMULATED], series=series, comparison=compared,
        whiteness=WhitenessTest(lags=LAGS),
        held_out={f"trajectory {scored[0]} [rad]": rows[SIMULATED][:, later].ravel()},
        title="Double pendulum, by simulation from rest",
    )  # fmt: skip
    print(told)
    said = starts_told(
        fitted=Start("rest", "at the first angles of a record, less the zeros of its encoders"),
        scored=Start("rest", f"likewise, with zeros by the first {FIRST:g} s, which are not counted"),
    )
    for number, motion in zip(scored[1:], further, strict=True):
        for name, (row, _) in columns.items():
            left = predicted(row, motion, every, name != BARE)[:, motion.time[::every] > FIRST]
            size = 1e3 * float(np.sqrt(np.mean(left**2)))
            print(f"Trajectory {number} after {FIRST:g} s, {name}: {size:.3g} mrad")

    def table(which: int) -> np.ndarray:
        return np.array(
            [[float(c[which].get(n, np.nan)) for n in NAMES] for c in columns.values()], float
        )

    data = {
        "estimate": (("fit", "unknown"), table(0)),
        "standard_error": (("fit", "unknown"), table(1)),
        "error": (("fit", "joint", "time"), np.array(list(rows.values())), {"units": "rad"}),
        "measured": (("joint", "time"), held_out.q[:, ::every], {"units": "rad"}),
        "zero": (
            ("record", "joint"),
            [
                [float(fits[SIMULATED].values[f"{zero}[{i + 1}]"]) for zero in ZEROS]
                for i in range(len(fitted))
            ],
            {"units": "rad"},
        ),
        "fitted": ("law", [SIGMA * float(np.sqrt(np.mean(f.residual**2))) for f in fits.values()]),
        "aic": ("law", compared.table["aic"]),
        "bic": ("law", compared.table["bic"]),
        "successful": ("law", [bool(fit.successful) for fit in fits.values()]),
        "p_value": ("series", [float(ljung_box(row, LAGS).p_value) for row in series.values()]),
        "from_afar": (("way", "start"), np.array(list(far.values()))),
        "unit": ("unknown", [*UNITS.values(), "1"]),
    }  # fmt: skip
    coords = {
        "fit": list(columns), "unknown": list(NAMES), "joint": [1, 2], "record": list(fitted),
        "law": list(fits), "series": list(series), "way": list(far),
        "time": ("time", time, {"units": "s"}),
    }  # fmt: skip
    attributes = {
        "relative": relative,
        "relative_without_zeros": without,
        "report": str(told),
        "starts": said,
    }
    return xr.Dataset(data, coords, attributes)


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 7.6))
    motion, wrong, ratio, bars = axes.flat
    colours = ["#1f4e9c", "#c0392b"]
    for joint, colour in zip((1, 2), colours, strict=True):
        row = data.sel(joint=joint)
        motion.plot(row.time, row.measured, color="0.7", lw=2.0)
        motion.plot(
            row.time, row.measured + row.error.sel(fit=SIMULATED), color=colour, lw=0.9,
            label=f"joint {joint}, predicted",
        )  # fmt: skip
    motion.set(xlabel="time [s]", ylabel="angle [rad]", title="trajectory held out; grey: measured")
    shown = {SIMULATED: "#1f4e9c", INVERSE: "#3d7a4b", REFERENCE: "0.6"}
    for name, colour in shown.items():
        size = np.sqrt((data.error.sel(fit=name) ** 2).mean("joint"))
        wrong.plot(data.time, 1e3 * size, color=colour, lw=0.9, label=name)
    wrong.axvline(FIRST, color="0.6", lw=0.7)
    wrong.set(
        xlabel="time [s]", ylabel="error of both angles [mrad]",
        title="zeros of the encoders from what is left of the line",
    )  # fmt: skip
    names = [*INERTIAL, *DRY]
    place = np.arange(len(names))
    for i, (name, colour) in enumerate(
        {INVERSE: "#3d7a4b", SIMULATED: "#1f4e9c", "published, h1.0": "0.6"}.items()
    ):
        row = data.sel(fit=name, unknown=names)
        known = data.estimate.sel(fit=REFERENCE, unknown=names)
        ratio.errorbar(
            place + 0.2 * (i - 1), row.estimate / known, 2.0 * row.standard_error / known, fmt="o",
            ms=3.5, lw=1.0, color=colour, label=name,
        )  # fmt: skip
    ratio.axhline(1.0, color="0.6", lw=0.7)
    ratio.set_xticks(place, [str(n).replace("_", "\n") for n in names], fontsize=7)
    ratio.set(ylabel="ratio to what is published (3.0), 2 s.e.", ylim=(0.5, 1.5), title="estimates")
    later = data.error.sel(time=data.time > FIRST)
    size = 1e3 * np.sqrt((later**2).mean(("joint", "time")))
    bars.barh(np.arange(data.fit.size), size, 0.6, color="#1f4e9c")
    bars.axvline(MRAD, color="0.5", lw=0.8)
    bars.set_yticks(np.arange(data.fit.size), [str(n).replace(", ", ",\n") for n in data.fit.values])
    bars.tick_params(axis="y", labelsize=8)
    bars.invert_yaxis()
    bars.set(xlabel="root mean square error [mrad]", title="trajectory held out, after 3 s")
    for axis in (motion, wrong, ratio):
        axis.legend(frameon=False, fontsize=7)
    for axis in axes.flat:
        axis.title.set_size(9)
    return figure


def _off(data: xr.Dataset, fit: str, names: tuple[str, ...]) -> dict[str, float]:
    """Relative differences of a fit from the model that its authors published last."""
    ratio = data.estimate.sel(fit=fit) / data.estimate.sel(fit=REFERENCE)
    return {name: float(ratio.sel(unknown=name)) - 1.0 for name in names}


def _listed(found: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:+.1%}" for name, value in found.items())


def _within(found: dict[str, float], bound: float) -> bool:
    return max(map(abs, found.values())) < bound


def _sizes(data: xr.Dataset, begin: float) -> dict[str, float]:
    """Error of the record held out from `begin` [s] on, by fit [mrad]."""
    part = data.error.sel(time=data.time > begin) if begin else data.error
    size = np.sqrt((part**2).mean(("joint", "time")))
    return {str(n): 1e3 * float(size.sel(fit=n)) for n in data.fit.values}


def _criteria(data: xr.Dataset, other: str) -> tuple[dict[str, float], dict[str, float]]:
    """AIC and BIC, by fit. Errors: `Untold` without the `other` fit."""
    if other not in data.law.values:
        raise Untold(f"there is no fit {other!r}")
    aic, bic = (
        {str(n): float(v) for n, v in zip(data.law.values, data[key].values, strict=True)}
        for key in ("aic", "bic")
    )
    return aic, bic


@statement("R4.1", f"Inverse dynamics gives the published inertial parameters to {INERTIA_TO}.")
def inverse_dynamics_gives_inertia(data: xr.Dataset) -> Verdict:
    """Relative differences."""
    off = _off(data, INVERSE, INERTIAL)
    told = f"{_listed(off)}; error of the torques {data.attrs['relative']:.1%}"
    return _within(off, Measured.ARM_INERTIA), told


@statement("R4.2", f"It gives the published dry friction to {FRICTION_TO}.")
def inverse_dynamics_gives_friction(data: xr.Dataset) -> Verdict:
    """Relative differences."""
    off = _off(data, INVERSE, DRY)
    return _within(off, Measured.ARM_FRICTION), _listed(off)


@statement("R4.3", f"Simulation gives the published inertial parameters to {INERTIA_TO}.")
def simulation_gives_inertia(data: xr.Dataset) -> Verdict:
    """Relative differences, also with a gain of the motor, and between the published models."""
    off, between = (_off(data, fit, INERTIAL) for fit in (SIMULATED, "published, h1.0"))
    gained = _off(data, GAINED, INERTIAL) if GAINED in data.fit.values else {}
    return (
        _within(off, Measured.ARM_INERTIA),
        f"{_listed(off)}; with a gain of the second motor {_listed(gained)}; the other published model "
        f"differs by {_listed(between)}",
    )


@statement("R4.4", f"It gives the published dry friction to {FRICTION_TO}.")
def simulation_gives_friction(data: xr.Dataset) -> Verdict:
    """Relative differences."""
    off = _off(data, SIMULATED, DRY)
    return _within(off, Measured.ARM_FRICTION), _listed(off)


@statement("R4.5", f"Fitted by simulation, it predicts the trajectory held out to {MRAD:g} mrad.")
def predicts_the_trajectory(data: xr.Dataset) -> Verdict:
    """Errors of the angles, with and without the time that shows the zeros of the encoders."""
    rest, whole = (_sizes(data, begin)[SIMULATED] for begin in (FIRST, 0.0))
    return (
        rest <= MRAD and whole <= MRAD,
        f"after {FIRST:g} s {rest:.1f} mrad, whole {whole:.1f} mrad",
    )


@statement("R4.6", "It predicts it better than the published models and inverse dynamics.")
def predicts_best(data: xr.Dataset) -> Verdict:
    """Errors by all fits."""
    rest = _sizes(data, FIRST)
    others = [name for name in rest if name not in (BARE, GAINED)]
    told = ", ".join(f"{name} {value:.1f} mrad" for name, value in rest.items())
    return min(others, key=lambda name: rest[name]) == SIMULATED, told


@statement("R4.7", "The encoders have zeros of their own in each record: AIC, BIC, prediction.")
def encoders_have_zeros(data: xr.Dataset) -> Verdict:
    """Whether the fit without zeros is worse by each of them."""
    (aic, bic), rest = _criteria(data, BARE), _sizes(data, FIRST)
    zeros = "; ".join(", ".join(f"{1e3 * v:+.0f}" for v in row) for row in data.zero.values)
    fitted = ", ".join(
        f"{law} {1e3 * v:.1f} mrad" for law, v in zip(data.law.values, data.fitted.values, strict=True)
    )
    return (
        all(found[SIMULATED] < found[BARE] for found in (aic, bic, rest)),
        f"zeros in mrad: {zeros}; torques by inverse dynamics "
        f"{data.attrs['relative_without_zeros']:.1%} off without zeros; angles as fitted {fitted}",
    )


@statement(
    "R4.8",
    "The second motor gives another torque than its current says: AIC, BIC, prediction.",
)
def motor_has_a_gain(data: xr.Dataset) -> Verdict:
    """Whether the fit with a gain is better by each of them."""
    (aic, bic), rest = _criteria(data, GAINED), _sizes(data, FIRST)
    gain = float(data.estimate.sel(fit=GAINED, unknown="gain"))
    return (
        all(found[GAINED] < found[SIMULATED] for found in (aic, bic, rest)),
        f"gain {gain:.3f}; AIC less by {aic[SIMULATED] - aic[GAINED]:.0f}, prediction "
        f"{rest[GAINED]:.1f} mrad with it and {rest[SIMULATED]:.1f} mrad without",
    )


@statement(
    "R4.9",
    "From starts up to 30% off single and multiple shooting end as low as from inverse dynamics, "
    f"to {Measured.SAME:g}.",
)
def starts_end_alike(data: xr.Dataset) -> Verdict:
    """Sums of squares over the least; open without these fits."""
    if data.from_afar.isnull().any():
        return None, "not run"
    told = (
        f"{way}: sum of squares {', '.join(f'{v:.4f}' for v in data.from_afar.sel(way=way).values)} "
        "times that"
        for way in map(str, data.way.values)
    )
    return float(data.from_afar.max()) < 1.0 + Measured.SAME, "; ".join(told)


@statement("R4.10", "The residuals are white.")
def residuals_are_white(data: xr.Dataset) -> Verdict:
    """Their probabilities, if they were white."""
    told = f"largest p {float(data.p_value.max()):.2g}: standard errors are too small"
    return float(data.p_value.min()) > Measured.WHITE, told


judge = judge_all("R4.")


EXPERIMENT = Experiment(
    name="identify-double-pendulum",
    title="Double pendulum: inertia and dry friction of both joints from measured motions",
    parameters={
        "every": 10, "records": "2,3,4", "scored": "5", "duration": 20.0, "all": True, "afar": True,
        "starts": 2, "spread": 0.3, "seed": 0,
    },
    # One record, as it begins: with zeros of the encoders, without a gain of the motor.
    quick={"records": "2", "duration": 5.0, "all": False, "afar": False},
    compute=compute,
    draw=draw,
    judge=judge,
    brought=True,
)  # fmt: skip
