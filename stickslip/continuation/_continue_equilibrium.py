"""`continue_equilibrium`: a branch of equilibria over one parameter, with its Hopf points and folds."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from .._types import Given, Mode
from .._validation import check_count, check_flag, one_concrete, refusal
from ..analysis.observable import with_parameters
from ..hybrid import AbstractHybridSystem
from ..hybrid.arguments import check_field, start_of, the_system
from ..hybrid.tree import with_float_arrays
from ._arguments import bounds_of, levels_of, value_of
from ._closing import check_autonomous
from ._equilibrium import EquilibriumBranch, EquilibriumPoint
from ._rest import (
    Field,
    Measure,
    Rest,
    angle_of,
    corrected,
    measure_of,
    of_length_one,
    renewed,
    tangent_of,
)
from ._rest_points import ODD, axis_pair, crossing, labelled, located, signs

BEND = 0.32  # angle between two tangents [rad]: sharper bends get shorter steps
SHORTEST = 2.0**-12
SWERVES = 0.1  # of a step: farther than this and its bend from where it was expected, it is another one
KNOWN = 1e-9  # of the sizes: to which equilibria are known
# Of its move: a component that began to move is there where the tangents let expect it, but for this.
ASTRAY = 0.9
# Part of the largest singular value: a step does not end as near as this to a branch point.
DOUBLE = 1e-7
SLACK = 1e-12  # of the bounds' distance: as far outside of them is rounding
TRIES, LADDER = 16, 30  # of a first step, of first sizes
FIRST = 0.02  # of the bounds' distance: the first of them


def continue_equilibrium(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    parameter: Given[str],
    bounds: Given[tuple[float, float]],
    *,
    mode0: Mode | None = None,
    step: Given[float] = 0.02,
    max_points: Given[int] = 200,
    values: Given[tuple[float, ...]] = (),
    both: Given[bool] = True,
    args: PyTree = None,
) -> EquilibriumBranch:
    r"""Follow an equilibrium, $f(y; p) = 0$ in one mode, over one parameter, through folds.

    Pseudo-arclength continuation with exact derivatives; each state is a solution of Newton's method.
    Where a real eigenvalue or a pair of the linear motion about it crosses the imaginary axis, the
    point is located by root finding along the branch. The guards of the system are not looked at: an
    equilibrium of a mode that the system would leave is one of the mode's field alone.

    **Arguments**

    - `system`, `args`: without dependence on the time; `parameter` has the value where `y0` is.
    - `y0`: a state near the equilibrium; `mode0`: in which mode, by default that of the system there.
    - `bounds`: least and greatest value of the parameter.
    - `step`: first and longest step, in parts of the bounds' distance and of the extent of the branch.
    - `values` of the parameter at which a point `UZ` is wanted.
    - `max_points`: states on each of the two halves. `both`: follow to both sides of `y0`; otherwise
      to larger values of the parameter.

    **Returns** an `EquilibriumBranch` with the special points `LP` (fold), `BP` (branch point), `HB`
    (Hopf: a pair crosses the imaginary axis), `UZ` and `EP` (end, with the reason). From an `HB` point
    `continue_orbit` follows the periodic orbits that are born there. It runs outside `jit`. A branch
    point at which the parameter turns, as along one branch of a pitchfork, is a `BP` and no `LP`.
    What is not located has a question mark, `LP?`, and words between which states it lies. Results
    do not depend on the units of the state, of the time and of the parameter.

    **Errors** `ValueError`/`TypeError` naming the argument; also where Newton's method finds no
    equilibrium from `y0`.
    """
    the_system(system)
    value = value_of(system, parameter)
    low, high = bounds_of("bounds", bounds)
    if not low <= value <= high:
        raise refusal("bounds", (low, high), f"around the value of {parameter}, {value}")
    levels = levels_of("values", values, (low, high))
    step = float(one_concrete("step", step, "positive"))
    check_count("max_points", max_points, 1)
    check_flag("both", both)
    y0, mode = start_of(system, 0.0, y0, mode0, args)
    check_field(system, 0.0, y0, mode, args)
    check_autonomous("system", system, 0.0, y0, mode, args, "without dependence on the time")
    z = np.append(np.asarray(ravel_pytree(y0)[0], float), value)
    system, args = with_float_arrays((system, args))
    field = Field(system, parameter, 0.0, y0, mode, args)
    hold = np.zeros(z.size)
    hold[-1] = 1.0
    first = _first(field, z, hold, high - low)
    if first is None:
        raise refusal("y0", y0, "near an equilibrium of this mode: Newton's method finds none")
    ends = (low, high)
    measure = _measured(field, first, high - low, step)
    first = dataclasses.replace(first, tangent=of_length_one(first.tangent, hold, measure))
    forward, marks = _half(field, first, measure, ends, step, max_points, True, levels)
    marks = [("UZ", first, "")] * (first.value in levels) + marks
    if both:
        back = dataclasses.replace(first, tangent=-first.tangent)
        backward, before = _half(field, back, measure, ends, step, max_points, False, levels)
        forward, marks = backward[:0:-1] + forward, before[::-1] + marks
    states = np.stack([p.z for p in forward])
    tree = jax.vmap(field.unravel)(jnp.asarray(states[:, :-1]))
    return EquilibriumBranch(
        parameter, states[:, -1], int(mode), jax.tree.map(np.asarray, tree),
        np.stack([p.eigenvalues for p in forward]),
        tuple(_special(field, int(mode), system, *mark) for mark in marks), system,
    )  # fmt: skip


def _first(field: Field, z: np.ndarray, hold: np.ndarray, span: float) -> Rest | None:
    """The equilibrium near the given state, at the value of the parameter; at a fold, all but at it."""
    first = corrected(field, z, hold, hold, None)
    jacobian = field(z)[1]
    if first is not None or not np.all(np.isfinite(jacobian)):
        return first
    measure = measure_of(np.append(np.abs(z[:-1]), span), jacobian)
    along = measure.along(tangent_of(jacobian, hold, measure))
    found = corrected(field, z, along, hold, measure)
    return found if found is not None and abs(found.value - z[-1]) <= SLACK * span else None


def _measured(field: Field, first: Rest, span: float, step: float) -> Measure:
    """Sizes at the start: how far each component moves, as slope and curvature there let expect.

    The parameter is changed a little to find them; at a start where it turns, nothing but trying tells.
    """
    size = np.append(np.zeros(first.z.size - 1), span)
    measure = measure_of(size, first.jacobian)
    rate = abs(first.tangent[-1] / measure.columns[-1])
    if rate > KNOWN * np.max(np.abs(first.tangent / measure.columns)):
        along, sense, none = measure.along(first.tangent), first.tangent, np.zeros(size.size)
        along = np.where(np.arange(size.size) < size.size - 1, 0.0, along)
        for k in range(TRIES):
            for way in (1.0, -1.0):
                change = way * FIRST * span * 0.25**k * sense / sense[-1]
                new = corrected(field, first.z + change, along, sense, measure)
                if new is not None and not _astray(first, new, measure, none):
                    return renewed(measure, first, new, none)
    way = first.tangent / np.max(np.abs(first.tangent / measure.columns))
    way[-1] = 0.0
    largest = np.max(np.abs(first.z[:-1]) / np.where(way[:-1] != 0.0, np.abs(way[:-1]), np.inf))
    for k in range(2 * LADDER):
        size = np.abs(way) * (largest if largest > 0.0 else 4.0**LADDER) * 0.25**k
        size[-1] = span
        measure = dataclasses.replace(measure, size=size)
        tangent = of_length_one(first.tangent, first.tangent, measure)
        rest = dataclasses.replace(first, tangent=tangent)
        new = corrected(field, first.z + step * tangent, measure.along(tangent), tangent, measure)
        if new is not None and not _leaps(rest, new, step, measure):
            if angle_of(tangent, new.tangent, measure) < 0.5 * BEND:
                break
    return measure


def _half(
    field: Field, start: Rest, measure: Measure, ends, step: float, most: int, first: bool,
    levels: tuple[float, ...],
):  # fmt: skip
    """Equilibria from `start` along its tangent; special points as (label, where, words).

    A function that is zero at an equilibrium keeps the sign that it had, so that what is met exactly
    is found once, with the next one. At the start the `first` half looks back for it.
    """
    points, marks, distance, longest = [start], [], step, step
    lowest, highest = start.z, start.z
    had = signs(start, measure)
    if first and 0 in had.values():
        behind = _beyond(field, dataclasses.replace(start, tangent=-start.tangent), measure, step)
        had = _continued(had, {k: -s if k in ODD else s for k, s in behind.items()})
    slack = SLACK * (ends[1] - ends[0])
    while len(points) < most:
        rest = points[-1]
        new = _ahead(field, rest, distance, measure)
        leaps = new is not None and _leaps(rest, new, distance, measure)
        if new is None or leaps or angle_of(rest.tangent, new.tangent, measure) > BEND:
            if distance > SHORTEST * step:
                distance *= 0.5
                continue
            if new is None or leaps:
                marks.append(("EP", rest, "not_converged: the next equilibrium was not found"))
                return points, marks
        elif _double(new, measure) and not _double(rest, measure) and distance == longest:
            distance *= 0.8  # near a branch point the tangent is not known
            continue
        now, outside = signs(new, measure), not ends[0] <= new.value <= ends[1]
        if outside and 0 in now.values():
            now = _continued(now, _beyond(field, new, measure, step))
        changed = [label for label, sign in now.items() if sign * had[label] < 0]
        had = {label: sign or had[label] for label, sign in now.items()}
        found = labelled(field, rest, new, distance, measure, changed)
        found += _asked(field, rest, new, distance, measure, levels)
        marks += sorted(found, key=lambda mark: measure.length(mark[1].z - rest.z))
        if outside:
            bound = ends[0] if new.value < ends[0] else ends[1]
            known = {0.0: rest, distance: new}
            last = located(field, rest, [0.0, distance], known, measure, lambda p, b=bound: p.value - b)
            last = rest if isinstance(last, str) else last
            inside = [m for m in marks if ends[0] - slack <= m[1].value <= ends[1] + slack]
            points = points if last is rest else [*points, last]
            return points, [*inside, ("EP", last, "bounds")]
        lowest, highest = np.minimum(lowest, new.z), np.maximum(highest, new.z)
        measure = renewed(measure, rest, new, highest - lowest)
        points.append(
            dataclasses.replace(new, tangent=of_length_one(new.tangent, new.tangent, measure))
        )
        distance = longest = min(1.5 * distance, step)
    last = points[-1]
    now = signs(last, measure)
    if (first or len(points) > 1) and 0 in now.values():
        now = _continued(now, _beyond(field, last, measure, step))
        changed = [label for label, sign in now.items() if sign * had[label] < 0]
        marks += labelled(field, last, last, 0.0, measure, changed)
    return points, [*marks, ("EP", last, "max_points")]


def _asked(field: Field, rest: Rest, new: Rest, distance: float, measure: Measure, levels) -> list:
    """Equilibria between two at values of the parameter that are asked for."""
    found, known = [], {0.0: rest, distance: new}
    for level in levels:
        one, two = rest.value - level, new.value - level
        if one == 0.0 or one * two > 0.0:
            continue
        at = located(field, rest, [0.0, distance], known, measure, lambda p, v=level: p.value - v)
        if isinstance(at, str):
            words = f"not located: between here and {new.value:.10g}, {at}"
            found.append(("UZ?", rest, words))
        else:
            found.append(("UZ", dataclasses.replace(at, z=np.append(at.z[:-1], level)), ""))
    return found


def _ahead(field: Field, rest: Rest, distance: float, measure: Measure) -> Rest | None:
    along = measure.along(rest.tangent)
    return corrected(field, rest.z + distance * rest.tangent, along, rest.tangent, measure)


def _beyond(field: Field, rest: Rest, measure: Measure, step: float) -> dict[str, int]:
    """Signs of the functions a little farther along the branch."""
    for part in (2.0**-4, 2.0**-8, 2.0**-12):
        new = _ahead(field, rest, part * step, measure)
        if new is not None and not _leaps(rest, new, part * step, measure):
            return signs(new, measure)
    return {}


def _continued(now: dict[str, int], other: dict[str, int]) -> dict[str, int]:
    """Signs, and where there is none, those of another place."""
    return {label: sign or other.get(label, 0) for label, sign in now.items()}


def _double(rest: Rest, measure: Measure) -> bool:
    """Whether it is hardly farther from a branch point than rounding."""
    return abs(crossing(rest, measure)) < DOUBLE


def _leaps(rest: Rest, new: Rest, distance: float, measure: Measure) -> bool:
    """Whether an equilibrium, a step ahead, is farther away than the branch bends: on another one."""
    move = distance * rest.tangent
    away = measure.length(new.z - rest.z - move)
    if away > (SWERVES + angle_of(rest.tangent, new.tangent, measure)) * distance + KNOWN:
        return True
    return _astray(rest, new, measure, measure.size)


def _astray(rest: Rest, new: Rest, measure: Measure, size: np.ndarray) -> bool:
    """Whether a component without size moves as the tangents at both ends do not let expect."""
    change = new.z[-1] - rest.z[-1]
    if rest.tangent[-1] == 0.0 or new.tangent[-1] == 0.0:
        return False
    own = measure_of(measure.size, new.jacobian)
    move, least = new.z - rest.z, own.least(new.jacobian, new.z)
    expected = 0.5 * change * (rest.tangent / rest.tangent[-1] + new.tangent / new.tangent[-1])
    most = ASTRAY * np.maximum(np.abs(move), np.abs(expected)) + least
    return bool(np.any((size == 0.0) & (np.abs(move - expected) > most)))


def _special(
    field: Field, mode: int, system: AbstractHybridSystem, label: str, rest: Rest, words: str
) -> EquilibriumPoint:
    period, swing = np.nan, np.zeros(rest.z.size - 1)
    pair = axis_pair(rest) if label == "HB" else None
    if pair is not None:
        period, swing = 2.0 * np.pi / abs(rest.eigenvalues[pair].imag), np.real(rest.vectors[:, pair])
    y = jax.tree.map(np.asarray, field.unravel(jnp.asarray(rest.z[:-1])))
    there = with_parameters(system, {field.name: np.float64(rest.value)})
    return EquilibriumPoint(label, rest.value, y, mode, rest.eigenvalues, period, swing, words, there)
