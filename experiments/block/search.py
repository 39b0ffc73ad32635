"""Search for parameters with which the paper's statements hold better than with set A.

The paper prints no parameters. Random sets around set A and those found before are ranked by what the
simplified model does (thousands a minute); the best are looked at with the full model and
exponents, crossed and varied further. `founders=false` begins from set A alone; `spread` is the first
variation relative to that of `NAMES`.
"""

import time
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stickslip.progress import Progress

from .._experiment import Context, Experiment, Statement
from .._statement import Verdict, statement
from .._thresholds import Block
from ._draw import caption
from ._regimes import mean_friction, regimes
from ._score import ITEMS, SPECIAL, Regimes, chaotic, first_look, score
from ._sets import NAMES, found_values, simplified, spreads, start_values, with_drive

LOW, HIGH = Block.K3_LOW, Block.K3_HIGH
CAPTION = (
    "Constructed parameters, found by search: the paper prints none. Score: B1 to B6 and a cascade "
    "p, 2p, 4p, chaos from below in the simplified model, each from 0 to 1. Belt reaction: {sign}."
)


class RegimeSearch:
    """Programs of one search: a quick look at the simplified model, a thorough one at both."""

    def __init__(self, parameters: dict[str, Any]):
        q = parameters
        self.looks = q["looks"]
        self.coarse = np.linspace(LOW, HIGH, q["coarse"])
        self.fine = np.linspace(LOW, HIGH, q["fine"])
        options = {"duration": q["duration"], "tolerance": q["tolerance"], "executor": q["executor"]}
        self.quick = regimes(simplified, transient=q["transient"], segments=0, **options)
        options |= {"transient": q["settled"], "segments": q["segments"]}
        self.simple = regimes(simplified, **options)
        self.full = regimes(with_drive(q["sign"]), **options)
        self.pull = mean_friction(q["executor"])

    def _run(
        self, program, sets: np.ndarray, k3: np.ndarray, pull: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Results of all sets at all k3 and at `SPECIAL`, as arrays [set, k3]."""
        values = np.append(k3, SPECIAL)
        p = np.repeat(sets, values.size, axis=0)
        lanes = (jnp.asarray(p), jnp.asarray(np.tile(values, len(sets))))
        out = program(*lanes, jnp.asarray(np.repeat(pull, values.size)))
        shape = (len(sets), values.size)
        return jax.tree.map(lambda a: np.asarray(a).reshape(shape), out)

    def first(self, sets: np.ndarray) -> np.ndarray:
        """Rank of each set by the simplified model; chaos is what is told to have no period."""
        out = self._run(self.quick, sets, self.coarse, np.zeros(len(sets)))
        found = np.zeros(len(sets))
        for i in range(len(sets)):
            if out["ok"][i].all() and not out["lifted"][i].any():
                period = out["period"][i]
                regimes = Regimes(
                    self.coarse, period[:-1], period[:-1] == 0, int(period[-1]), bool(period[-1] == 0)
                )
                found[i] = first_look(regimes)
        return found

    def regimes(self, sets: np.ndarray) -> list[tuple[Regimes, Regimes, np.ndarray] | None]:
        """Regimes of both models and the exponents, of each set; None where a lane failed."""
        # Filled up to one number of sets, because another number of lanes is another program.
        count = len(sets)
        sets = sets[np.minimum(np.arange(max(count, self.looks)), count - 1)]
        pull = np.asarray(self.pull(jnp.asarray(sets), jnp.full(len(sets), 85.0)))
        outs = [self._run(program, sets, self.fine, pull) for program in (self.simple, self.full)]
        found = []
        for i in range(count):
            good = all(out["ok"][i].all() and not out["lifted"][i].any() for out in outs)
            if not good:
                found.append(None)
                continue
            models = []
            for out in outs:
                period = out["period"][i]
                wild = chaotic(period, out["exponent"][i])
                models.append(
                    Regimes(self.fine, period[:-1], wild[:-1], int(period[-1]), bool(wild[-1]))
                )
            exponents = np.stack([out["exponent"][i] for out in outs])
            found.append((*models, exponents))
        return found


def children(parents: np.ndarray, number: int, width: np.ndarray, rng: Any) -> np.ndarray:
    """New sets [number, parameter]: each value from one of two parents, then varied by `width`.

    `parents` are sets [parent, parameter], `width` the standard deviations of the logarithms. Every
    second child has one parent only.
    """
    pairs = rng.integers(len(parents), size=(2, number))
    pairs[1, ::2] = pairs[0, ::2]
    second = rng.random((number, parents.shape[1])) < 0.5
    chosen = np.where(second, parents[pairs[1]], parents[pairs[0]])
    return chosen * np.exp(width * rng.normal(size=chosen.shape))


def _scored(sets: np.ndarray, found: list) -> list[tuple[float, np.ndarray, Any]]:
    """`(score, values, regimes)` of the sets of which no lane failed, the best first."""
    entries = [
        (sum(score(*regimes[:2]).values()), values, regimes)
        for values, regimes in zip(sets, found, strict=True)
        if regimes is not None
    ]
    return sorted(entries, key=lambda entry: -entry[0])


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Generations of sets: cross and vary, rank, look thoroughly, keep the best, narrow the spread."""
    q = parameters
    looker, rng = RegimeSearch(q), np.random.default_rng(q["seed"])
    looked, seconds = 0, 0.0
    begun = start_values()[None, :]
    if q["founders"]:
        begun = np.concatenate([begun, found_values()])
    first = looker.regimes(begun)
    known = first[0]
    assert known is not None
    pool = _scored(begun, first)
    with Progress("search", q["generations"], things="generations") as meter:
        for generation in range(q["generations"]):
            width = q["spread"] * spreads() * 0.7**generation
            parents = np.array([entry[1] for entry in pool[: q["parents"]]])
            sets = children(parents, q["sets"], width, rng)
            start = time.monotonic()
            ranks = looker.first(sets)
            # The first call compiles; the rate is that of the others.
            seconds, looked = (0.0, 0) if generation == 0 else (seconds, looked)
            seconds, looked = seconds + time.monotonic() - start, looked + len(sets)
            best = sets[np.argsort(-ranks, kind="stable")[: q["looks"]]]
            pool = sorted(pool + _scored(best, looker.regimes(best)), key=lambda entry: -entry[0])
            meter.note = f"best score {pool[0][0]:.3f}"
            meter.advance(1)
    winner = pool[0]
    which = [("set A", begun[0], known), ("best found", winner[1], winner[2])]
    fine, models = looker.fine, ("simplified", "full")
    columns = ("set", "model", "k3")

    def gather(field: str) -> np.ndarray:
        return np.array([[getattr(m, field) for m in found[:2]] for _, _, found in which])

    exponents = np.array([found[2] for *_, found in which])
    return xr.Dataset(
        {
            "value": (("set", "parameter"), np.array([v for _, v, _ in which])),
            "score": (("set", "item"), np.array([list(score(*f[:2]).values()) for *_, f in which])),
            "period": (columns, gather("period")),
            "chaotic": (columns, gather("chaotic")),
            "exponent": (columns, exponents[:, :, :-1], {"units": "1/s"}),
            "special_exponent": (columns[:2], exponents[:, :, -1], {"units": "1/s"}),
            "special_period": (columns[:2], gather("special_period")),
        },
        {
            "set": [name for name, *_ in which],
            "parameter": list(NAMES),
            "item": list(ITEMS),
            "model": list(models),
            "k3": ("k3", fine, {"units": "N/m"}),
        },
        attrs={
            "caption": CAPTION.format(sign=q["sign"]),
            "sets_per_minute": 60.0 * looked / seconds if seconds else float("nan"),
            "sets_looked_at": q["generations"] * q["sets"],
        },
    )


def draw(dataset: xr.Dataset) -> Figure:
    """Periods and exponents of set A and of the best set, both models."""
    figure, axes = plt.subplots(2, 2, sharex=True, sharey="row", figsize=(10, 5.5))
    for j, name in enumerate(dataset["set"].values):
        part = dataset.sel(set=name)
        for model, colour in zip(dataset.model.values, ("#1f4e9c", "#c0392b"), strict=True):
            one = part.sel(model=model)
            axes[0, j].plot(one.k3, one.period, ".", color=colour, label=model, markersize=4)
            axes[1, j].plot(one.k3, one.exponent, color=colour, linewidth=0.9)
        total = float(part.score.sum())
        axes[0, j].set_title(f"{name}: score {total:.2f} of {dataset.sizes['item']}", fontsize=9)
        axes[1, j].axhline(0.0, color="0.6", linewidth=0.6)
        axes[1, j].axvline(SPECIAL, color="0.6", linewidth=0.6, linestyle=":")
        axes[1, j].set_xlabel("stiffness $k_3$ [N/m]")
    axes[0, 0].set_ylabel("period [maxima of x], 0: none, -1: unknown")
    axes[1, 0].set_ylabel("exponent [1/s]")
    axes[0, 0].legend()
    caption(figure, dataset)
    return figure


@statement(
    "X1", "There is a constructed set with which B1 to B6 and a cascade hold better than with set A."
)
def better_than_set_a(dataset: xr.Dataset) -> Verdict:
    """Whether a better set than A was found, and which."""
    old, new = (float(dataset.score.sel(set=s).sum()) for s in ("set A", "best found"))
    best = dataset.sel(set="best found")
    items = ", ".join(f"{i} {float(best.score.sel(item=i)):.2f}" for i in dataset.item.values)
    values = ", ".join(
        f"{p} = {float(best.value.sel(parameter=p)):.6g}" for p in dataset.parameter.values
    )
    return (
        new > old,
        f"score {new:.2f} of {dataset.sizes['item']} against {old:.2f} of set A ({items}) after "
        f"{dataset.attrs['sets_looked_at']} sets; constructed: {values}",
    )


def judge(dataset: xr.Dataset) -> list[Statement]:
    """X1."""
    return [better_than_set_a("", dataset)]


EXPERIMENT = Experiment(
    name="block-search",
    title="Search for parameters of the block on a belt with which the statements hold best",
    parameters={
        "generations": 6, "sets": 1000, "looks": 16, "parents": 6, "coarse": 14, "fine": 51,
        "transient": 40.0, "settled": 80.0, "duration": 30.0, "segments": 60, "tolerance": 1e-6,
        "sign": "consistent", "executor": "auto", "seed": 1,
        "founders": True, "spread": 0.5,
    },
    quick={
        "generations": 2, "sets": 16, "looks": 2, "coarse": 6, "fine": 8, "transient": 15.0,
        "settled": 15.0, "duration": 15.0, "segments": 6,
    },
    compute=compute,
    draw=draw,
    judge=judge,
)  # fmt: skip
