"""Branches of periodic orbits over a parameter."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type, refusal
from ..continuation import Branch
from ..hybrid._components import components_of
from . import _axes

MARKS = {"LP": "s", "PD": "D", "NS": "o", "BP": "X", "GR": "^", "SQ": "v"}


def branch(
    branch: Given[Branch],
    observable: Given[str | None] = None,
    *,
    lowest: Given[bool] = False,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """A branch of periodic orbits: stable ones as a line, unstable ones dashed, special points marked.

    **Arguments**

    - `branch`: of `stickslip.continuation.continue_orbit`.
    - `observable`: a component of the state, whose greatest value over the period is drawn (with
      `lowest` its least one too); `"period"`; the first component by default.
    - `ax`, `options`: axes to draw into, for instance those of an orbit diagram; properties of lines.

    **Returns** the axes.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("branch", branch, Branch, "a Branch of continuation.continue_orbit")
    if not isinstance(lowest, bool):
        raise refusal("lowest", lowest, "True or False", TypeError)
    high, low = (components_of(tree) for tree in (branch.orbits.highest, branch.orbits.lowest))
    names = [name for name, leaf in high.items() if np.ndim(leaf) == 1]
    observable = names[0] if observable is None else observable
    if not isinstance(observable, str) or observable not in (*names, "period"):
        raise refusal("observable", observable, f"one of {', '.join((*names, 'period'))}")
    _axes.check_axes(ax)
    options = _axes.check_options(options)
    axis = _axes.canvas(ax)

    def drawn(orbits: Any, highs: Any, lows: Any) -> list[np.ndarray]:
        if observable == "period":
            return [np.asarray(orbits.period)]
        return [np.asarray(found[observable]) for found in ((highs, lows) if lowest else (highs,))]

    values, stable = branch.values, np.asarray(branch.orbits.stable)
    for row in drawn(branch.orbits, high, low):
        for wanted, style in ((True, "-"), (False, "--")):
            # A piece goes on to the first orbit of the other kind: lines do not end at special points.
            shown = stable == wanted
            shown[1:] |= stable[:-1] == wanted
            label = "stable" if wanted else "unstable"
            line = {"color": _axes.BLUE if wanted else _axes.RED, "linestyle": style, **options}
            if shown.any():
                axis.plot(values, np.where(shown, row, np.nan), **{"label": label, **line})
    for special in branch.specials:
        if special.label == "EP":
            continue
        tops, bottoms = (components_of(t) for t in (special.orbit.highest, special.orbit.lowest))
        for at in drawn(special.orbit, tops, bottoms):
            axis.plot(special.value, at, MARKS.get(special.label, "*"), color="black", markersize=4)
            axis.annotate(
                special.label, (special.value, float(at)), xytext=(4, 4), textcoords="offset points",
                fontsize="small",
            )  # fmt: skip
    units = getattr(branch.system, "parameter_units", {})
    axis.set_xlabel(_axes.labelled(branch.parameter, units.get(branch.parameter)))
    if observable == "period":
        axis.set_ylabel("period [s]")
    else:
        axis.set_ylabel(_axes.labelled(f"greatest {observable}", branch.system.units.get(observable)))
    return axis
