"""Rate-and-state friction of basalt from a step of the speed: both laws of the age, and what is left.

The friction is that of a spring slider, with the stiffness of the apparatus and a linear trend over the
slip, which is wear. The noise of the record is correlated over some tenths of a second; standard errors
are given for white noise and for what the residuals show.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from stickslip.identification import (
    Fit,
    LevenbergMarquardt,
    WhitenessTest,
    autocorrelation,
    compare,
    ljung_box,
    profile,
    report,
)

from .._data import listed
from .._experiment import Context, Experiment
from .._starts import Start, starts_told
from .._statement import Untold, Verdict, judge_all, statement
from .._thresholds import Measured
from ._record import NAME, Step, load, step_of
from ._slider import LAWS, SIGMA, STARTS, problem

WANTED, WITHIN = Measured.ROCK, Measured.ROCK_WITHIN
METHOD = LevenbergMarquardt(max_steps=100)
HELD = 20.0  # what comes later than this after the step is predicted, in one more fit [s]
LAGS = 50
PAIR = ("a", "b")
MICRO = 1e6  # µm in a metre


def fits_of(task: Any, parameters: dict[str, Any]) -> list[Fit]:
    """Fits from the start as it is, and from others `spread` above or below in what the step shows."""
    rng = np.random.default_rng(parameters["seed"])
    found = [task.fit(method=METHOD)]
    for _ in range(parameters["starts"] - 1):
        other = {
            name: unknown.start * (1.0 + parameters["spread"] * rng.choice([-1.0, 1.0]))
            if name in STARTS
            else unknown.start
            for name, unknown in task.unknowns.items()
        }
        found.append(task.fit(method=METHOD, start=other))
    return sorted(found, key=lambda fit: float(fit.cost))


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    step = load(context.data, parameters["records"])
    further = {name: load(context.data, name) for name in listed("scored", parameters["scored"])}
    begin, before, after = step_of(step)
    later = step.time > begin + HELD
    fits, tables, held, apart = {}, {}, {}, {}
    for law in LAWS:
        task = problem(law, step, begin)
        found = fits_of(task, parameters)
        fits[law] = found[0]
        apart[law] = max(
            abs(float(fit.values[n] / found[0].values[n]) - 1.0) for fit in found for n in STARTS
        )
        if parameters["predict"]:
            known = problem(law, step, begin, last=begin + HELD)
            part = known.fit(method=METHOD)
            computed = np.asarray(known.simulate(part.values).observed["friction"])
            held[law] = (computed - step.friction)[later]
        tables[law] = _table(task, fits[law], parameters["profile"])
    compared = compare(fits, held_out=held or None, sigma=SIGMA, noise_known=False)
    told = report(
        fits["ageing"], comparison=compared, whiteness=WhitenessTest(lags=LAGS),
        held_out={"coefficient": held["ageing"]} if held else None,
        title="Basalt, step from 3 to 10 µm/s, ageing law",
    )  # fmt: skip
    print(told)
    start = Start("given", "it slides steadily at the speed before the step, with the fitted mu_0")
    said = starts_told(fitted=start, scored=start)
    for name, other in further.items():
        for law in LAWS:
            print(f"{name}, {law}: {_scored(law, fits[law], other)}")
    names = list(fits["ageing"].names)
    residuals = {law: np.asarray(fits[law].residual) for law in LAWS}
    fast = step.time > np.nextafter(begin, 0.0)
    own = {law: autocorrelation(row[fast], LAGS) for law, row in residuals.items()}
    data: dict[str, Any] = {
        name: (("law", *dims), np.array([tables[law][name] for law in LAWS]))
        for name, dims in (
            ("estimate", ("unknown",)), ("wald", ("unknown", "end")), ("profile", ("unknown", "end")),
            ("covariance", ("unknown", "other")), ("robust_covariance", ("unknown", "other")),
        )
    } | {
        "apart": ("law", list(apart.values())),
        "aic": ("law", compared.table["aic"]),
        "bic": ("law", compared.table["bic"]),
        "held_out": ("law", compared.table.get("held_out", np.full(len(fits), np.nan))),
        "left": ("law", [float(fit.reduced_chi_squared) for fit in fits.values()]),
        "successful": ("law", [bool(fit.successful) for fit in fits.values()]),
        "p_value": ("law", [float(ljung_box(row[fast], 20).p_value) for row in residuals.values()]),
        "autocorrelation": (("law", "lag"), [np.asarray(c.values) for c in own.values()]),
        "band": ("lag", np.asarray(own["ageing"].band)),
        "measured": ("time", step.friction),
        "computed": (("law", "time"), [step.friction + SIGMA * row for row in residuals.values()]),
        "unit": ("unknown", [fits["ageing"].units[name] for name in names]),
    }  # fmt: skip
    coords = {
        "law": list(LAWS), "unknown": names, "other": names, "end": ["lower", "upper"],
        "time": ("time", step.time, {"units": "s"}), "lag": np.arange(LAGS + 1),
    }  # fmt: skip
    attributes = {"begin": begin, "before": before, "after": after, "report": str(told), "starts": said}
    return xr.Dataset(data, coords, attributes)


def _scored(law: str, fit: Fit, step: Step) -> str:
    """How well a law with its apparatus explains a further step, as it comes and fitted anew."""
    begin, *speeds = step_of(step)
    known = {name: float(fit.values[name]) for name in STARTS}
    found = []
    for given in (known, None):
        task = problem(law, step, begin, speeds=(speeds[0], speeds[1]), known=given)
        left = np.asarray(task.fit(method=METHOD).data_residual)
        found.append(f"{SIGMA * float(np.sqrt(np.mean(left**2))):.3g}")
    return (
        f"root mean square error of the coefficient {found[0]} with a, b, d_c and stiffness of "
        f"the record fitted, {found[1]} with its own"
    )


def _table(task: Any, fit: Fit, profiled: bool) -> dict[str, np.ndarray]:
    """Estimates with their intervals and covariances, in the order of `fit.names`."""
    names = fit.names
    values = np.array([float(fit.values[name]) for name in names])
    errors = np.array([float(fit.standard_errors()[name]) for name in names])
    wald = values[:, None] + 1.959964 * errors[:, None] * np.array([-1.0, 1.0])
    ends = np.full((len(names), 2), np.nan)
    if profiled:
        found = profile(task.residual_function, fit)
        ends = np.array([[float(found.lower[name]), float(found.upper[name])] for name in names])
    return {
        "estimate": values, "wald": wald, "profile": ends, "covariance": np.asarray(fit.covariance()),
        "robust_covariance": np.asarray(fit.covariance(robust=True)),
    }  # fmt: skip


def draw(data: xr.Dataset) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 7.6))
    whole, near, plane, own = axes.flat
    colours = dict(zip(LAWS, ("#1f4e9c", "#c0392b"), strict=True))
    begin = data.attrs["begin"]
    for axis in (whole, near):
        axis.plot(data.time, data.measured, color="0.75", lw=0.5, label="measured")
        for law, colour in colours.items():
            axis.plot(data.time, data.computed.sel(law=law), color=colour, lw=1.2, label=law)
        axis.set(xlabel="time [s]", ylabel="coefficient of friction")
    whole.set_title("step of the speed from 3 to 10 µm/s")
    near.set(xlim=(begin - 1.0, begin + 5.0), title="near the step")
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    circle = 2.447747 * np.stack([np.cos(turn), np.sin(turn)])  # 95% of a plane
    for law, colour in colours.items():
        row = data.sel(law=law)
        centre = row.estimate.sel(unknown=list(PAIR)).values
        for name, style, said in (
            ("covariance", "-", "white noise"), ("robust_covariance", "--", "noise as it is"),
        ):  # fmt: skip
            square = row[name].sel(unknown=list(PAIR), other=list(PAIR)).values
            ring = centre[:, None] + np.linalg.cholesky(square) @ circle
            plane.plot(*ring, style, color=colour, lw=1.1, label=f"{law}, {said}")
    low, size = WANTED - WITHIN, 2.0 * WITHIN
    plane.add_patch(Rectangle((low, low), size, size, color="0.92", lw=0, zorder=0))
    plane.axline((WANTED, WANTED), slope=1.0, color="0.6", lw=0.7)
    plane.set(xlabel="a", ylabel="b", title="95% regions; grey: 0.0088 ± 0.0006; line: a = b")
    for law, colour in colours.items():
        row = data.sel(law=law)
        own.plot(
            0.01 * data.lag[1:], row.autocorrelation[1:], "o-", ms=2.5, lw=0.8, color=colour,
            label=f"{law}: p = {float(row.p_value):.2g}",
        )  # fmt: skip
    own.fill_between(0.01 * data.lag[1:], -data.band[1:], data.band[1:], color="0.88", lw=0)
    own.set(xlabel="lag [s]", title="autocorrelation of the residuals after the step")
    for axis in axes.flat:
        axis.legend(frameon=False, fontsize=7)
        axis.title.set_size(9)
    return figure


def _pair(data: xr.Dataset, law: str) -> dict[str, float]:
    return {n: float(data.estimate.sel(law=law, unknown=n)) for n in PAIR}


def _off(data: xr.Dataset, law: str) -> float:
    """How far a and b are from what is published."""
    return max(abs(v - WANTED) for v in _pair(data, law).values())


def _block(data: xr.Dataset, law: str, name: str) -> np.ndarray:
    """Covariance of a and b."""
    return data[name].sel(law=law, unknown=list(PAIR), other=list(PAIR)).values


def _correlation(data: xr.Dataset, law: str) -> float:
    square = _block(data, law, "covariance")
    return float(square[0, 1] / np.sqrt(square[0, 0] * square[1, 1]))


def _inflated(data: xr.Dataset) -> dict[str, float]:
    """By law, the variance of a under the noise as it is over that under white noise."""
    both = ("robust_covariance", "covariance")
    real, white = ({law: _block(data, law, name)[0, 0] for law in LAWS} for name in both)
    return {law: float(real[law] / white[law]) for law in LAWS}


def _surplus(data: xr.Dataset, law: str) -> tuple[float, float]:
    """b - a with its standard error."""
    square = _block(data, law, "robust_covariance")
    error = np.sqrt(square[0, 0] + square[1, 1] - 2.0 * square[0, 1])
    return _pair(data, law)["b"] - _pair(data, law)["a"], float(error)


def _by_law(data: xr.Dataset, name: str) -> dict[str, float]:
    return {law: float(data[name].sel(law=law)) for law in LAWS}


@statement("R3.1", f"Both laws converge, from every start to the same estimate, to {Measured.SAME:g}.")
def laws_converge(data: xr.Dataset) -> Verdict:
    """Largest relative difference between the estimates."""
    apart = _by_law(data, "apart")
    told = ", ".join(f"{law} {v:.2g} apart" for law, v in apart.items())
    return bool(data.successful.all()) and max(apart.values()) < Measured.SAME, told


@statement("R3.2", f"a and b are {WANTED:g} to {WITHIN:g}, by the ageing law.")
def ageing_law_as_published(data: xr.Dataset) -> Verdict:
    """a and b with their standard errors, for white noise and for the noise as it is."""

    def listed(law: str) -> str:
        white, real = (
            np.sqrt(np.diag(_block(data, law, n))) for n in ("covariance", "robust_covariance")
        )
        return f"{law}: " + ", ".join(
            f"{n} = {v:.5f} +- {w:.5f} (noise as it is {r:.5f})"
            for (n, v), w, r in zip(_pair(data, law).items(), white, real, strict=True)
        )

    return _off(data, "ageing") < WITHIN, "; ".join(listed(law) for law in LAWS)


@statement("R3.3", "So they are by the slip law.")
def slip_law_as_published(data: xr.Dataset) -> Verdict:
    """How far they are off."""
    off = _off(data, "slip")
    return off < WITHIN, f"{off:.5f} off at most"


@statement(
    "R3.4", f"Intervals by the profile and by Wald agree, to {Measured.INTERVALS:g} of their width."
)
def intervals_agree(data: xr.Dataset) -> Verdict:
    """The intervals by the profile; open without them."""
    row = data.sel(law="ageing", unknown=list(PAIR))
    profiled, wald = row.profile.values, row.wald.values
    moved = np.abs(profiled - wald) / np.diff(wald, axis=1)
    told = ", ".join(
        f"{n} from {low:.5f} to {high:.5f}" for n, (low, high) in zip(PAIR, profiled, strict=True)
    )
    correlations = ", ".join(f"{law} {_correlation(data, law):.3f}" for law in LAWS)
    return (
        None if np.isnan(profiled).any() else bool(moved.max() < Measured.INTERVALS),
        f"profile, ageing: {told}; correlation of a and b {correlations}",
    )


@statement("R3.5", "The residuals after the step are white.")
def residuals_are_white(data: xr.Dataset) -> Verdict:
    """Their probabilities, if they were white, and what their correlation does to the variance."""
    p = _by_law(data, "p_value")
    return (
        min(p.values()) > Measured.WHITE,
        ", ".join(f"{law}: p = {v:.2g}" for law, v in p.items())
        + "; the variance of a is as many times that for white noise: "
        + ", ".join(f"{law} {v:.1f}" for law, v in _inflated(data).items()),
    )


@statement(
    "R3.6",
    f"Friction weakens with speed: b above a by more than {Measured.WEAKENS:g} standard errors.",
)
def friction_weakens(data: xr.Dataset) -> Verdict:
    """b - a with its standard error for the noise as it is."""
    surplus = {law: _surplus(data, law) for law in LAWS}
    told = ", ".join(f"{law}: b - a = {v:.5f} +- {e:.5f}" for law, (v, e) in surplus.items())
    return all(v > Measured.WEAKENS * e for v, e in surplus.values()), told


@statement(
    "R3.7",
    f"Friction and displacement show the same time of the step, to {Measured.STEP_TIME:g} s.",
)
def step_is_seen_twice(data: xr.Dataset) -> Verdict:
    """How much later friction shows the step."""
    late = float(data.estimate.sel(law="ageing", unknown="late"))
    speeds = [MICRO * data.attrs[name] for name in ("before", "after")]
    return (
        abs(late) < Measured.STEP_TIME,
        f"{1e3 * late:.0f} ms after {data.attrs['begin']:.3f} s; speeds by the displacement "
        f"{speeds[0]:.2f} and {speeds[1]:.2f} µm/s",
    )


@statement(
    "R3.8",
    f"The record tells the two laws apart: AIC by more than {Measured.AIC:g}, noise as it is.",
)
def laws_differ(data: xr.Dataset) -> Verdict:
    """Difference of AIC, also divided by what the correlation of the noise does to the variance."""
    aic = data.aic.values - data.aic.values.min()
    least = str(data.law.values[int(np.argmin(data.aic.values))])
    support = float(aic.max()) / max(_inflated(data).values())
    told = f"{least} is better by {aic.max():.1f}, for the noise as it is by {support:.1f}"
    return support > Measured.AIC, told


@statement(
    "R3.9",
    f"Fitted up to {HELD:g} s after the step, both laws predict the rest to "
    f"{Measured.PREDICTS:g} times the noise.",
)
def predict_the_rest(data: xr.Dataset) -> Verdict:
    """Their errors."""
    held = _by_law(data, "held_out")
    if np.isnan(max(held.values())):
        raise Untold("nothing was held out")
    told = ", ".join(f"{law} {1e3 * v:.2f}e-3" for law, v in held.items())
    return max(held.values()) < Measured.PREDICTS * SIGMA, f"{told}, noise {1e3 * SIGMA:.2f}e-3"


judge = judge_all("R3.")


EXPERIMENT = Experiment(
    name="identify-rock",
    title="Basalt: rate-and-state friction from a measured step of the speed",
    parameters={
        "records": NAME, "scored": "", "starts": 3, "spread": 0.5, "profile": True, "predict": True,
        "seed": 0,
    },
    quick={"starts": 1, "profile": False, "predict": False},
    compute=compute,
    draw=draw,
    judge=judge,
    brought=True,
)  # fmt: skip
