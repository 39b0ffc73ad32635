"""A prediction: what a fit says of a record, its bands, and what was measured."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type
from ..identification import Prediction
from . import _axes


def prediction(
    found: Given[Prediction], *, ax: Given[Axes | Sequence[Axes] | None] = None, **options: Any
) -> Any:
    """The measured values of a record before the motion that was predicted, with both bands.

    Beneath each quantity that was measured are its residuals, measured less predicted, in both bands.

    **Arguments:** `found`, as from `Problem.predict`; `ax`, axes to draw into, one for each quantity
    that is observed, or with another one after each that was measured; `options`: properties of the
    line of the motion, as matplotlib calls them.

    **Returns** the array of axes. The dark band is what the unknowns leave open, the light one that of
    single measurements. **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("found", found, Prediction, "a Prediction")
    panels = [(name, left) for name in found.mean for left in (False, name in found.record.values)]
    panels = list(dict.fromkeys(panels))
    if ax is not None and np.size(np.asarray(ax, dtype=object)) == len(found.mean):
        panels = [(name, False) for name in found.mean]
    usual = {"color": _axes.RED, "linewidth": 1.0, "label": "predicted"}
    heights = [0.6 if left else 1.0 for _, left in panels]
    axes, options = _axes.begin(ax, options, len(panels), heights, **usual)
    for axis, (name, left) in zip(axes, panels, strict=True):
        about = found.mean[name] if left else np.zeros(found.times.size)
        _bands(axis, found, name, about, options["color"])
        if name in found.record.values:
            there = found.record.present[name]
            values = found.record.values[name][there] - about[there]
            axis.plot(found.times[there], values, ".", ms=3, color=_axes.BLUE, label="data")
        axis.plot(found.times, found.mean[name] - about, **options)
        said = "residual" if left else name
        axis.set_ylabel(_axes.axis_label(said, found.units[name]))
    axes[-1].set_xlabel("t [s]")
    if ax is None:
        _axes.legend(axes[0])
    return axes


def _bands(axis: Axes, found: Prediction, name: str, about: np.ndarray, color: Any) -> None:
    """Both bands of a quantity, about a motion."""
    light = found.measured_lower[name] - about, found.measured_upper[name] - about
    dark = found.lower[name] - about, found.upper[name] - about
    label = f"{found.level:g} of measurements"
    axis.fill_between(found.times, *light, color=color, alpha=0.15, linewidth=0.0, label=label)
    axis.fill_between(found.times, *dark, color=color, alpha=0.35, linewidth=0.0)
