"""Friction and tensions from noisy measurements of the three scenarios and of a designed input."""

from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import corexy_jax as cx
import stickslip as ss
from stickslip.identification import (
    GradientDescent,
    LevenbergMarquardt,
    best,
    many_starts,
    sensitivities,
)

from .._experiment import Context, Experiment
from ._bench import BENCH
from ._input import ramps, scenario_input

NAMES = tuple(sorted(cx.FITTED_PARAMETERS))
LABELS = {
    "P1": "$P_1$", "P2": "$P_2$", "mu_1k_b": r"$\mu_{1k}^b$", "mu_2k_b": r"$\mu_{2k}^b$",
    "mu_k": r"$\mu_k$", "mu_s": r"$\mu_s$",
}  # fmt: skip
INPUTS = ("scenario 1", "scenario 2", "scenario 3", "designed")
LANES = 8  # of a chunk; the same everywhere, so that one program serves all


def _integrator():
    step = ss.AdaptiveStep(1e-8, 1e-8)
    return ss.Integrator(method="tsit5", step=step)


def _residual(values, data, p, v, times):
    return cx.measurement_residuals(values, data, p, v, times, integrator=_integrator())


def candidates(parameters: dict[str, Any]) -> np.ndarray:
    """Random ramps with jumps between, `[candidate, row, 2, 2]` [V]: begin and end of a ramp, motor."""
    rng = np.random.default_rng(parameters["seed"])
    pieces = scenario_input(1, parameters["duration"]).times.size
    ends = rng.uniform(-20.0, 20.0, (parameters["candidates"], pieces, 2, 2))
    ends[:, 0, 0] = 0.0
    return ends


def design(parameters: dict[str, Any], p: cx.CoreXYParameters, times: Any) -> np.ndarray:
    """Of random ramps, those whose worst seen combination is seen best.

    Ramps bring contacts at rest to their static limits, jumps make the belts slip. Where there is one
    alone, nothing is compared and no program for it compiled.
    """
    ends, count = candidates(parameters), parameters["candidates"]
    if count == 1:
        return ends[0]
    nothing = cx.Measurement(*(jnp.zeros(times.size),) * 4)
    truth, *same = jax.tree.map(
        lambda a: np.broadcast_to(a, (count, *np.shape(a))), (_truth(p), nothing, p)
    )
    inputs = jax.vmap(lambda ends: ramps(ends, parameters["duration"]))(ends)
    each_times = np.broadcast_to(times, (count, times.size))
    found = sensitivities(
        _residual, truth, *same, inputs, each_times, chunk_size=LANES, executor=parameters["executor"]
    )
    weakest = found.singular_values[:, -1]
    return ends[int(jnp.argmax(jnp.where(jnp.isfinite(weakest), weakest, 0.0)))]


def _truth(p: cx.CoreXYParameters) -> dict[str, Any]:
    return {name: getattr(p, name) for name in NAMES}


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    duration, count = parameters["duration"], parameters["starts"]
    times = np.linspace(0.0, duration, round(duration * parameters["rate"]) + 1)[1:]
    machine = cx.scenario(3).parameters
    ends = design(parameters, machine, times)
    cases = [(cx.scenario(n).parameters, scenario_input(n, duration)) for n in (1, 2, 3)]
    cases.append((machine, ramps(ends, duration)))
    run = jax.jit(lambda p, v: cx.measurement(p, v, jnp.asarray(times), integrator=_integrator()))
    rng = np.random.default_rng(parameters["seed"] + 1)
    factors = parameters["spread"] ** rng.uniform(-1.0, 1.0, (len(cases), count, len(NAMES)))
    columns: dict[str, list] = {}
    for number, (p, v) in enumerate(cases):
        truth = np.array([float(getattr(p, name)) for name in NAMES])
        key = jax.random.key(parameters["seed"] + number)
        data = cx.with_noise(run(p, v), key)
        starts = {name: truth[i] * factors[number, :, i] for i, name in enumerate(NAMES)}
        fits = many_starts(
            _residual, starts, data, p, v, times, chunk_size=LANES, executor=parameters["executor"],
            method=LevenbergMarquardt(max_steps=parameters["steps"]),
        )  # fmt: skip
        one = best(fits)
        errors = one.standard_errors()
        row = {
            "truth": truth,
            "estimate": np.array([float(one.values[name]) for name in NAMES]),
            "error": np.array([float(errors[name]) for name in NAMES]),
            "singular_value": np.asarray(one.sensitivity.singular_values),
            "direction": np.asarray(one.sensitivity.directions),
            "seen": np.asarray(one.sensitivity.seen_directions()),
            "chi_squared": np.asarray(fits.reduced_chi_squared),
            "steps": np.asarray(fits.steps),
            "start": np.stack([starts[name] for name in NAMES], axis=-1),
            "end": np.stack([np.asarray(fits.values[name]) for name in NAMES], axis=-1),
            "by_adam": _by_adam(parameters, starts, number, data, p, v, times),
            "voltage": np.array([[float(a) for a in v(t)] for t in times[::5]]),
        }
        for name, value in row.items():
            columns.setdefault(name, []).append(value)
    dims = {
        "truth": ("unknown",), "estimate": ("unknown",), "error": ("unknown",),
        "singular_value": ("combination",), "direction": ("combination", "unknown"),
        "seen": ("combination",), "chi_squared": ("trial",), "steps": ("trial",),
        "start": ("trial", "unknown"), "end": ("trial", "unknown"), "by_adam": ("trial_adam",),
        "voltage": ("time", "motor"),
    }  # fmt: skip
    units = {"voltage": "V"}
    return xr.Dataset(
        {
            name: (("input", *dims[name]), np.array(values), {"units": units.get(name, "1")})
            for name, values in columns.items()
        },
        {
            "input": list(INPUTS),
            "unknown": list(NAMES),
            "motor": [1, 2],
            "time": ("time", times[::5], {"units": "s"}),
        },
        {"noise": str(tuple(cx.MEASUREMENT_NOISE)), "unit_of_unknowns": "P1, P2 in N, the others 1"},
    )


def _by_adam(parameters, starts, number, *case) -> np.ndarray:
    """Reduced chi squared that Adam reaches on the designed input, from the first few starts."""
    count = min(2 * LANES, parameters["starts"])
    if not parameters["adam_steps"] or number < 3:
        return np.full(count, np.nan)
    some = {name: a[:count] for name, a in starts.items()}
    fits = many_starts(
        _residual, some, *case, chunk_size=LANES, executor=parameters["executor"],
        method=GradientDescent(steps=parameters["adam_steps"]),
    )  # fmt: skip
    return np.asarray(fits.reduced_chi_squared)


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 7.6))
    colours = ["#1f4e9c", "#b7791f", "#3d7a4b", "#c0392b"]
    place = np.arange(data.unknown.size)
    values, spectrum, hidden, convergence = axes.flat
    for i, name in enumerate(data.input.values):
        part, shift = data.sel(input=name), 0.16 * (i - 1.5)
        ratio, error = part.estimate / part.truth, part.error / part.truth
        known = np.isfinite(error.values)
        values.errorbar(
            place[known] + shift, ratio[known], 2 * error[known], fmt="o", ms=4, lw=1.2, capsize=2,
            color=colours[i], label=name,
        )  # fmt: skip
        values.plot(place[~known] + shift, np.ones((~known).sum()), "x", ms=5, color=colours[i])
        seen = part.seen.values.astype(bool)
        k = np.arange(1, seen.size + 1)
        size = np.maximum(part.singular_value.values, 1e-2)
        spectrum.semilogy(k, size, "-", lw=0.7, color=colours[i])
        spectrum.semilogy(k[seen], size[seen], "o", ms=4, color=colours[i], label=name)
        spectrum.semilogy(k[~seen], size[~seen], "x", ms=5, color=colours[i])
        chi = np.sort(part.chi_squared.values)
        good = np.mean(chi < 1.2)
        convergence.semilogy(
            np.arange(1, chi.size + 1), np.minimum(chi, 1e9), color=colours[i], lw=1.2,
            label=f"{name}: {good:.0%}",
        )  # fmt: skip
    values.axhline(1.0, color="0.6", lw=0.7, zorder=0)
    values.set_xticks(place, [LABELS[str(name)] for name in data.unknown.values])
    values.set_ylabel("estimate over truth, two standard errors")
    values.set_title("recovered values (cross: not seen)", fontsize=9)
    spectrum.set_xlabel("combination")
    spectrum.set_ylabel("singular value = 1 / standard error of its logarithm")
    spectrum.set_title("what the data see (cross: not seen)", fontsize=9)
    rows, names = [], []
    for name in data.input.values:
        part = data.sel(input=name)
        for k in np.flatnonzero(~part.seen.values.astype(bool)):
            rows.append(part.direction.values[k])
            names.append(str(name))
    table = np.array(rows) if rows else np.zeros((1, data.unknown.size))
    picture = hidden.imshow(table, cmap="RdBu", vmin=-1, vmax=1, aspect="auto")
    figure.colorbar(picture, ax=hidden)
    hidden.set_xticks(place, [LABELS[str(name)] for name in data.unknown.values])
    hidden.set_yticks(np.arange(len(table)), names or ["none"])
    hidden.set_title("combinations not seen: exponents of the unknowns", fontsize=9)
    adam = data.by_adam.sel(input="designed").values
    adam = np.sort(adam[np.isfinite(adam)])
    if adam.size:
        convergence.semilogy(np.arange(1, adam.size + 1), adam, "k+", ms=6, label="designed, Adam")
    convergence.axhline(1.0, color="0.6", lw=0.7, zorder=0)
    convergence.set_xlabel("start, sorted")
    convergence.set_ylabel(r"$\chi^2$ per degree of freedom at the end")
    convergence.set_title("random starts, part that reaches the noise", fontsize=9)
    for axis in (values, spectrum):
        axis.legend(frameon=False, fontsize=7)
    # Between the curves: they all begin at 1 on the left.
    convergence.legend(frameon=False, fontsize=7, loc="lower left", bbox_to_anchor=(0.0, 0.06))
    return figure


EXPERIMENT = Experiment(
    name="identify-corexy",
    title="CoreXY: friction and tensions from noisy measurements, what they can see",
    parameters={
        "duration": 6.0, "rate": 100.0, "starts": 100, "spread": 1.5, "steps": 60, "candidates": 64,
        "adam_steps": 300, "seed": 0, "executor": "auto",
    },
    quick={
        "duration": 1.0, "starts": 2, "candidates": 1, "steps": 20, "adam_steps": 0,
        "executor": "portable",
    },
    compute=compute,
    draw=draw,
    measured=BENCH,
)  # fmt: skip
