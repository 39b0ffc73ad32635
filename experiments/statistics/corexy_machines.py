"""A hundred synthetic CoreXY machines: whether fits from afar find them, and what intervals hold.

What counts was fixed before any result was looked at:

- an unknown is identifiable where the profile does not tell that it is not: its verdict is
  "identifiable" or "not decided";
- a machine is recovered if its fit comes down to the noise (the sum of squares below the quantile
  1 - 1e-4 of chi squared) and every identifiable unknown is within four standard errors of the truth;
- starts are drawn up to 80% from the truth; of 128 at most 8 are fitted, one after the other until one
  comes down to the noise (`_machine.Search`). No start is the truth.

The inputs and the order of the fits were changed after a look at the first machines: with other inputs
31 of 41 came down to the noise, and a third of the profiles had no end.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .._experiment import Context, Experiment
from .._statement import Verdict, judge_all, statement
from .._thresholds import COVERED, Synthetic
from ..corexy.identify import LABELS
from ._machine import KNOWN, NAMES, TIMES, one
from ._many import covered, many

DIMS = {
    **dict.fromkeys(
        ("truth", "estimate", "error", "lower", "upper", "wald_lower", "wald_upper", "verdict"),
        ("unknown",),
    ),
    "machine": ("known",), "ends": ("unknown", "side"), "evaluations": ("unknown", "side"),
    "of_start": ("try",), "gentle_of_start": ("try",), "singular_value": ("combination",),
    "input": ("record", "piece", "end", "motor"), "root_mean_square": ("record", "signal"),
}  # fmt: skip


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    rows = many("identify-corexy-machines", one, parameters, context, 1)
    rows["known_value"] = rows.pop("machine")
    dims = DIMS | {"known_value": DIMS["machine"]}
    return xr.Dataset(
        {name: (("machine", *dims.get(name, ())), value) for name, value in rows.items()},
        {
            "machine": np.arange(parameters["count"]), "unknown": list(NAMES), "known": list(KNOWN),
            "record": ["gentle", "rough"], "side": ["lower", "upper"],
            "signal": ["omega_1", "omega_2", "x", "y"],
        },
        {"samples": 2 * 4 * TIMES.size, "level": 0.95},
    )  # fmt: skip


def judged(data: xr.Dataset) -> xr.Dataset:
    """By machine and unknown what is identifiable, recovered, and held by the intervals."""
    both = ("machine", "unknown")
    verdict = data.verdict.values
    identifiable = (verdict == 0) | (verdict == 3)
    off = np.abs(data.estimate.values - data.truth.values) / data.error.values
    at_noise = data.least.values <= data.limit.values
    near = (off <= Synthetic.FAR) | ~identifiable
    held = {
        kind: covered(data[f"{start}lower"].values, data[f"{start}upper"].values, data.truth.values)
        for kind, start in (("profile", ""), ("wald", "wald_"))
    }
    return xr.Dataset(
        {
            "identifiable": (both, identifiable), "off": (both, off),
            "at_noise": ("machine", at_noise),
            "recovered": ("machine", at_noise & near.all(axis=1) & identifiable.any(axis=1)),
            # Where a side of the profile has not been followed to its end there is no interval.
            "decided": (both, verdict == 0), "seen": (both, np.isfinite(data.error.values)),
            **{kind: (both, value) for kind, value in held.items()},
        },
        {"unknown": data.unknown},
    )  # fmt: skip


def draw(data: xr.Dataset) -> Figure:
    found = judged(data)
    figure, axes = plt.subplots(2, 2, figsize=(10.0, 6.4))
    scatter, bars, tries, noise = axes.flat
    place = np.arange(len(NAMES))
    rng = np.random.default_rng(0)
    shift = rng.uniform(-0.25, 0.25, data.machine.size)
    for i in range(len(NAMES)):
        ratio = data.estimate.values[:, i] / data.truth.values[:, i] - 1.0
        good = found.identifiable.values[:, i] & found.at_noise.values
        scatter.plot(i + shift[good], 100 * ratio[good], ".", ms=4, color="#1f4e9c")
    scatter.set(ylabel="estimate - truth [%]", title="identifiable unknowns of fits at the noise")
    for i, (kind, mask, colour) in enumerate(
        (("profile", "decided", "#1f4e9c"), ("wald", "seen", "#b7791f"))
    ):
        of = found[mask].sum("machine")
        share = (found[kind] & found[mask]).sum("machine") / of
        band = 1.96 * np.sqrt(0.95 * 0.05 / np.maximum(of, 1))
        bars.errorbar(
            place + 0.14 * (i - 0.5), share, band, fmt="o", ms=4, capsize=2, color=colour, label=kind
        )
    bars.axhspan(Synthetic.LEAST, Synthetic.MOST, color="0.93", zorder=0)
    bars.axhline(0.95, color="0.6", lw=0.7, zorder=0)
    bars.set(ylabel="intervals that hold the truth", title="bars: what chance allows, 95%")
    for axis in (scatter, bars):
        axis.set_xticks(place, [LABELS[str(name)] for name in data.unknown.values])
    most = int(data.starts.max())
    tries.bar(np.arange(1, most + 1), np.bincount(data.starts, minlength=most + 1)[1:], color="#3d7a4b")
    tries.set(xlabel="starts until the noise", ylabel="machines")
    limit = float(data.limit[0] / data.samples)
    noise.semilogy(np.sort(data.least / data.samples), ".", ms=4, color="#1f4e9c")
    noise.axhline(limit, color="0.6", lw=0.7)
    noise.set(xlabel="machine, sorted", ylabel=r"$\chi^2$ per sample of the best fit")
    bars.legend(frameon=False, fontsize=7)
    return figure


def _enough(data: xr.Dataset, holds: bool) -> bool | None:
    """`holds`; open with fewer machines than it is asked of."""
    return holds if data.machine.size >= Synthetic.MACHINES else None


def _held(data: xr.Dataset, kind: str, mask: str) -> Verdict:
    """Coverage of all intervals that there are, and of each unknown."""
    found = judged(data)
    of, held = found[mask], found[kind] & found[mask]
    whole = float(held.sum() / np.maximum(of.sum(), 1))
    each = ", ".join(
        f"{n} {int(held.sel(unknown=n).sum())} of {int(of.sel(unknown=n).sum())}" for n in NAMES
    )
    good = Synthetic.LEAST <= whole <= Synthetic.MOST
    return _enough(data, good), f"{whole:.1%} of {int(of.sum())}: {each}"


@statement(
    "Y2.1",
    f"Of {Synthetic.MACHINES} machines at least {Synthetic.MACHINES * Synthetic.RECOVERED:g} recover "
    "every identifiable unknown.",
)
def machines_are_recovered(data: xr.Dataset) -> Verdict:
    """How many are, and how many fits come down to the noise."""
    found, count = judged(data), data.machine.size
    recovered, at_noise = int(found.recovered.sum()), int(found.at_noise.sum())
    first = int((data.of_start.isel({"try": 0}) <= data.limit).sum())
    return (
        _enough(data, recovered >= Synthetic.RECOVERED * count),
        f"{recovered} of {count}; {at_noise} come down to the noise, {first} from the first start, "
        f"{int(data.starts.max())} starts at most",
    )


@statement("Y2.2", "The designed inputs let all six unknowns be identified.")
def all_is_identifiable(data: xr.Dataset) -> Verdict:
    """Of how many machines they do."""
    count = data.machine.size
    all_seen = int(judged(data).identifiable.all("unknown").sum())
    undecided = int((data.verdict == 3).sum())
    return (
        _enough(data, all_seen >= Synthetic.RECOVERED * count),
        f"of {all_seen} machines of {count}; {undecided} of {count * len(NAMES)} profiles not followed "
        "to their ends",
    )


@statement("Y2.3", f"Profile intervals of 95% hold the truth in {COVERED}, all taken together.")
def profiles_cover(data: xr.Dataset) -> Verdict:
    """Their coverage, of the unknowns that are identifiable."""
    return _held(data, "profile", "decided")


@statement("Y2.4", f"Wald intervals of 95% hold the truth in {COVERED}, all taken together.")
def walds_cover(data: xr.Dataset) -> Verdict:
    """Their coverage, of the unknowns that have a standard error."""
    return _held(data, "wald", "seen")


judge = judge_all("Y2.")


EXPERIMENT = Experiment(
    name="identify-corexy-machines",
    title="CoreXY: a hundred machines fitted from afar, and what their intervals hold",
    # The inputs were designed with machines of seed 0 in view: others are to tell how good they are.
    parameters={
        "count": 100, "seed": 1, "starts": 128, "tries": 8, "candidates": 16, "rounds": 6, "workers": 1,
    },
    quick={"count": 1, "starts": 4, "tries": 1, "candidates": 2, "rounds": 1},
    compute=compute,
    draw=draw,
    judge=judge,
)  # fmt: skip
