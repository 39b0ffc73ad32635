"""A prediction: what a fit says of a record, its bands, and what was measured."""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type
from ..identification import Prediction
from . import _axes


def prediction(
    found: Given[Prediction], *, ax: Given[Axes | Sequence[Axes] | None] = None, **options: Any
) -> Any:
    """The measured values of a record before the motion that was predicted, with both bands.

    **Arguments:** `found`, as from `Problem.predict`; `ax`, axes to draw into, one for each quantity
    that is observed; `options`: properties of the line of the motion, as matplotlib calls them.

    **Returns** the array of axes. The dark band is what the unknowns leave open, the light one that of
    single measurements. **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("found", found, Prediction, "a Prediction")
    names = list(found.mean)
    usual = {"color": _axes.RED, "linewidth": 1.0, "label": "predicted"}
    axes, options = _axes.begin(ax, options, len(names), [1.0] * len(names), **usual)
    for axis, name in zip(axes, names, strict=True):
        band = {"color": options["color"], "linewidth": 0.0}
        measured = found.measured_lower[name], found.measured_upper[name]
        axis.fill_between(
            found.times, *measured, alpha=0.15, label=f"{found.level:g} of measurements", **band
        )
        axis.fill_between(found.times, found.lower[name], found.upper[name], alpha=0.35, **band)
        if name in found.record.values:
            there = found.record.present[name]
            data = found.record.times[there], found.record.values[name][there]
            axis.plot(*data, ".", ms=3, color=_axes.BLUE, label="data")
        axis.plot(found.times, found.mean[name], **options)
        axis.set_ylabel(_axes.axis_label(name, found.units[name]))
    axes[-1].set_xlabel("t [s]")
    if ax is None:
        _axes.legend(axes[0])
    return axes
