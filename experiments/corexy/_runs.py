"""A scenario computed three ways, as one dataset."""

from typing import Any

import numpy as np
import xarray as xr

import corexy_jax as cx

from .._experiment import Context

WAYS = {
    "consistent": None,
    "as printed": cx.Errata(),
    "errata corrected": cx.Errata.corrected(A8=False),
}
PARAMETERS = {"duration": 6.0, "step": 1e-4, "rows": 12001}
QUICK = {"rows": 1501}


def scenario_runs(number: int, parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """`corexy_jax.outputs` of a scenario, stacked along `way`.

    "as printed" and "errata corrected" are the paper's fixed-step algorithm, the latter with one dead
    zone per axis (A8) as the paper has it; "consistent" is the law of all contacts at once.
    """
    runs = []
    for errata in WAYS.values():
        p, v = cx.scenario(number, errata)
        shape = {"rows": parameters["rows"]}
        if errata is None:
            solution = cx.simulate(p, v, parameters["duration"], **shape)
        else:
            solution = cx.simulate(
                p, v, parameters["duration"], way="as_printed", dt=parameters["step"], errata=errata,
                **shape,
            )  # fmt: skip
        runs.append(cx.outputs(solution, errata).drop_attrs(deep=False))
    for run in runs[1:]:
        run["time"] = runs[0].time  # the same to rounding
    data = xr.concat(runs, dim=xr.Variable("way", list(WAYS)))
    kinetic = 2.0 * 0.2 * np.array([float(p.P1), float(p.P2)]) * float(p.r)
    data["kinetic_belt"] = (
        "motor", kinetic, {"units": "N m", "long_name": "kinetic friction torque of the belt"}
    )  # fmt: skip
    return data.assign_attrs(scenario=number)
