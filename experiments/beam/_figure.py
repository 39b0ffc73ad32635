"""What the figures of the beam share, and those of one motion from its belt speed."""

from collections.abc import Callable
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from .._experiment import Context, Experiment, Statement
from ._draw import draw_histories, draw_phases
from ._motion import PARAMETERS, QUICK, motions

Compute = Callable[[dict[str, Any], Context], xr.Dataset]
Draw = Callable[[xr.Dataset], Figure]
Judge = Callable[[xr.Dataset], list[Statement]]
HISTORIES = {
    "y": ("y and its rate", ("y", "vy")),
    "w": ("w(z_A) and its rate", ("w", "w_rate")),
    "powers": ("the powers W_f and W_b", ("W_f", "W_b")),
}


def figure(
    number: int,
    title: str,
    parameters: dict[str, Any],
    quick: dict[str, Any],
    compute: Compute,
    draw: Draw,
    judge: Judge = lambda dataset: [],
) -> Experiment:
    """Fig. 2.`number` of the paper."""
    return Experiment(f"beam-fig2.{number}", title, parameters, quick, compute, draw, judge)


def motion_figure(number: int, title: str, v: float, draw: Draw, judge: Judge) -> Experiment:
    """Of the motion at belt speed `v`."""

    def compute(parameters, context: Context) -> xr.Dataset:
        return motions(parameters["v"], parameters)

    title = f"{title} at v = {v:g}"
    return figure(number, title, {"v": v, **PARAMETERS}, QUICK, compute, draw, judge)


def phase_figure(number: int, v: float) -> Experiment:
    """Phase spaces of x, y and w(z_A)."""
    title = "Phase spaces of the mass and the beam"
    return motion_figure(number, title, v, draw_phases, lambda dataset: [])


def history_figure(number: int, v: float, what: str, judge: Judge = lambda dataset: []) -> Experiment:
    """Time histories and spectra of two observables."""
    words, names = HISTORIES[what]
    title = f"Time histories and spectra of {words}"
    return motion_figure(number, title, v, lambda dataset: draw_histories(dataset, names), judge)
