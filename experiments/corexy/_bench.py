"""Friction and tensions of a user's own machine, from its log."""

import pathlib
import warnings
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import corexy_jax as cx
import stickslip as ss
from stickslip.identification import Fit, Observed, Problem, Record, Unknown, profile, report

from .._data import listed
from .._experiment import Context, Experiment
from .._starts import Start, starts_told
from ._advice import FAR, GOOD, SURE, advice, lines_of, score_told, sketch
from ._log import KIND, Log, machine_told, pairs, read_log, read_machine, write_machine, write_template

SENSOR_NOISE = {"place": 1e-4, "angle": 1e-3, "speed": 0.05}
UNIT = {"place": "m", "angle": "rad", "speed": "rad/s"}
FITTED = {"P1": "N", "P2": "N", "m": "kg", "M": "kg", "r_f": "m"} | dict.fromkeys(
    ("mu_s", "mu_k", "mu_1s_b", "mu_2s_b", "mu_1k_b", "mu_2k_b"), ""
)


def _observed(name: str, sd: float) -> Observed:
    def seen(t, y, system):
        return getattr(y, name)

    return Observed(seen, sd, UNIT[KIND[name]])


def problem_of(
    log: Log, machine: cx.CoreXYParameters, unknowns: tuple[str, ...], noise: dict[str, float],
    tolerance: float,
) -> Problem:  # fmt: skip
    """The unknowns of the machine from its log, which begins at rest."""

    def system(p, inputs):
        return cx.CoreXY(cx.with_values(machine, {name: p[name] for name in unknowns}), log.voltage)

    return Problem(
        system=system,
        initial_state=lambda p, inputs: system(p, inputs).state(),
        unknowns={
            name: Unknown(float(getattr(machine, name)), bounds=(0.0, None), unit=FITTED[name])
            for name in unknowns
        },
        observed={
            name: _observed(name, noise.get(name, SENSOR_NOISE[KIND[name]])) for name in log.measured
        },
        records=Record(log.times, log.measured),
        integrator=ss.Integrator("tsit5", ss.AdaptiveStep(tolerance, tolerance)),
    )


def _unknowns(text: str) -> tuple[str, ...]:
    names = tuple(filter(None, (name.strip() for name in text.split(","))))
    if not names or len(set(names)) < len(names) or not set(names) <= set(FITTED):
        raise ValueError(
            f"--set unknowns={text}: it must be different names among {', '.join(FITTED)}, with commas."
        )
    return names


def _noise(text: str, log: Log) -> dict[str, float]:
    try:
        found = {k: float(v) for k, v in pairs("noise", text, tuple(log.measured)).items()}
    except ValueError as error:
        raise ValueError(f"--set noise={text}: {error}") from None
    for name, value in found.items():
        if not 0.0 < value < np.inf:
            raise ValueError(f"--set noise={name}={value}: it must be positive.")
    return found


START = Start("rest")


def best_fit(
    task: Problem, names: tuple[str, ...], machine: cx.CoreXYParameters, parameters: dict[str, Any]
) -> Fit:
    """A fit down to the noise, or the best: from the machine's own values and from others around them,
    one after the other. Where a belt begins to slip, the sum of squares has more than one minimum."""
    rng = np.random.default_rng(parameters["seed"])
    own = np.array([float(getattr(machine, name)) for name in names])
    rows = parameters["spread"] ** rng.uniform(-1.0, 1.0, (parameters["starts"], own.size))
    rows[0] = 1.0
    found: list[Fit] = []
    with warnings.catch_warnings():
        # Of a start that leads nowhere; what is said of the best one is in its advice.
        warnings.simplefilter("ignore", UserWarning)
        for row in rows:
            found.append(task.fit(start=dict(zip(names, own * row, strict=True))))
            if float(found[-1].reduced_chi_squared) < GOOD:
                break
    return min(found, key=lambda fit: float(fit.cost))


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    assert context.data is not None
    log = read_log(
        context.data, parameters["columns"], parameters["units"], parameters["counts_per_turn"]
    )
    names = _unknowns(parameters["unknowns"])
    noise = _noise(parameters["noise"], log)
    machine = read_machine(parameters["machine"])
    task = problem_of(log, machine, names, noise, parameters["tolerance"])
    fit = best_fit(task, names, machine, parameters)
    intervals = profile(task.residual_function, fit, points=4) if parameters["profile"] else None
    parts = next(iter(task.parts(fit.residual).values()))
    told = report(
        fit, profile=intervals, series={name: row for name, (_, row) in parts.items()},
        title=f"CoreXY, {context.data.name}",
    )  # fmt: skip
    print(told)
    starts = starts_told(fitted=START, scored=START)
    seen = task.simulate(fit.values)
    final = cx.with_values(machine, dict(fit.values))
    tensions = {name: float(getattr(final, name)) for name in ("P1", "P2")}
    off = {name: row - np.asarray(seen.observed[name]) for name, row in log.measured.items()}
    rms = {name: float(np.sqrt(np.mean(row**2))) for name, row in off.items()}
    ranges = {name: float(np.ptp(row)) for name, row in log.measured.items()}
    first = [
        f"The log: {log.times.size:,} rows over {log.times[-1]:.4g} s.",
        machine_told(parameters["machine"]), *filter(None, [log.missing]),
    ]  # fmt: skip
    said = "\n".join([*first, *advice(fit, intervals, tensions, rms, ranges)])
    print(f"\n{said}")
    chi_squared = float(fit.reduced_chi_squared)
    if chi_squared <= FAR:
        beside = context.stores.parent / f"{context.data.stem}-machine-fitted.json"
        beside.parent.mkdir(parents=True, exist_ok=True)
        write_machine(final, beside)
        print(f"The machine with these values: {beside}, for --set machine= of the other commands.")
    for name in listed("scored", parameters["scored"]):
        path = pathlib.Path(name) if pathlib.Path(name).exists() else context.data.parent / name
        other = read_log(
            path, parameters["columns"], parameters["units"], parameters["counts_per_turn"]
        )
        further = problem_of(other, machine, names, noise, parameters["tolerance"])
        score = further.score(fit)
        print(f"\n{name}, to which nothing was fitted, {START}\n{score}")
        print(score_told(max(float(np.max(row)) for row in score.chi_squared.values())))
    errors, trusted = fit.standard_errors(), fit.standard_errors(robust=chi_squared > GOOD)
    units = {name: {"units": UNIT[KIND[name]]} for name in log.measured}
    data: dict[str, Any] = {
        "estimate": ("unknown", [float(fit.values[n]) for n in names]),
        "standard_error": ("unknown", [float(errors[n]) for n in names]),
        "half": ("unknown", [SURE * float(trusted[n]) for n in names]),
        "start": ("unknown", [float(getattr(machine, n)) for n in names]),
    }
    for name, row in log.measured.items():
        data[f"{name}_measured"] = ("time", row, units[name])
        data[f"{name}_computed"] = ("time", np.asarray(seen.observed[name]), units[name])
    if intervals is not None:
        data["lower"], data["upper"] = (
            ("unknown", [float(side[n]) for n in names]) for side in (intervals.lower, intervals.upper)
        )
    return xr.Dataset(
        data, {"unknown": list(names), "time": ("time", log.times, {"units": "s"})},
        {
            "report": str(told), "advice": said, "starts": starts, **tensions,
            "unknown_units": ",".join(fit.units[n] or "" for n in names),
            "successful": int(bool(fit.successful)), "chi_squared": chi_squared,
        },
    )  # fmt: skip


def draw(data: xr.Dataset) -> Figure:
    names = [str(k).removesuffix("_measured") for k in data if str(k).endswith("_measured")]
    # A sketch of 2.8 inches, and beneath it lines of text at 7 points.
    height = max(5.4, 1.9 * len(names), 3.4 + 0.12 * len(lines_of(data.attrs["advice"])))
    figure = plt.figure(figsize=(11.0, height))
    right = figure.add_gridspec(2, 2, width_ratios=(1.7, 1.0), height_ratios=(2.8, height - 2.8))
    grid = figure.add_gridspec(len(names), 2, width_ratios=(1.7, 1.0))
    axes = [figure.add_subplot(grid[0, 0])]
    axes += [figure.add_subplot(grid[i, 0], sharex=axes[0]) for i in range(1, len(names))]
    tensions = {name: float(data.attrs[name]) for name in ("P1", "P2")}
    sketch(figure.add_subplot(right[0, 1]), tensions, data.attrs["advice"])
    for axis, name in zip(axes, names, strict=True):
        measured, computed = data[f"{name}_measured"], data[f"{name}_computed"]
        axis.plot(data.time, measured, ".", ms=2.5, color="0.55", label="measured")
        axis.plot(data.time, computed, lw=1.0, color="#1f4e9c", label="computed")
        axis.set_ylabel(f"{name} [{measured.attrs['units']}]")
    axes[-1].set_xlabel("time [s]")
    axes[0].legend(frameon=False, fontsize=8)
    values = [
        f"{n} = {float(v):.6g} ± {float(e):.2g} {unit}"
        for n, v, e, unit in zip(
            data.unknown.values,
            data.estimate,
            data.half,
            data.attrs["unknown_units"].split(","),
            strict=True,
        )
    ]
    axes[0].set_title(", ".join(values) + " (95%)", fontsize=9)
    return figure


BENCH = Experiment(
    name="identify-corexy",
    title="CoreXY: friction and tensions from a log of your own",
    parameters={
        "columns": "", "units": "", "counts_per_turn": 0.0, "machine": "", "unknowns": "P1,P2",
        "noise": "", "scored": "", "starts": 8, "spread": 2.0, "seed": 0, "profile": False,
        "tolerance": 1e-8,
    },
    quick={},
    compute=compute,
    draw=draw,
    template=write_template,
)  # fmt: skip
