"""A fit: what was measured, what the model says, and what is left over."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._drawing import residual_dots
from .._types import Given
from .._validation import check_count, check_known, check_type, refusal
from ..identification import Fit, Problem
from . import _axes


def fit(
    found: Given[Fit],
    problem: Given[Problem | None] = None,
    *,
    record: int = 0,
    ax: Given[Axes | Sequence[Axes] | None] = None,
    **options: Any,
) -> Any:
    """The data of a record with the fitted model through them, and the residuals below.

    **Arguments**

    - `found`: one `Fit`. With the `problem` that it solves: for each quantity that was observed two
      axes, its data with the model, and the residuals in standard deviations. Without: one axes with
      the residuals in their order.
    - `record`: number of the record that is drawn.
    - `ax`: axes to draw into: two for each quantity, the upper one first; one without a problem.
    - `options`: properties of the line of the model, as matplotlib calls them.

    **Returns** the axes: an array of them, or one without a problem. Dashed lines are two standard
    deviations from zero.

    **Raises** `ValueError`, `TypeError` naming the argument; for a batch of fits.
    """
    check_type("found", found, Fit, "a Fit")
    check_known("found", found)
    if found.steps.ndim:
        but = f"of shape {found.steps.shape}"
        raise refusal("found", found, "one fit, such as identification.best(fits)", but=but)
    check_type("problem", problem, Problem | None, "a Problem or None")
    check_count("record", record, 0)
    if problem is None:
        axis, _ = _axes.begin(ax, options)
        values = np.asarray(found.data_residual)
        _residuals(axis, np.arange(values.size), values)
        axis.set_xlabel("row")
        return axis
    if record >= len(problem.records):
        raise refusal("record", record, f"below {len(problem.records)}, the number of records")
    if set(problem.unknowns) != set(found.names):
        names = ", ".join(problem.unknowns)
        but = f"with the unknowns {', '.join(found.names)}"
        raise refusal("found", found, f"a Fit of the problem, of {names}", but=but)
    if found.data_residual.shape != (problem._data.keep.size,):
        raise refusal("found", found, "a Fit of the problem: with as many residuals")
    measured = problem.records[record]
    names = [name for name in problem.observed if name in measured.values]
    heights = [2.0, 1.0] * len(names)
    usual = {"color": _axes.RED, "linewidth": 1.0, "label": "model"}
    axes, options = _axes.begin(ax, options, len(heights), heights, **usual)
    parts = problem.parts(np.asarray(found.data_residual))[problem.labels[record]]
    run = problem.simulate({name: found.values[name] for name in found.names}, record)
    for i, name in enumerate(names):
        above, below = axes[2 * i], axes[2 * i + 1]
        there = measured.present[name]
        data = measured.times[there], measured.values[name][there]
        above.plot(*data, ".", ms=3, color=_axes.BLUE, label="data")
        above.plot(np.asarray(run.times), np.asarray(run.observed[name]), **options)
        above.set_ylabel(_axes.axis_label(name, problem.observed[name].unit))
        times, values = parts[name]
        _residuals(below, np.asarray(times), np.asarray(values))
    axes[-1].set_xlabel("t [s]")
    if ax is None:
        _axes.legend(axes[0])
    return axes


def _residuals(axis: Axes, places: np.ndarray, values: np.ndarray) -> None:
    residual_dots(axis, places, values, size=2.5)
    for level in (-2.0, 2.0):
        axis.axhline(level, lw=0.6, ls="--", color=_axes.GREY)
    axis.set_ylabel("residual [sd]")
