"""Frequency responses and backbones: amplitude over frequency."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_flag, check_in, check_type, refusal
from ..continuation import Backbone, FrequencyResponse
from . import _axes
from ._branch import MARKS

KIND = "a FrequencyResponse of stickslip.continuation, or several of them"


def frequency_response(
    found: Given[FrequencyResponse | Sequence[FrequencyResponse]],
    observable: Given[str | None] = None,
    *,
    phase: Given[bool] = False,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """Amplitude over frequency: stable motions as a line, unstable ones dashed, special points marked.

    **Arguments**

    - `found`: of `stickslip.continuation.frequency_response`; of several the curves are numbered.
    - `observable`: one of theirs, the first one by default.
    - `phase`: the phase of its first harmonic against the force [deg] instead.
    - `ax`, `options`: axes to draw into, properties of lines.

    **Returns** the axes. **Raises** `ValueError`, `TypeError` naming the argument.
    """
    curves = [found] if isinstance(found, FrequencyResponse) else found
    if not isinstance(curves, list | tuple) or not curves:
        raise refusal("found", found, KIND, TypeError)
    for curve in curves:
        check_type("found", curve, FrequencyResponse, KIND)
    check_flag("phase", phase)
    names = curves[0].observables
    name = names[0] if observable is None else check_in("observable", observable, names)
    axis, options = _axes.begin(ax, options)
    for number, curve in enumerate(curves):
        lag = np.rad2deg(np.unwrap(np.asarray(curve.responses.phase[name])))
        values = lag if phase else np.asarray(curve.amplitude[name])
        color = _axes.BLUE if len(curves) == 1 else f"C{number}"
        for wanted, style, word in ((True, "-", "stable"), (False, "--", "unstable")):
            shown = curve.stable == wanted
            shown[1:] |= curve.stable[:-1] == wanted
            if not np.any(curve.stable == wanted):
                continue
            label = word if len(curves) == 1 else f"{number}: {word}"
            line = {"color": color, "linestyle": style, "label": label, **options}
            axis.plot(curve.frequency, np.where(shown, values, np.nan), **line)
        for special in curve.specials:
            near = slice(max(special.index - 1, 0), special.index + 3)
            if special.label not in MARKS or curve.frequency.size != len(curve.branch):
                continue
            # Along the branch, which may turn back, the nearest of the points around it.
            gap = np.abs(curve.frequency[near] - special.value)
            height = values[near][int(np.argmin(gap))]
            axis.plot(special.value, height, MARKS[special.label], color="black", markersize=4)
    axis.set_xlabel(_axes.axis_label(curves[0].solver.forcing.frequency, "rad/s"))
    axis.set_ylabel(f"phase of {name} [deg]" if phase else f"amplitude of {name}")
    _axes.legend(axis)
    return axis


def backbone(found: Given[Backbone], *, ax: Given[Axes | None] = None, **options: Any) -> Axes:
    """Amplitude at phase resonance over its frequency, for instance into axes of frequency responses.

    - `found`: of `stickslip.continuation.backbone`; `ax`, `options`: as for the other pictures.

    **Returns** the axes. **Raises** `TypeError` naming the argument.
    """
    check_type("found", found, Backbone, "a Backbone of stickslip.continuation")
    axis, options = _axes.begin(ax, options, color=_axes.RED, label="phase resonance")
    axis.plot(found.frequency, found.amplitude, **options)
    if not axis.get_xlabel():
        axis.set_xlabel("frequency [rad/s]")
        axis.set_ylabel("amplitude")
    return axis
