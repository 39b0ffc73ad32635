"""One periodic orbit of a branch: a closed curve."""

from typing import Any

import jax
import numpy as np
from jaxtyping import PyTree
from matplotlib.axes import Axes

from .._types import Given
from .._validation import check_handed_on, check_type, refusal
from ..analysis.observable import with_parameters
from ..continuation import Branch, BranchPoint, PeriodicOrbit
from ..hybrid import AbstractHybridSystem, AdaptiveStep, Integrator, SaveAt, Solution, simulate
from ..hybrid.components import numbers_of, second_of
from . import _axes
from ._motion import motion
from ._observed import function_of
from ._phase_plane import phase_plane
from ._sticks import rows_of, sticking


def orbit(
    branch: Given[Branch],
    at: Given[int | BranchPoint],
    x: Given[str | None] = None,
    y: Given[str | None] = None,
    *,
    args: PyTree = None,
    ax: Given[Axes | None] = None,
    **options: Any,
) -> Axes:
    """A periodic orbit of a branch, at a special point or any other: one observable over another.

    One period is simulated from the orbit's own state and mode, of the system with the value of the
    parameter there, to a relative error of 1e-10. An orbit is drawn as closed as that is: one whose
    deviations grow by more than some 1e7 in a period is not.

    **Arguments**

    - `branch`: of `stickslip.continuation.continue_orbit`.
    - `at`: the number of an orbit of the branch, from 0, or from -1 backwards; or one of its special
      points, such as `branch["PD"][0]`.
    - `x`, `y`: an observable each, as for `phase_plane`: by default the first component and its rate,
      of any other system the next component. The only component of a state is drawn over time.
    - `args`: what `continue_orbit` was given.
    - `ax`, `options`: axes to draw into; properties of the curve, as matplotlib calls them.

    **Returns** the axes. Their title has the label of a special point, or the number of the orbit, the
    value of the parameter and the period. Parts in which a contact sticks have a broad line beneath;
    over time they are shaded, and events are marked.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """
    allowed = "a Branch of periodic orbits"
    check_type("branch", branch, Branch, allowed)
    check_type("branch.orbits", branch.orbits, PeriodicOrbit, allowed)
    found, values, title = _orbit_at(branch, at)
    check_handed_on("args", args)
    _axes.check_axes(ax)
    _axes.check_options(options)
    there = dict(zip(branch.parameters, map(np.float64, values), strict=True))
    system = with_parameters(branch.system, there)
    for argument, what in (("x", x), ("y", y)):
        if what is not None:
            function_of(argument, what, system, found.y0)
    solution = _period(system, found, args)
    names = numbers_of(found.y0)
    if y is None and len(names) == 1 and x in (None, names[0]):
        axis = motion(solution, system, names[0], args=args, ax=ax, **options)
    else:
        axis = phase_plane(solution, system, x, y, args=args, ax=ax, **options)
        _sticks(axis, solution, system)
    units = getattr(branch.system, "parameter_units", {})
    parameter = ", ".join(_with_unit(f"{k} = {v:.6g}", units.get(k)) for k, v in there.items())
    period = _with_unit(f"period {float(found.period):.6g}", second_of(system))
    axis.set_title(f"{title} at {parameter}, {period}", fontsize="medium")
    return axis


def _orbit_at(branch: Branch, at: Any) -> tuple[PeriodicOrbit, np.ndarray, str]:
    """The orbit, the values of the parameters, and what the orbit is called."""
    size = len(branch)
    specials = ", ".join(f"branch[{s!r}]" for s in dict.fromkeys(s.label for s in branch.specials))
    allowed = f"the number of an orbit, from {-size} to {size - 1}, or one of branch.specials" + (
        f" (here of {specials})" if specials else " (here there are none)"
    )
    if isinstance(at, BranchPoint):
        if not any(at is special for special in branch.specials):
            raise refusal("at", at, allowed, but="of another branch")
        found, values, title = at.orbit, at.values, at.label
    else:
        if not isinstance(at, int | np.integer) or isinstance(at, bool):
            raise refusal("at", at, allowed, TypeError)
        if not -size <= at < size:
            raise refusal("at", at, allowed)
        number = int(at) % size
        found = jax.tree.map(lambda leaf: leaf[number], branch.orbits)
        values = branch.values[number]
        title = f"orbit {number}"
    if not bool(found.successful):
        raise refusal("at", at, "of an orbit that was found", but=str(found.result))
    return found, np.atleast_1d(values), title


def _period(system: AbstractHybridSystem, found: PeriodicOrbit, args: PyTree) -> Solution:
    """One period, kept at equal distances of time and on both sides of its events."""
    start, period = float(found.t0), float(found.period)
    end = start + period
    count, room = int(found.events.count), found.events.t.shape[-1]
    events = np.asarray(found.events.t)[:count]
    # An event is drawn from both sides: at it, and a trace of the period later.
    both = np.concatenate([events, events + 1e-9 * period])
    both = both[(both > start) & (both < end)]
    # So many that their number is the same for most orbits of a branch: one program for all of them.
    rest = 2001 + (1 << (2 * count + 15).bit_length()) - both.size
    times = np.unique(np.concatenate([np.linspace(start, end, rest), both]))
    return simulate(
        system, start, end, found.y0, found.mode0, args,
        saveat=SaveAt(ts=times, max_events=max(room, 256)),
        integrator=Integrator(step=AdaptiveStep(1e-10)),
    )  # fmt: skip


def _sticks(axis: Axes, solution: Solution, system: AbstractHybridSystem) -> None:
    """A broad line beneath the curve where a contact sticks."""
    (*_, line) = axis.lines
    rows: Any = rows_of(solution)
    width = line.get_linewidth() + 4.0  # points: it shows on both sides
    across, along = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    held = sticking(system, np.asarray(rows.mode))
    held = {name: stuck for name, stuck in held.items() if np.any(stuck[1:] & stuck[:-1])}
    for name, stuck in held.items():
        axis.plot(
            np.where(stuck, across, np.nan), np.where(stuck, along, np.nan), color=_axes.BAND,
            linewidth=width, zorder=line.get_zorder() - 0.5, solid_capstyle="butt",
            label=f"{name} sticks" if name else "stick",
        )  # fmt: skip
    if held:
        axis.legend(frameon=False, fontsize="small")


def _with_unit(text: str, unit: str | None) -> str:
    """A number with its unit behind it."""
    return text if unit in (None, "", "1") else f"{text} {unit}"
