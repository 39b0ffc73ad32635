"""A scenario computed three ways, as one dataset.

Truth values of the statements that differ from those of an earlier fixed-step study hang on what the
paper leaves open; a second implementation of Eqs. (1)-(84), written apart from this package in plain
Python, gives the numbers of this package with its choices and those of the study with the others:

- The state found in a step rules that step (here), or the next one. The latter begins with one step of
  RR in scenarios 1 and 2: S1.12, S2.03, S2.04, S2.11 and S2.16 then fail as printed and S2.08 holds.
- The static friction of an axis is that of its contacts at rest (here), or of all of them. With the
  latter S1.06 fails with the errata corrected, and the net work of the belts in scenario 1 is +353 J
  with the reaction as printed (A2) and -187 J with the third law, instead of -213 J and -143 J. In
  scenario 3 it is -1621 J and -2279 J with either; the +934 J of the study was not found again.
- A contact rests at speed zero (here), or below a threshold. At 1e-3 m/s the rests of S1.09 appear in
  the fixed step as printed (2) and with the errata corrected and all contacts counted (6); with the
  errata corrected as here there are none up to 5e-3 m/s. So a threshold is likely, not certain.
"""

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
                p, v, parameters["duration"], method="as_printed", dt=parameters["step"], errata=errata,
                **shape,
            )  # fmt: skip
        runs.append(cx.outputs(solution, errata).drop_attrs(deep=False))
    for run in runs[1:]:
        run["time"] = runs[0].time  # the same to rounding
    data = xr.concat(runs, dim=xr.Variable("way", list(WAYS)))
    pairs = ((p.mu_1k_b, p.P1), (p.mu_2k_b, p.P2))
    kinetic = np.array([2.0 * float(mu) * float(tension) * float(p.r) for mu, tension in pairs])
    data["kinetic_belt"] = (
        "motor", kinetic, {"units": "N m", "long_name": "kinetic friction torque of the belt"}
    )  # fmt: skip
    return data.assign_attrs(scenario=number)
