"""The voltages that show most of friction and tensions, against the best of random ones."""

from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import scipy.optimize
import xarray as xr
from matplotlib.figure import Figure

import corexy_jax as cx
import stickslip as ss
from stickslip.identification import (
    CMAES,
    LevenbergMarquardt,
    Sensitivity,
    design_input,
    many_starts,
    sensitivities,
)

from .._experiment import Context, Experiment
from .._statement import Verdict, judge_all, statement
from .._thresholds import Designs
from ._input import ramps
from .identify import LABELS, LANES, NAMES, candidates

LIMIT = 20.0  # [V]
RANDOM, SLOPES = "best of random", "D, finite differences"
DESIGNS = (RANDOM, SLOPES, "D", "A")
STEP = 1e-3  # of the differences, in parts of the limits
COLOURS = ["#888888", "#b7791f", "#1f4e9c", "#3d7a4b"]


def _residual(values, ends, data, p, times):
    step = ss.AdaptiveStep(1e-8, 1e-8)
    return cx.measurement_residuals(
        values, data, p, ramps(ends, 0.5 * ends.shape[0]), times,
        integrator=ss.Integrator(method="tsit5", step=step),
    )  # fmt: skip


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    duration, executor = parameters["duration"], parameters["executor"]
    times = np.linspace(0.0, duration, round(duration * parameters["rate"]) + 1)[1:]
    machine = cx.scenario(3).parameters
    truth = {name: float(getattr(machine, name)) for name in NAMES}
    nothing = cx.Measurement(*(jnp.zeros(times.size),) * 4)
    lanes: dict[str, Any] = {"chunk_size": LANES, "executor": executor}

    def seen(ends: np.ndarray) -> Sensitivity:
        rows = {name: np.full(len(ends), value) for name, value in truth.items()}
        every = [_rows(tree, len(ends)) for tree in (nothing, machine, times)]
        return sensitivities(_residual, rows, ends, *every, **lanes)

    tried = candidates(parameters)
    found = seen(tried)
    weakest = np.nan_to_num(np.asarray(found.singular_values)[:, -1])
    best = int(np.argmax(weakest))
    inputs, histories = {RANDOM: tried[best]}, {}
    limits = np.full(tried.shape[1:], LIMIT)
    for criterion in ("D", "A"):
        made = design_input(
            _residual, truth, -limits, limits, nothing, machine, times, criterion=criterion,
            search=CMAES(
                parameters["rounds"], parameters["population"], parameters["seed"], tried[best]
            ), **lanes,
        )  # fmt: skip
        inputs[criterion] = np.asarray(made.coefficients)
        histories[criterion] = np.asarray(made.history)
    inputs[SLOPES] = _by_differences(
        lambda ends: _nats(seen(ends)), tried[best], parameters["rounds"] * parameters["population"]
    )
    every = seen(np.stack([inputs[name] for name in DESIGNS]))
    errors = every.relative_standard_errors()
    far = _fits(inputs["A"], truth, errors, nothing, machine, times, parameters, lanes)
    covariance = np.asarray(every.covariance())
    return xr.Dataset(
        {
            "error": (
                ("design", "unknown"), np.stack([np.asarray(errors[name]) for name in NAMES], axis=-1)
            ),
            "D": ("design", _nats(every)),
            "A": ("design", -np.log(np.trace(covariance, axis1=1, axis2=2))),
            "singular_value": (("design", "combination"), np.asarray(every.singular_values)),
            "ends": (
                ("design", "piece", "side", "motor"), np.stack([inputs[n] for n in DESIGNS]),
                {"units": "V"},
            ),
            "history": (("criterion", "round"), np.stack(list(histories.values()))),
            "far": (("draw", "unknown"), far),
        },
        {"design": list(DESIGNS), "unknown": list(NAMES), "criterion": list(histories)},
        {"population": parameters["population"]},
    )  # fmt: skip


def _rows(tree: Any, count: int) -> Any:
    """The same for each of so many."""
    return jax.tree.map(lambda a: np.broadcast_to(a, (count, *np.shape(a))), tree)


def _nats(found: Sensitivity) -> np.ndarray:
    sizes = np.asarray(found.singular_values)
    return 2.0 * np.sum(np.log(np.maximum(np.nan_to_num(sizes), 1e-30)), axis=-1)


def _by_differences(nats: Any, start: np.ndarray, most: int) -> np.ndarray:
    """Quasi-Newton steps with gradients by differences, within as many inputs as the others try."""
    best = [-np.inf, start]

    def descent(u):
        steps = np.where(u > 0.5, -STEP, STEP)
        points = np.vstack([u, u + np.diag(steps)])
        told = nats(LIMIT * (2.0 * points - 1.0).reshape(-1, *start.shape))
        if told[0] > best[0]:
            best[:] = told[0], LIMIT * (2.0 * u - 1.0).reshape(start.shape)
        return -told[0], -(told[1:] - told[0]) / steps

    begin = 0.5 * (start.ravel() / LIMIT + 1.0)
    calls = max(1, most // (begin.size + 1))
    scipy.optimize.minimize(
        descent, begin, jac=True, method="L-BFGS-B", bounds=[(0.0, 1.0)] * begin.size,
        options={"maxfun": calls},
    )  # fmt: skip
    return best[1]


def _fits(ends, truth, errors, nothing, machine, times, parameters, lanes) -> np.ndarray:
    """Fits to noisy data of the A-optimal input: errors of the logarithms in standard errors."""
    where = DESIGNS.index("A")
    rows = []
    for draw in range(parameters["draws"]):
        rng = np.random.default_rng((parameters["seed"], draw))
        clean = cx.measurement(
            machine, ramps(ends, parameters["duration"]), jnp.asarray(times),
            integrator=ss.Integrator(method="tsit5", step=ss.AdaptiveStep(1e-8, 1e-8)),
        )  # fmt: skip
        data = cx.Measurement(
            *(
                np.asarray(row) + sd * rng.normal(size=times.size)
                for row, sd in zip(clean, cx.MEASUREMENT_NOISE, strict=True)
            )
        )
        starts = {name: np.array([value]) for name, value in truth.items()}
        fit = many_starts(
            _residual, starts, ends, data, machine, times,
            method=LevenbergMarquardt(max_steps=20), **lanes,
        )  # fmt: skip
        rows.append([float(np.log(fit.values[n][0] / truth[n]) / errors[n][where]) for n in NAMES])
    return np.array(rows).reshape(-1, len(NAMES))


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 7.2))
    voltage, bars, rounds, far = axes.flat
    for k, name in ((0, RANDOM), (3, "A")):
        ends = data.ends.sel(design=name).values
        t = 0.5 * np.arange(len(ends))
        for motor, style in zip((0, 1), ("-", "--"), strict=True):
            x = np.stack([t, t + 0.5, np.full_like(t, np.nan)], axis=1).ravel()
            y = np.column_stack([ends[:, :, motor], np.full(len(ends), np.nan)]).ravel()
            voltage.plot(x, y, style, lw=1.0, color=COLOURS[k], label=f"{name}, motor {motor + 1}")
    voltage.set(xlabel="time [s]", ylabel="voltage [V]", title="inputs")
    place = np.arange(data.unknown.size)
    for k, name in enumerate(data.design.values):
        value = float(data.D.sel(design=name))
        bars.bar(
            place + 0.2 * (k - 1.5), data.error.sel(design=name), 0.19, color=COLOURS[k],
            label=f"{name}: {value:.1f} nats",
        )  # fmt: skip
    bars.set_yscale("log")
    bars.set_xticks(place, [LABELS[str(name)] for name in data.unknown.values])
    bars.set(ylabel="relative standard error", title="what each input shows")
    first = float(data.D.sel(design=RANDOM))
    told = data.attrs["population"] * np.arange(1, data.history.shape[1] + 1)
    rounds.plot(told, data.history.sel(criterion="D") - first, color=COLOURS[2])
    rounds.axhline(float(data.D.sel(design=SLOPES)) - first, color=COLOURS[1], lw=0.8)
    rounds.set(
        xlabel="inputs tried", ylabel="gain of information [nats]",
        title="D: by values (curve), by finite differences with as many inputs (line)",
    )  # fmt: skip
    far.plot(place, data.far.values.T, ".", ms=3, color=COLOURS[3])
    far.set_xticks(place, [LABELS[str(name)] for name in data.unknown.values])
    far.set(ylabel="error over standard error", title="fits to noisy data of the A-optimal input")
    for axis in (voltage, bars):
        axis.legend(frameon=False, fontsize=6)
    for axis in axes.flat:
        axis.title.set_size(9)
    return figure


def _ratios(data: xr.Dataset, design: str) -> np.ndarray:
    """Standard errors with the best of the random inputs over those with `design`."""
    return data.error.sel(design=RANDOM).values / data.error.sel(design=design).values


def _more_nats(data: xr.Dataset, design: str) -> float:
    """By how much `design` shows more than the best of the random inputs."""
    return float(data.D.sel(design=design)) - float(data.D.sel(design=RANDOM))


@statement(
    "I1",
    "An A-optimal input has smaller standard errors of all unknowns than the best of the random ones.",
)
def errors_are_smaller(data: xr.Dataset) -> Verdict:
    """Factors by which the standard errors are smaller."""
    ratio = _ratios(data, "A")
    mean = float(data.A.sel(design="A") - data.A.sel(design=RANDOM))
    return (
        bool(np.all(ratio > 1.0)),
        f"by factors {ratio.min():.2f} to {ratio.max():.2f}, {np.exp(mean / 2.0):.2f} in the mean",
    )


@statement("I2", "Fits to noisy data scatter as the design says.")
def fits_scatter_as_designed(data: xr.Dataset) -> Verdict:
    """Mean square of the errors of fits over their standard errors."""
    count = data.far.size
    spread = float(np.mean(data.far.values**2)) if count else np.nan
    return (
        abs(spread - 1.0) < Designs.SCATTER * np.sqrt(2.0 / max(count, 1)),
        f"mean square of error over standard error {spread:.3f} of {count} numbers",
    )


@statement(
    "I3",
    "A D-optimal input shows more than quasi-Newton steps with finite differences find with as many "
    "inputs.",
)
def shows_more_than_differences(data: xr.Dataset) -> Verdict:
    """What both show beyond the best of the random inputs."""
    gain, slopes, ratio = _more_nats(data, "D"), _more_nats(data, SLOPES), _ratios(data, "D")
    return (
        gain > slopes,
        f"{gain:.2f} nats more than the best of the random ones against {slopes:.2f}; its standard "
        f"errors are smaller by factors {ratio.min():.2f} to {ratio.max():.2f}",
    )


judge = judge_all("I")


EXPERIMENT = Experiment(
    name="corexy-input-design",
    title="CoreXY: the voltages that show most of friction and tensions",
    parameters={
        "duration": 6.0, "rate": 100.0, "candidates": 64, "rounds": 60, "population": 64, "draws": 40,
        "seed": 0, "executor": "auto",
    },
    quick={
        "duration": 1.0, "candidates": 4, "rounds": 2, "population": 4, "draws": 1,
        "executor": "portable",
    },
    compute=compute,
    draw=draw,
    judge=judge,
)  # fmt: skip
