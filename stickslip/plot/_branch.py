"""Branches of orbits and equilibria over a parameter or two."""

from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_type, refusal
from ..continuation import Branch
from ..hybrid.components import (
    Place,
    component_list,
    components_of,
    entries,
    numbers_of,
    place_of,
    unit_of,
)
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
    """A branch: stable orbits or equilibria as a line, unstable ones dashed, special points marked.

    One over two parameters is drawn in their plane.

    **Arguments**

    - `branch`: of `stickslip.continuation`.
    - `observable`: a component of the state, `"x[0]"` for one number of an array, whose greatest value
      over the period is drawn (with `lowest` its least one too); `"period"`; the first one by default.
      Over two parameters it is left out.
    - `ax`, `options`: axes to draw into, for instance those of an orbit diagram; properties of lines.

    **Returns** the axes. Special points have their label. An end of a branch over one parameter is not
    marked, nor over two parameters one at a bound; others have the first word of their reason.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    check_type("branch", branch, Branch, "a Branch of stickslip.continuation")
    if not isinstance(lowest, bool):
        raise refusal("lowest", lowest, "True or False", TypeError)
    if len(branch.parameters) > 1:
        if observable is not None:
            raise refusal("observable", observable, "None for a branch over two parameters")
        return _in_the_plane(branch, ax, options)
    orbits = branch.orbits
    place = _place(orbits.highest, observable)
    axis, options = _axes.begin(ax, options)

    def curves_of(orbits: Any) -> list[np.ndarray]:
        if place is None:
            return [np.asarray(orbits.period)]
        trees = (orbits.highest, orbits.lowest) if lowest else (orbits.highest,)
        leaves = [np.asarray(jax.tree.leaves(tree)[place.leaf]) for tree in trees]
        return [leaf[(..., *(place.index or ()))] for leaf in leaves]

    values, stable = branch.values, np.asarray(orbits.stable)
    for row in curves_of(orbits):
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
        for at in curves_of(special.orbit):
            axis.plot(special.value, at, MARKS.get(special.label, "*"), color="black", markersize=4)
            axis.annotate(
                special.label, (special.value, float(at)), xytext=(4, 4), textcoords="offset points",
                fontsize="small",
            )  # fmt: skip
    units = getattr(branch.system, "parameter_units", {})
    axis.set_xlabel(_axes.axis_label(branch.parameter, units.get(branch.parameter)))
    if place is None:
        axis.set_ylabel("period [s]")
    else:
        name = numbers_of(_one(orbits.highest))[0] if observable is None else observable
        axis.set_ylabel(_axes.axis_label(f"greatest {name}", unit_of(branch.system, place.name)))
    return axis


def _in_the_plane(branch: Branch, ax: Axes | None, options: dict[str, Any]) -> Axes:
    """A branch in the plane of its two parameters."""
    axis, options = _axes.begin(ax, options, label=branch.label, color=_axes.BLUE)
    axis.plot(*branch.values.T, **options)
    unmarked = "bounds of", "closed", "max_points", *(s.label for s in branch.specials)
    marks = [(s.words.partition(":")[0] if s.label == "EP" else s.label, s) for s in branch.specials]
    for word, special in marks:
        if special.label == "EP" and word.startswith(unmarked):
            continue
        axis.plot(*special.values, "o", color="black", markersize=4)
        axis.annotate(
            word, tuple(map(float, special.values)), xytext=(4, 4), textcoords="offset points",
            fontsize="small",
        )  # fmt: skip
    units = getattr(branch.system, "parameter_units", {})
    one, two = (_axes.axis_label(name, units.get(name)) for name in branch.parameters)
    axis.set(xlabel=one, ylabel=two)
    return axis


def _one(batch: Any) -> Any:
    """A state of the form of those in a batch."""
    return jax.tree.map(lambda leaf: np.zeros(np.shape(leaf)[1:]), batch)


def _place(batch: Any, observable: Any) -> Place | None:
    """Where in a state the observable is; None for the period."""
    if isinstance(observable, str) and observable == "period":
        return None
    one = _one(batch)
    if observable is None:
        observable = numbers_of(one)[0]
    place = place_of(one, observable) if isinstance(observable, str) else None
    if place is None:
        raise refusal("observable", observable, f"one of {component_list(one)}, period")
    shape = np.shape(components_of(one)[place.name])
    if shape and place.index is None:
        allowed = f"a single number, one of {', '.join(entries(place.name, shape))}"
        raise refusal("observable", observable, allowed)
    return place
