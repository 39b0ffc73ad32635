r"""Whether 95% intervals of stick-slip fits hold the truth in 95 of 100 records.

Each record is the position of a block on a belt (`CoulombOscillator`, mass 1 kg) over six periods from
rest on the belt, 200 samples with normal noise of known size. Stiffness, both friction forces and the
speed of the belt are unknown. What is drawn, from where a fit starts and when another start is tried
was fixed before any coverage was looked at.

The rise of the sum of squares from the fit to the truth tells more than the intervals do: if all is as
it should be, it has the distribution of $\chi^2$ with as many degrees of freedom as unknowns.
"""

import functools
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.identification import Fit, Profile, least_squares, profile
from stickslip.systems import CoulombOscillator

from .._experiment import Context, Experiment
from .._statement import Verdict, judge_all, statement
from .._thresholds import COVERED, Synthetic
from ._many import Case, covered, many

PROFILED = ("estimate", "lower", "upper", "wald_lower", "wald_upper", "verdict", "ends")
NAMES = ("belt_speed", "kinetic_force", "static_force", "stiffness")
LABELS = {
    "belt_speed": "$v_b$", "kinetic_force": "$F_k$", "static_force": "$F_s$", "stiffness": "$k$",
}  # fmt: skip
MASS, PERIODS, SAMPLES = 1.0, 6, 200
NOISE = (0.01, 0.3)  # least and most, in parts of what the spring gives way in a slip
AWAY = 0.1  # logarithm of the largest factor between start and truth
STARTS = 8  # at most
BLOCK = 20


def truth_of(rng: np.random.Generator) -> dict[str, float]:
    kinetic = rng.uniform(0.3, 0.7)
    return {
        "belt_speed": rng.uniform(0.1, 0.4),
        "kinetic_force": kinetic,
        "static_force": kinetic * rng.uniform(1.3, 2.0),
        "stiffness": rng.uniform(0.5, 2.0),
    }


def give(values: dict[str, Any]) -> float:
    """How far the spring gives way at the end of a stick, by the loss of friction alone [m]."""
    return (values["static_force"] - values["kinetic_force"]) / values["stiffness"]


def duration_of(values: dict[str, Any]) -> float:
    """From rest at the unloaded spring to the end of the last period [s], in closed form."""
    v, k = values["belt_speed"], values["stiffness"]
    omega = np.sqrt(k / MASS)
    slip = 2.0 * (np.pi - np.arctan(give(values) * omega / v)) / omega
    return values["static_force"] / (k * v) + PERIODS * (2.0 * give(values) / v + slip)


def position(values: dict[str, Any], times: Any) -> jax.Array:
    """Of the block [m] at `times` [s], from rest on the belt at the unloaded spring."""
    block = CoulombOscillator(MASS, **values)
    found = ss.simulate(
        block, 0.0, times[-1], block.state(x=0.0, v=values["belt_speed"]),
        integrator=ss.Integrator("dop853", ss.AdaptiveStep(1e-9, 1e-9)),
        saveat=ss.SaveAt(ts=times, max_events=None), throw=False,
    )  # fmt: skip
    assert found.outputs is not None
    return found.outputs.y.x


def _residual(values, data, times, sigma):
    return (position(values, times) - data) / sigma


# One program each for all records: the data are operands.


@jax.jit
def _fit(start, *data) -> Fit:
    return least_squares(lambda values: _residual(values, *data), start)


@functools.partial(jax.jit, static_argnames="level")
def _profile(fit, *data, level=0.95) -> Profile:
    return profile(lambda values: _residual(values, *data), fit, level=level)


_clean = jax.jit(position)
_rows = jax.jit(_residual)


def record(seed: int, number: int) -> tuple[Any, ...]:
    """Truth, times [s], what was measured [m], deviation of its noise [m], and what draws starts."""
    rng = np.random.default_rng((seed, number))
    truth = {name: np.float64(value) for name, value in truth_of(rng).items()}
    sigma = give(truth) * np.exp(rng.uniform(*np.log(NOISE)))
    times = np.linspace(0.0, duration_of(truth), SAMPLES + 1)[1:]
    data = np.asarray(_clean(truth, times)) + sigma * rng.standard_normal(SAMPLES)
    return truth, times, data, sigma, rng


def one(parameters: dict[str, Any], number: int) -> Case:
    """A record, its fit, and its intervals."""
    from scipy.stats import chi2

    truth, times, data, sigma, rng = record(parameters["seed"], number)
    given = (data, times, np.float64(sigma))
    limit = chi2.ppf(1.0 - 1e-4, SAMPLES - len(NAMES))
    tried, best = 0, None
    while best is None or (2.0 * float(best.cost) > limit and tried < STARTS):
        away = np.exp(AWAY * rng.uniform(-1.0, 1.0, len(NAMES)))
        fit = _fit({name: truth[name] * away[i] for i, name in enumerate(NAMES)}, *given)
        tried += 1
        if best is None or float(fit.cost) < float(best.cost):
            best = fit
    found = _profile(best, *given)
    least = float(np.sum(np.asarray(best.residual) ** 2))
    return {
        "truth": [truth[name] for name in NAMES],
        **{key: [getattr(found, key)[name] for name in NAMES] for key in PROFILED},
        "fall": found.fall, "evaluations": np.sum(list(found.evaluations.values())),
        "successful": best.successful,
        "least": least, "starts": tried, "noise": sigma / give(truth),
        "excess": float(np.sum(np.asarray(_rows(truth, *given)) ** 2)) - least,
    }  # fmt: skip


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    rows = many("identify-coverage", one, parameters, context, BLOCK)
    truth, times, data, sigma, _ = record(parameters["seed"], 0)
    dims = dict.fromkeys(
        ("truth", "estimate", "lower", "upper", "wald_lower", "wald_upper", "verdict"), ("unknown",)
    ) | {"ends": ("unknown", "side")}
    fine = np.linspace(0.0, times[-1], 1001)[1:]
    return xr.Dataset(
        {name: (("record", *dims.get(name, ())), value) for name, value in rows.items()}
        | {
            "first_measured": ("time", data, {"units": "m"}),
            "first_true": ("fine_time", np.asarray(_clean(truth, fine)), {"units": "m"}),
        },
        {
            "record": np.arange(parameters["count"]), "unknown": list(NAMES),
            "side": ["lower", "upper"], "time": ("time", times, {"units": "s"}),
            "fine_time": ("fine_time", fine, {"units": "s"}),
        },
        {"first_sigma": float(sigma), "level": 0.95},
    )  # fmt: skip


def coverage(data: xr.Dataset) -> xr.Dataset:
    """By record and unknown whether the intervals hold the truth."""
    return xr.Dataset(
        {
            "profile": (("record", "unknown"), _held(data, "lower", "upper")),
            "wald": (("record", "unknown"), _held(data, "wald_lower", "wald_upper")),
        },
        {"unknown": data.unknown},
    )


def _held(data: xr.Dataset, low: str, high: str) -> np.ndarray:
    return covered(data[low].values, data[high].values, data.truth.values)


def draw(data: xr.Dataset) -> Figure:
    from scipy.stats import chi2

    held, count = coverage(data), data.record.size
    figure, axes = plt.subplots(2, 2, figsize=(10.0, 6.4))
    motion, bars, trend, sums = axes.flat
    colours = {"profile": "#1f4e9c", "wald": "#b7791f"}
    motion.plot(data.fine_time, data.first_true, lw=0.9, color="#1f4e9c", label="true")
    motion.plot(data.time, data.first_measured, ".", ms=3, color="0.45", label="measured")
    motion.set(xlabel="time [s]", ylabel="position [m]", title="the first record")
    place = np.arange(len(NAMES))
    band = 1.96 * np.sqrt(0.95 * 0.05 / count)
    for axis in (bars, trend):
        axis.axhspan(Synthetic.LEAST, Synthetic.MOST, color="0.93", zorder=0)
        axis.axhline(0.95, color="0.6", lw=0.7, zorder=0)
        axis.set(ylabel="intervals that hold the truth")
    for i, (kind, colour) in enumerate(colours.items()):
        bars.errorbar(
            place + 0.14 * (i - 0.5), held[kind].mean("record"), band, fmt="o", ms=4, capsize=2,
            color=colour, label=kind,
        )  # fmt: skip
        order = np.argsort(data.noise.values)
        parts = [part for part in np.array_split(order, min(5, count)) if part.size]
        trend.plot(
            [np.exp(np.log(data.noise.values[part]).mean()) for part in parts],
            [held[kind].values[part].mean() for part in parts], "o-", ms=4, color=colour, label=kind,
        )  # fmt: skip
    bars.set_xticks(place, [LABELS[str(name)] for name in data.unknown.values])
    bars.set_title(f"of {count} records; bars: what chance allows, 95%")
    trend.set(xscale="log", xlabel="noise / give of the spring", title="by fifths of the noise")
    trend.set_xticks([0.01, 0.03, 0.1, 0.3], ["1%", "3%", "10%", "30%"])
    trend.minorticks_off()
    sums.plot(np.sort(data.excess), (np.arange(count) + 0.5) / count, lw=1.4, color="#3d7a4b")
    grid = np.linspace(0.0, max(15.0, float(data.excess.max())), 200)
    sums.plot(grid, chi2.cdf(grid, len(NAMES)), "--", lw=0.9, color="0.3", label=r"$\chi^2_4$")
    sums.set(xlabel="rise of the sum of squares from fit to truth", ylabel="part below")
    for axis in axes.flat:
        axis.legend(frameon=False, fontsize=7)
    return figure


def _enough(data: xr.Dataset, holds: bool) -> bool | None:
    """`holds`; open with fewer records than the coverage is asked of."""
    return holds if data.record.size >= Synthetic.RECORDS else None


def _covers(data: xr.Dataset, kind: str) -> Verdict:
    """Coverage of the intervals of each unknown."""
    held = coverage(data)[kind]
    each = held.mean("record")
    text = ", ".join(f"{n} {float(each.sel(unknown=n)):.1%}" for n in NAMES)
    good = bool(((each >= Synthetic.LEAST) & (each <= Synthetic.MOST)).all())
    told = f"{text}; {float(held.mean()):.1%} of all, {data.record.size} records"
    return _enough(data, good), told


@statement("Y1.1", "Every fit converges, none at another minimum than the least.")
def fits_converge(data: xr.Dataset) -> Verdict:
    """How many do; a lower sum of squares is known from the profile, or from the truth."""
    converged, count = int(data.successful.sum()), data.record.size
    elsewhere = int(((data.fall > Synthetic.LOWER) | (data.excess < -Synthetic.LOWER)).sum())
    return (
        converged == count and elsewhere == 0,
        f"{converged} of {count} converge, {elsewhere} at another minimum, "
        f"{int((data.starts > 1).sum())} needed more than one start",
    )


@statement("Y1.2", "All unknowns of every record are identifiable.")
def all_is_identifiable(data: xr.Dataset) -> Verdict:
    """How many records show all unknowns."""
    identified, count = int((data.verdict == 0).all("unknown").sum()), data.record.size
    return identified == count, f"{identified} of {count}"


@statement("Y1.3", f"Profile intervals of 95% hold the truth in {COVERED}, of each unknown.")
def profiles_cover(data: xr.Dataset) -> Verdict:
    """Their coverage."""
    return _covers(data, "profile")


@statement("Y1.4", "Wald intervals of 95% do so too.")
def walds_cover(data: xr.Dataset) -> Verdict:
    """Their coverage."""
    return _covers(data, "wald")


@statement("Y1.5", "The rise from fit to truth is distributed as chi squared.")
def rise_is_chi_squared(data: xr.Dataset) -> Verdict:
    """Test of Kolmogorov and Smirnov."""
    from scipy.stats import chi2, kstest

    test = kstest(data.excess.values, chi2(len(NAMES)).cdf)
    return (
        _enough(data, bool(test.pvalue > Synthetic.DOUBTED)),
        f"Kolmogorov-Smirnov {test.statistic:.3f}, probability {test.pvalue:.2g}; mean "
        f"{float(data.excess.mean()):.2f} for {len(NAMES)}",
    )


judge = judge_all("Y1.")


EXPERIMENT = Experiment(
    name="identify-coverage",
    title="Stick-slip: how often 95% intervals hold the truth",
    parameters={"count": 1000, "seed": 0, "workers": 1},
    quick={"count": 10},
    compute=compute,
    draw=draw,
    judge=judge,
)  # fmt: skip
