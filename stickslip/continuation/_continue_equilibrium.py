"""`continue_equilibrium`: a branch of equilibria over one parameter, with its Hopf points and folds."""

import dataclasses

import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from .._types import Given, Mode
from .._validation import refusal
from ..hybrid import AbstractHybridSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import check_field, start_of, the_system
from ..hybrid.tree import with_float_arrays
from ..progress import showing
from ._accuracy import ACCURACY
from ._arguments import bounds_of, follow_of, value_of
from ._branch import Branch, branch_of
from ._closing import check_autonomous
from ._equilibria import Equilibria, strays
from ._options import FOLLOW, Follow
from ._rest import (
    Field,
    Measure,
    Rest,
    angle_of,
    equilibrium_at,
    measure_of,
    next_measure,
    of_length_one,
    tangent_of,
)
from ._walk import follow as follow_branch
from ._walk import join


@showing("continue_equilibrium")
def continue_equilibrium(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    parameter: Given[str],
    bounds: Given[tuple[float, float]],
    *,
    mode0: Mode | None = None,
    follow: Given[Follow] = FOLLOW,
    args: PyTree = None,
) -> Branch:
    r"""Follow an equilibrium, $f(y; p) = 0$ in one mode, over one parameter, through folds.

    Pseudo-arclength continuation with exact derivatives; each state is a solution of Newton's method.
    Where a real eigenvalue or a pair of the linear motion about it crosses the imaginary axis, the
    point is located by root finding along the branch. The guards of the system are not looked at: an
    equilibrium of a mode that the system would leave is one of the mode's field alone.

    **Arguments**

    - `system`, `args`: without dependence on the time; `parameter` has the value where `y0` is.
    - `y0`: a state near the equilibrium; `mode0`: in which mode, by default that of the system there.
    - `bounds`: least and greatest value of the parameter.
    - `follow`: a `Follow`: `step` (in parts of the extent of the branch), `max_points`, `both`,
      `values`, `tests` of the `Equilibrium`.

    **Returns** a `Branch` whose `orbits` are an `Equilibrium`, with the special points `LP` (fold),
    `BP` (branch point), `HB` (Hopf: a pair crosses the imaginary axis), `FL` (flutter without damping:
    two pairs on the axis meet and leave it), `UZ` and `EP` (end, with the reason). From an `HB` point
    `continue_orbit` follows the periodic orbits that are born there. It runs outside `jit`. A branch
    point at which the parameter turns, as along one branch of a pitchfork, is a `BP` and not an `LP`.
    Where several eigenvalues pass at once, as of two machines that are alike, the `words` of its point
    say so. One that is not located has a question mark, `LP?`, and words between which states it lies.
    Results do not depend on the units of state, time and parameter.

    **Errors** `ValueError`/`TypeError` naming the argument; also where Newton's method finds no
    equilibrium from `y0`.
    """
    the_system(system)
    value = value_of(system, parameter)
    low, high = bounds_of("bounds", bounds)
    if not low <= value <= high:
        raise refusal("bounds", (low, high), f"around the value of {parameter}, {value}")
    options = follow_of(follow, ((low, high),))
    y0, mode = start_of(system, 0.0, y0, mode0, args)
    check_field(system, 0.0, y0, mode, args)
    check_autonomous("system", system, 0.0, y0, mode, args, "without dependence on the time")
    z = np.append(np.asarray(ravel_pytree(y0)[0], float), value)
    plain, args = with_float_arrays((system, args))
    field = Field(plain, parameter, 0.0, y0, mode, args)
    hold = np.zeros(z.size)
    hold[-1] = 1.0
    first = _first(field, z, hold, high - low)
    if first is None:
        raise refusal("y0", y0, "near an equilibrium of this mode: Newton's method finds none")
    family = Equilibria(field, int(mode), options.tests)
    measure = _first_measure(family, first, high - low, options.step)
    tangent = of_length_one(first.tangent, hold, measure)
    first = dataclasses.replace(first, tangent=tangent, measure=measure)
    half = follow_branch(family, first, ((low, high),), options)
    if options.both:
        back = follow_branch(family, first.backward(), ((low, high),), options, first=False)
        half = join(half, back)
    return branch_of(family, half, system)


def _first(field: Field, z: np.ndarray, hold: np.ndarray, span: float) -> Rest | None:
    """The equilibrium near the given state, at the value of the parameter; at a fold, all but at it."""
    first = equilibrium_at(field, z, hold, hold, None)
    # At a fold no equilibrium is near at this value of the parameter: it is let go along the branch.
    jacobian = field(z)[1]
    if first is not None or not np.all(np.isfinite(jacobian)):
        return first
    measure = measure_of(np.append(np.abs(z[:-1]), span), jacobian)
    along = measure.along(tangent_of(jacobian, hold, measure))
    found = equilibrium_at(field, z, along, hold, measure)
    return found if found is not None and abs(found.value - z[-1]) <= ENGINE.slack * span else None


def _first_measure(family: Equilibria, first: Rest, span: float, step: float) -> Measure:
    """Sizes at the start: how far each component moves, as slope and curvature there let expect.

    The parameter is changed a little to find them; at a start where it turns, nothing but trying tells.
    """
    field, size = family.field, np.append(np.zeros(first.z.size - 1), span)
    measure = measure_of(size, first.jacobian)
    rate = abs(first.tangent[-1] / measure.columns[-1])
    if rate > ENGINE.zero * np.max(np.abs(first.tangent / measure.columns)):
        along, sense, none = measure.along(first.tangent), first.tangent, np.zeros(size.size)
        along = np.where(np.arange(size.size) < size.size - 1, 0.0, along)
        # Where the state bends fast, only a small change of the parameter says how fast it moves.
        for k in range(ACCURACY.rounds):
            for way in (1.0, -1.0):
                change = way * step * span * 0.25**k * sense / sense[-1]
                new = equilibrium_at(field, first.z + change, along, sense, measure)
                if new is not None and not strays(first, new, measure, none):
                    return next_measure(measure, first, new, none)
    way = first.tangent / np.max(np.abs(first.tangent / measure.columns))
    way[-1] = 0.0
    largest = np.max(np.abs(first.z[:-1]) / np.where(way[:-1] != 0.0, np.abs(way[:-1]), np.inf))
    # Sizes from far too large ones on: the first with which a step is straight enough is the branch's.
    for k in range(2 * ACCURACY.tries):
        size = np.abs(way) * (largest if largest > 0.0 else 4.0**ACCURACY.tries) * 0.25**k
        size[-1] = span
        measure = dataclasses.replace(measure, size=size)
        tangent = of_length_one(first.tangent, first.tangent, measure)
        rest = dataclasses.replace(first, tangent=tangent, measure=measure)
        new = family.onward(rest, step)
        if isinstance(new, Rest) and not family.leaps(rest, new, step):
            if angle_of(tangent, new.tangent, measure) < 0.5 * np.arccos(ACCURACY.bend_at_rest):
                break
    return measure
