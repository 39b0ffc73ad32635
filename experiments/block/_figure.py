"""A diagram figure from its model and window."""

from typing import Any

import xarray as xr

from .._experiment import Context, Experiment
from ._diagram import MODELS, PROTOCOL, QUICK, diagrams
from ._draw import draw_diagrams
from ._judge import judge_change

FULL = MODELS[1:]
SIMPLIFIED = MODELS[:1]


def diagram_figure(number: int, models: tuple[str, ...], low: float, high: float) -> Experiment:
    """Experiment that draws the diagrams of `models` over k3 from `low` to `high` [N/m]."""

    def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
        return diagrams(models, parameters["k3_min"], parameters["k3_max"], parameters, context)

    which = "simplified model" if models == SIMPLIFIED else "full model with the drive, both signs"
    whole = high - low > 20
    return Experiment(
        name=f"block-fig{number:02d}",
        title=f"Bifurcation diagram of the block on a belt, {which}, k3 from {low:g} to {high:g} N/m",
        parameters={"k3_min": low, "k3_max": high, **PROTOCOL},
        quick=QUICK,
        compute=compute,
        draw=draw_diagrams,
        judge=judge_change if whole else (lambda dataset: []),
    )
