"""Search for parameters with which more of the statements C2 to C9 hold than with the constructed set.

The contact period is kept at 0.54 (C6), C1 holds for any set. Sets are drawn at random around the
constructed one and ranked by the statements at a few belt speeds; the best are varied. What is best in
coarse is ranked again in fine, after a long transient and with the exponents, and the winner is judged
over the whole range as the figures are.
"""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .._experiment import Context, Experiment, Statement
from .._statement import Verdict, statement
from ._coordinates import FIRST, NAMES, START, draw_sets, physical
from ._draw import draw_diagrams
from ._judge import judge_diagrams, positive_everywhere
from ._score import (
    FOUND,
    ITEMS,
    diagram_points,
    diagram_scorer,
    exponent_scorer,
    greatest_exponents,
    motion_scorer,
    scorer,
)

JUDGED = (*ITEMS, "C9a")


def rounds(parameters: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Random sets, each round around the best so far, and their items; best first."""
    rng = np.random.default_rng(parameters["seed"])
    score = scorer(parameters, diagram_scorer, motion_scorer)
    sets = FIRST[None, :]
    found = score(sets)
    for number in range(parameters["rounds"]):
        best = sets[_ranked(found)[: 1 if number == 0 else 8]]
        share = parameters["sets"] // len(best)
        width = parameters["width"] / (1 + number)
        new = np.concatenate([draw_sets(rng, centre, width, share) for centre in best])
        sets, found = np.concatenate([sets, new]), np.concatenate([found, score(new)])
    order = _ranked(found)
    return sets[order], found[order]


def _ranked(found: np.ndarray) -> np.ndarray:
    return np.argsort(-found.sum(axis=1), kind="stable")


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """All sets in coarse, the finalists in fine, the winner over the whole range of speeds."""
    coarse = {key: parameters[f"coarse_{key}"] for key in ("modes", "h", "transient")}
    sets, found = rounds({**parameters, **coarse})
    # The constructed set is judged like the finalists, last.
    finalists = np.concatenate([sets[: parameters["finalists"]], FIRST[None, :]])
    fine = scorer(parameters, diagram_scorer, motion_scorer, exponent_scorer)(finalists)
    best = int(_ranked(fine)[0])
    winner = finalists[best]
    result = whole_range(winner, parameters)
    values = {**{k: float(v) for k, v in physical(jnp.asarray(winner)).items()}, "x0": winner[START]}
    words = ", ".join(f"{k} = {v:.6g}" for k, v in values.items())
    one = {"units": "1"}
    return result.assign(
        sets=(("set", "name"), sets, one),
        items=(("set", "item"), found, one),
        finalists=(("finalist", "name"), finalists, one),
        judged=(("finalist", "judged_item"), fine, one),
    ).assign_coords(name=list(NAMES), item=list(ITEMS), judged_item=list(JUDGED)).assign_attrs(
        duration=parameters["duration"],
        tried=len(sets),
        best=best,
        winner=winner.tolist(),
        caption=f"Constructed parameters, found by search among {len(sets)} sets. Dimensionless, "
        f"consistent equations, {parameters['modes']} modes: {words}.",
    )  # fmt: skip


def whole_range(winner: np.ndarray, parameters: Mapping[str, Any]) -> xr.Dataset:
    """Points and greatest exponent of the best set over the belt speed, by the scorers' programs."""
    speeds = np.linspace(1e-4, 3e-2, parameters["speeds"])
    coordinates = np.tile(winner, (speeds.size, 1))
    found = {
        **diagram_points(parameters)(coordinates, speeds),
        **greatest_exponents(parameters)(coordinates, speeds),
    }
    data = {
        name: (("v", "point")[: a.ndim], a, {"units": "1", "long_name": name})
        for name, a in found.items()
    }
    axis = ("v", speeds, {"units": "1", "long_name": "belt speed v"})
    return xr.Dataset(data, {"v": axis}).expand_dims(variant=[FOUND])


@statement(
    "X2", "There are parameters with which more of C2 to C9a holds than with the constructed set."
)
def better_than_constructed(dataset: xr.Dataset) -> Verdict:
    """Sums of the items of the best set and of the constructed one."""
    fine = dataset["judged"]
    best, first = fine.isel(finalist=dataset.attrs["best"]), fine.isel(finalist=-1)

    def words(row: xr.DataArray) -> str:
        each = ", ".join(f"{name} {float(row.sel(judged_item=name)):.2f}" for name in JUDGED)
        return f"{float(row.sum()):.2f} ({each})"

    return float(best.sum()) > float(first.sum()), (
        f"score {words(best)} of {len(JUDGED)}, against {words(first)}; "
        f"{dataset.attrs['tried']} sets tried"
    )


def judge(dataset: xr.Dataset) -> list[Statement]:
    """X2; C1 to C5 and the sign of the greatest exponent with the best set."""
    part = dataset.isel(variant=0)
    exponent, error = np.asarray(part.exponent), np.asarray(part.error)
    return [
        better_than_constructed("", dataset),
        *judge_diagrams(dataset),
        positive_everywhere(FOUND, exponent, error, found=True),
    ]


def draw(dataset: xr.Dataset) -> Figure:
    """Diagrams of the best set."""
    return draw_diagrams(dataset)


EXPERIMENT = Experiment(
    name="beam-search",
    title="Search for parameters of the jointed beam with which more of the statements hold",
    parameters={
        "seed": 0, "rounds": 6, "sets": 160, "width": 1.0, "coarse_modes": 3, "coarse_h": 0.01,
        "coarse_transient": 100.0, "finalists": 24, "modes": 5, "h": 0.005, "transient": 1000.0,
        "duration": 54.05, "direction": "falling", "max_points": 256, "recorded": 200.0, "dt": 0.02,
        "speeds": 150, "segments": 400, "block": 32, "executor": "auto",
    },
    quick={
        "rounds": 1, "sets": 4, "finalists": 2, "speeds": 4, "modes": 3, "transient": 20.0, "h": 0.01,
        "coarse_transient": 10.0, "duration": 10.81, "recorded": 30.0, "segments": 20, "block": 4,
    },
    compute=compute,
    draw=draw,
    judge=judge,
)  # fmt: skip
