"""Figures of one motion, from its belt speed and what is drawn."""

from collections.abc import Callable
from typing import Any

import xarray as xr

from .._experiment import Context, Experiment, Statement
from ._draw import draw_histories, draw_phases
from ._motion import PARAMETERS, QUICK, motions

Judge = Callable[[xr.Dataset], list[Statement]]
WHAT = {
    "y": ("y", "vy"),
    "w": ("w", "w_rate"),
    "powers": ("W_f", "W_b"),
}


def compute(parameters: dict[str, Any], context: Context) -> xr.Dataset:
    """The motion at the belt speed."""
    return motions(parameters["v"], parameters)


def phase_figure(number: int, v: float) -> Experiment:
    """Phase spaces of x, y and w(z_A)."""
    return Experiment(
        name=f"beam-fig2.{number}",
        title=f"Phase spaces of the mass and the beam at v = {v:g}",
        parameters={"v": v, **PARAMETERS},
        quick=QUICK,
        compute=compute,
        draw=draw_phases,
    )


def history_figure(number: int, v: float, what: str, judge: Judge = lambda dataset: []) -> Experiment:
    """Time histories and spectra of two observables."""
    words = {"y": "y and its rate", "w": "w(z_A) and its rate", "powers": "the powers W_f and W_b"}
    return Experiment(
        name=f"beam-fig2.{number}",
        title=f"Time histories and spectra of {words[what]} at v = {v:g}",
        parameters={"v": v, **PARAMETERS},
        quick=QUICK,
        compute=compute,
        draw=lambda dataset: draw_histories(dataset, WHAT[what]),
        judge=judge,
    )
