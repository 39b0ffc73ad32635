"""A figure of the paper from its scenario and its kind."""

from typing import Any

import xarray as xr

from .._experiment import Context, Experiment, Statement
from .._statement import claims
from . import _statements_1, _statements_2, _statements_3  # noqa: F401, enter their claims
from ._draw import draw_modes, draw_motion, draw_planes
from ._runs import PARAMETERS, QUICK, scenario_runs
from ._view import View, what_is_wrong

KINDS = (
    (draw_motion, "motors and motion along x and y"),
    (draw_planes, "planes, voltages with mapped dead zones, torques on the belts"),
    (draw_modes, "dynamic model over time"),
)


def judge_scenario(number: int, data: xr.Dataset) -> list[Statement]:
    """Every statement on the scenario, for every way; open where the run does not show it."""
    found = []
    for way in map(str, data.way.values):
        run = data.sel(way=way)
        wrong = what_is_wrong(run)
        view = None if wrong else View(run)
        for claim in claims(f"S{number}."):
            found.append(claim(way, view) if view else claim.open(way, wrong))
    return found


def scenario_figure(figure: int) -> Experiment:
    """Experiment that draws figure 4 to 12: three figures a scenario; the first judges it."""
    number, kind = divmod(figure - 4, 3)
    number += 1
    draw, text = KINDS[kind]

    def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
        return scenario_runs(number, parameters, context)

    def judge(data: xr.Dataset) -> list[Statement]:
        return judge_scenario(number, data)

    return Experiment(
        name=f"corexy-fig{figure:02d}",
        title=f"CoreXY, scenario {number}: {text}",
        parameters=PARAMETERS,
        quick=QUICK,
        compute=compute,
        draw=draw,
        judge=judge if kind == 0 else (lambda data: []),
    )
