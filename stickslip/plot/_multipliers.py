"""Floquet multipliers in the complex plane."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from .._types import Given
from .._validation import check_known, check_type, refusal
from ..continuation import Branch, PeriodicOrbit
from . import _axes
from ._branch import MARKS

CIRCLE = "unit circle"


def multipliers(
    orbits: Given[PeriodicOrbit | Branch], *, ax: Given[Axes | None] = None, **options: Any
) -> Axes:
    """Floquet multipliers in the complex plane, with the unit circle.

    **Arguments**

    - `orbits`: a `PeriodicOrbit`, also one with leading axes, or a `Branch`, both of
      `stickslip.continuation`.
    - `ax`, `options`: axes to draw into; properties of the dots, as matplotlib calls them.

    **Returns** the axes. Multipliers of stable and of unstable orbits have the colours of
    `plot.branch`, those at special points of a branch its marks. The trivial multiplier, orbits that
    were not found, and NaN are left out. At most 2.5 times the unit circle is shown: what lies beyond
    is a triangle at the edge, which points to it, a special point's its mark there; a note says how
    many these are and how large the largest is.

    **Raises** `ValueError`, `TypeError` naming the argument; for orbits without any multiplier.
    """
    allowed = "a PeriodicOrbit or a Branch of stickslip.continuation"
    check_type("orbits", orbits, PeriodicOrbit | Branch, allowed)
    check_known("orbits", orbits)
    many = orbits.orbits if isinstance(orbits, Branch) else orbits
    check_type("orbits", many, PeriodicOrbit, allowed)
    _axes.check_axes(ax)
    options = _axes.check_options(options)
    specials = orbits.specials if isinstance(orbits, Branch) else ()
    marked: dict[str, np.ndarray] = {}
    for special in specials:
        if special.label != "EP":
            before = marked.get(special.label, np.zeros(0, complex))
            marked[special.label] = np.append(before, _multipliers_of(special.orbit))
    drawn = {"stable": _multipliers_of(many, True), "unstable": _multipliers_of(many, False)}
    every = np.concatenate([*drawn.values(), *marked.values()])
    if not every.size:
        nothing = "orbits that were found, with a multiplier that is a number"
        raise refusal("orbits", orbits, nothing, but="of which there is nothing to draw")
    axis = _axes.canvas(ax)
    if ax is None:
        axis.figure.set_size_inches(4.8, 4.8)
    reach = _circle(axis, every)
    size = 6.0 if np.ndim(many.period) == 0 else 4.0
    given = {"linestyle": "none", "marker": "o", "markersize": size, "markeredgewidth": 0.0, **options}
    for (label, found), color in zip(drawn.items(), (_axes.BLUE, _axes.RED), strict=True):
        inside = _beyond(found) <= reach
        style = {"color": color, "zorder": 2.5, **given}
        if found.size:
            axis.plot(np.real(found[inside]), np.imag(found[inside]), **{"label": label, **style})
        directions = np.unique(np.round(np.angle(found[~inside], deg=True)))
        edges = _edge(np.exp(1j * np.radians(directions)), reach)
        for degrees, edge in zip(directions, edges, strict=True):
            # A triangle stands on its side: its tip is at 90 degrees.
            arrow = {"marker": (3, 0, float(degrees) - 90.0), "markersize": 9.0, "label": "_beyond"}
            axis.plot(edge.real, edge.imag, **{**style, **arrow})
    for label, found in marked.items():
        at, outside = found.copy(), _beyond(found) > reach
        at[outside] = _edge(found[outside], reach)
        axis.plot(
            np.real(at), np.imag(at), MARKS.get(label, "*"), color="black", markersize=6, zorder=3.5,
            markerfacecolor="none", label=label,
        )  # fmt: skip
    _note(axis, every, reach)
    axis.set(xlabel="real part", ylabel="imaginary part")
    _axes.legend(axis, loc="upper right")  # notes are at the bottom
    return axis


def _multipliers_of(orbits: PeriodicOrbit, stable: bool | None = None) -> np.ndarray:
    """Multipliers of orbits that were found, in a row; of the stable ones alone, or of the others."""
    found = np.asarray(orbits.multipliers)
    rows = np.asarray(orbits.successful)
    if stable is not None:
        rows = rows & (np.asarray(orbits.stable) == stable)
    return found[rows[..., None] & np.isfinite(found)]


def _beyond(found: np.ndarray) -> np.ndarray:
    """How far out in the square that is shown."""
    return np.maximum(np.abs(np.real(found)), np.abs(np.imag(found)))


def _edge(found: np.ndarray, reach: float) -> np.ndarray:
    """Where the rays from zero leave the square."""
    return found * (reach / _beyond(found))


def _circle(axis: Axes, every: np.ndarray) -> float:
    """Draw the unit circle and the axes through zero; how far from zero is shown."""
    reach = 2.5 if np.max(_beyond(every)) > 1.2 else 1.2
    room = 1.06  # of what is shown: where the axes end
    circles = [patch for patch in axis.patches if patch.get_gid() == CIRCLE]
    if circles:
        # Drawn before, for other orbits: their triangles at the edge stay there.
        reach = max(reach, axis.get_xlim()[1] / room)
    else:
        circle = Circle((0.0, 0.0), 1.0, fill=False, edgecolor=_axes.GREY, linewidth=0.8, zorder=1.0)
        circle.set_gid(CIRCLE)
        axis.add_patch(circle)
        axis.axhline(0.0, color=_axes.BAND, linewidth=0.5, zorder=0.5)
        axis.axvline(0.0, color=_axes.BAND, linewidth=0.5, zorder=0.5)
    axis.set_aspect("equal", adjustable="box")
    axis.set(xlim=(-room * reach, room * reach), ylim=(-room * reach, room * reach))
    return reach


def _note(axis: Axes, every: np.ndarray, reach: float) -> None:
    """How many multipliers lie beyond what is shown, above the notes of earlier calls."""
    outside = np.abs(every[_beyond(every) > reach])
    if outside.size:
        how_many = f"{outside.size} of {every.size} multipliers beyond"
        axis.text(
            0.02, 0.02 + 0.05 * len(axis.texts), f"{how_many}, the largest of size {outside.max():.3g}",
            transform=axis.transAxes, fontsize="small",
        )  # fmt: skip
