"""The two-parameter map of the block: settled motions over k3 and the belt speed, under curves."""

from typing import Any

import xarray as xr

from .._experiment import Context, Experiment
from ._draw_map import draw_map
from ._judge_map import judge_map
from ._map import settled_motions
from ._map_curves import followed


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """Motions of all lanes, then the curves that start at special points of a branch."""
    motions = settled_motions(parameters, context)
    kept = motions.drop_vars([name for name in motions.data_vars if str(name).startswith("end_")])
    curves = followed(motions, parameters)
    return kept.merge(curves).assign_attrs({**motions.attrs, **curves.attrs})


EXPERIMENT = Experiment(
    name="block-map",
    title="Map of the block on a belt over k3 and the belt speed, with curves of period doubling",
    parameters={
        "friction": "smooth",
        "k3_min": 60.0,
        "k3_max": 120.0,
        "columns": 121,
        "speed_min": 0.03,
        "speed_max": 0.18,
        "rows": 76,
        "transient": 400.0,
        "duration": 60.0,
        "max_points": 128,
        "tolerance": 1e-8,
        "method": "tsit5",
        "curve_speed": 0.1,
        "step": 0.02,
        "doublings": 1,
        "fine_step": 0.01,
        "max_orbits": 100,
        "curve_step": 0.03,
        "curve_points": 80,
        "orbit_tolerance": 1e-10,
    },
    quick={
        "columns": 25,
        "rows": 13,
        "transient": 100.0,
        "duration": 40.0,
        "doublings": 0,
        "step": 0.1,
        "curve_step": 0.1,
        "curve_points": 4,
        "orbit_tolerance": 1e-9,
    },
    compute=compute,
    draw=draw_map,
    judge=judge_map,
)
