"""What an experiment is, and the list of all of them."""

import dataclasses
import importlib
import pathlib
import pkgutil
import re
from collections.abc import Callable, Mapping
from typing import Any

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from stickslip.plot import Movie

from . import _settings
from ._statement import Statement as Statement

GROUPS = (
    "beam", "block", "corexy", "double_pendulum", "emps", "mechanisms", "pendulum", "rock",
    "statistics",
)  # fmt: skip
# Functions that `python -m stickslip view --with` asks, beside the experiments of a group.
FOR_THE_VIEWER = "view"


@dataclasses.dataclass(frozen=True)
class Context:
    """Cache directory of a run, whether it begins anew, and the folder of the user's records."""

    stores: pathlib.Path
    fresh: bool = False
    data: pathlib.Path | None = None


@dataclasses.dataclass(frozen=True)
class Experiment:
    """One figure: what is computed, how it is drawn, what it says about the paper's claims.

    - `parameters`: names with their values at full resolution; `quick` replaces some of them.
    - `compute(parameters, context) -> Dataset`; `draw(dataset) -> Figure`;
      `judge(dataset) -> list of Statement`: each reads nothing but its arguments, so that a picture
      can be drawn again from the file.
    - `animate(dataset) -> Movie`: frames of a GIF beside the picture.
    - `table(dataset) -> DataFrame`: columns that are written as CSV beside the picture.
    - `brought`: whether it reads measured records that the user brings.
    - `measured`: what runs in its place on a file of the user's, named by `--data`; `template` writes
      such a file to a path, and returns what it wrote.
    """

    name: str
    title: str
    parameters: Mapping[str, Any]
    quick: Mapping[str, Any]
    compute: Callable[[dict[str, Any], Context], xr.Dataset]
    draw: Callable[[xr.Dataset], Figure]
    judge: Callable[[xr.Dataset], list[Statement]] = lambda dataset: []
    animate: Callable[[xr.Dataset], Movie] | None = None
    table: Callable[[xr.Dataset], pd.DataFrame] | None = None
    brought: bool = False
    measured: "Experiment | None" = None
    template: Callable[[pathlib.Path], list[pathlib.Path]] | None = None


def load() -> dict[str, Experiment]:
    """All experiments by name, in the order of the papers."""
    found = {}
    for group in GROUPS:
        package = importlib.import_module(f"{__package__}.{group}")
        for info in pkgutil.iter_modules(package.__path__):
            if info.name.startswith("_") or info.name == FOR_THE_VIEWER:
                continue
            module = importlib.import_module(f"{package.__name__}.{info.name}")
            found[module.EXPERIMENT.name] = module.EXPERIMENT
    return dict(sorted(found.items(), key=lambda item: natural(item[0])))


def natural(name: str) -> list[Any]:
    """Key that sorts `fig2` before `fig10`."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def chosen(experiment: Experiment, quick: bool, changes: list[str]) -> dict[str, Any]:
    """Parameters of a run; `changes` are `key=value` texts.

    Errors: `ValueError` naming an unknown key, or a value that the experiment cannot run with.
    """
    values = dict(experiment.parameters) | (dict(experiment.quick) if quick else {})
    changed = {}
    for change in changes:
        key, sign, text = change.partition("=")
        if not sign or key not in values:
            raise ValueError(
                f"--set {change}: it must be key=value with one of the keys {', '.join(values)}."
            )
        values[key] = _settings.parsed(key, text, values[key])
        changed[key] = text
    _settings.check(values, changed)
    return values
