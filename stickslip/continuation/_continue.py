"""`continue_orbit`: a branch of periodic orbits over one parameter."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import PyTree

from .._types import Given
from .._validation import check_type, refusal
from ..hybrid import AbstractHybridSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.arguments import the_system
from ..hybrid.status import DISCONTINUOUS
from ..progress import showing
from ._accuracy import ACCURACY
from ._along import Problem, equations_at
from ._arguments import bounds_of, concrete_guess, follow_of, problem_of, value_of
from ._branch import Branch, BranchPoint, branch_of
from ._equilibrium import Equilibrium
from ._family import Failure
from ._guess import OrbitGuess
from ._options import FOLLOW, SHOOTING, Follow, Shooting
from ._orbit import PeriodicOrbit
from ._orbits import CLOSED, Orbits
from ._point import Point, ahead, begin, remeasure
from ._switch import crossing, doubled_orbit, orbit_at_hopf, outward
from ._walk import follow as follow_branch
from ._walk import join

PRIMES = tuple(n for n in range(7, 14) if math.gcd(n, ACCURACY.parts) == 1)
CUT_OFF = ("max_points", "bounds", "homoclinic")  # ends beyond which a branch goes on


@showing("continue_orbit")
def continue_orbit(
    system: Given[AbstractHybridSystem],
    orbit: Given[PeriodicOrbit | OrbitGuess | BranchPoint],
    parameter: Given[str],
    bounds: Given[tuple[float, float]],
    *,
    forcing_period: Given[Callable[[Any], Any] | None] = None,
    follow: Given[Follow] = FOLLOW,
    shooting: Given[Shooting] = SHOOTING,
    args: PyTree = None,
) -> Branch:
    r"""Follow a periodic orbit over one parameter, through folds and changes of the mode sequence.

    Pseudo-arclength continuation (Keller 1977): the unknowns are the state, the period (where nothing
    forces the system) and the parameter; each point is Newton's solution in the plane across the last
    tangent. Every orbit is simulated again and has its Floquet multipliers. Special points between two
    orbits are located by root finding along the branch, each evaluation a Newton solution.

    The sequence of modes is that of the simulation, and may change along the branch: the last orbit of
    the old sequence is located, and the branch is followed beyond it with the derivatives of the new
    one. Where the new one lies on the same side, a discontinuous fold, the branch turns there.

    **Arguments**

    - `system`: its `parameter` (a name, `a__b` for `b` inside `a`) has the value of the orbit.
    - `orbit`: a successful `PeriodicOrbit` of this system, or an `OrbitGuess` near one; or a
      `BranchPoint` of another branch over the same parameter, at whose value it begins: from a `PD`
      point the branch of doubled orbits, from a `BP` point the other branch that crosses there; from an
      `EP` of `max_points` or `bounds` the branch goes on; from an `HB` point of `continue_equilibrium`
      the orbits that are born there. An orbit that repeats itself within its
      period is followed with the shorter one.
    - `bounds`: least and greatest value of the parameter.
    - `forcing_period(system)` [s]: of a system that depends on the time; the orbit's period is a
      multiple of it. None: the period is an unknown.
    - `follow`: a `Follow`, whose `step` is in parts of the motion's size at all knots together: with
      more `segments` the same step is a shorter part of the branch.
    - `shooting`: a `Shooting`. Orbits whose multipliers are large (hundreds) need several `segments`;
      with one the steps become so short that the branch does not get on.
    - `args`: as for `simulate`.

    **Returns** a `Branch`: the orbits in order along the branch, and the special points `LP` (fold),
    `PD` (period doubling), `NS` (torus), `BP` (branch point), `GR` (an event appears or vanishes), `SQ`
    (another change of the mode sequence), `UZ` (at one of the `values`), `HB` (Hopf point: the orbit
    has shrunk to an equilibrium), `EP` (end, with the reason).

    Steps at which Newton's method fails, or that end on another branch, are shortened: an orbit farther
    from the prediction than the curvature explains is on another branch, and an orbit beyond a border
    belongs to the branch only if its own branch leads back there. A branch of doubled orbits ends
    where it meets the orbit that it doubles, at its doubling. A special point that the search did not
    find is labelled with a question mark, `LP?`, and between which orbits it lies; where several
    multipliers pass at once, as of two machines that are alike, its `words` say so.

    The loop is Python and runs outside `jit`; it compiles three programs for the first branch of a
    system and none for later ones. Of a `GR` point `words` name the sliding bifurcation.
    It is the last orbit of the sequence that the branch came with, or of the other where this has
    fewer impacts. Where that orbit has a stick which vanishes, it is lost in rounding before it has no
    length: such points are known to some 1e-7 of the bounds' distance, others to 1e-9 or better.

    Places that are free are those of the first orbit all along (`PeriodicOrbit.neutral`).

    **Errors** `ValueError`/`TypeError` naming the argument, before compilation; after it for an orbit
    that is one of a family at its value of the parameter, as by a quantity that is conserved.
    """
    the_system(system)
    special, known = _start_of(system, orbit, args)
    value = value_of(system, parameter) if special is None else special.value
    low, high = bounds_of("bounds", bounds)
    options = follow_of(follow, ((low, high),))
    if not low <= value <= high:
        raise refusal("bounds", (low, high), f"around the value of {parameter}, {value}")
    problem = problem_of(
        system, {parameter: value}, [high - low], known, forcing_period, args=args, shooting=shooting
    )
    problem, starts = _starts(problem, orbit, special, known, value, 0.5 * (low + high))
    one, *others = starts
    if isinstance(one, Failure):
        one, *others = [p for p in others if isinstance(p, Point)] or [one]
    if isinstance(one, Failure):
        raise refusal("orbit", orbit, f"an orbit of this system: it is {one.result}")
    if int(one.orbit.flags) & DISCONTINUOUS:
        allowed = (
            "an orbit whose derivatives exist: the field or a guard jumps where nothing is declared; "
            "if a load does, see WithPeriodicBreaks; friction needs modes"
        )
        raise refusal("orbit", orbit, allowed)
    family = Orbits(problem, options.tests, int(one.orbit.repeats))
    half = follow_branch(family, one, ((low, high),), options)
    if options.both and others and isinstance(others[0], Point) and half.events[-1].words != CLOSED:
        back = follow_branch(family, others[0], ((low, high),), options, first=False)
        # The other branch at a crossing begins beside it, on both sides.
        half = join(half, back, shared=special is None or special.label != "BP")
    return branch_of(family, half, system)


def _starts(
    problem: Problem, orbit: Any, special: BranchPoint | None, known: Any, value: float, middle: float
) -> tuple[Problem, list[Point | Failure]]:
    """Where each half of the branch begins, and what is followed then."""
    if special is not None and special.label == "HB":
        return problem, [orbit_at_hopf(problem, special.orbit, value)]
    if special is not None and special.label == "PD":
        problem = dataclasses.replace(problem, multiple=2 * problem.multiple)
        return problem, [doubled_orbit(problem, known, value)]  # backwards lies the point it came from
    if special is not None and special.label == "BP":
        return problem, list(crossing(problem, known, value, special.slope))
    first = begin(problem, known, value)
    if isinstance(first, Failure):
        return problem, [first]
    if special is not None and special.words.partition(" ")[0] in CUT_OFF:
        return problem, [outward(problem, first, special.slope)]
    problem, first = _shortest(problem, first)
    if isinstance(first, Failure):
        return problem, [first]
    first = remeasure(problem, first)
    other = _beside(problem, first, middle)
    if other:
        allowed = f"an orbit that is alone, or whose place is free all along the branch: {other}"
        raise refusal("orbit", orbit, allowed, but="one with a further multiplier 1")
    first = first if first.tangent[-1] > 0 else first.backward()
    return problem, [first, first.backward()]


def _start_of(
    system: AbstractHybridSystem, orbit: Any, args: PyTree
) -> tuple[BranchPoint | None, PeriodicOrbit | OrbitGuess]:
    """The special point, None where it is none, and the orbit or guess to begin with."""
    kinds = PeriodicOrbit | OrbitGuess | BranchPoint
    check_type("orbit", orbit, kinds, "a PeriodicOrbit, an OrbitGuess or a BranchPoint")
    if isinstance(orbit, OrbitGuess):
        return None, concrete_guess(system, orbit, args)
    special = orbit if isinstance(orbit, BranchPoint) else None
    known: Any = orbit if special is None else special.orbit
    if isinstance(known, Equilibrium):
        if orbit.label != "HB":
            raise refusal("orbit", orbit, "a Hopf point, HB, if it is one of equilibria")
        guess = OrbitGuess(known.y, known.period, int(known.mode))
        return special, concrete_guess(system, guess, args)
    if np.shape(known.period) != () or not bool(known.successful):
        raise refusal("orbit", orbit, "one successful PeriodicOrbit")
    return special, known


def _beside(problem: Problem, first: Point, middle: float) -> str:
    """Why there are other orbits beside one at the same value of the parameter; empty if there are none
    but for shifts that change nothing.

    Then the equations leave a plane of orbits, or the branch does not move the parameter, here and a
    step ahead; at a fold it does not here alone.
    """
    family = "it is one of a family, by a conserved quantity or a place that is free between limits"
    strength = np.linalg.svd(first.jacobian, compute_uv=False)
    if strength[-1] < ENGINE.zero * strength[0]:
        return family
    if abs(first.tangent[-1]) < 0.1 * ENGINE.same:
        then = ahead(problem, first, ACCURACY.near)
        return family if isinstance(then, Point) and abs(then.tangent[-1]) < 0.1 * ENGINE.same else ""
    if np.any(first.orbit.neutral):
        aside = first.u.copy()
        aside[-1] += np.copysign(ACCURACY.near, middle - first.value)
        found = equations_at(problem, jnp.asarray(aside), first.modes, first.anchor)[2]
        held = np.trace(np.asarray(found.neutral)) < np.trace(first.orbit.neutral) - 0.5
        if np.all(found.good) and held:
            return "a place that is free at this value of the parameter is not at others"
    return ""


def _shortest(problem: Problem, point: Point) -> tuple[Problem, Point | Failure]:
    """The same orbit with the shortest period that it has, and what is followed then.

    Round twice, a doubling would be taken for a branch point: multipliers are squares of its own.
    """
    turns = int(point.orbit.repeats)
    if problem.forcing_period is not None:
        turns = math.gcd(turns, problem.multiple)
    if turns > 1:
        problem, shorter = _part(problem, point, turns)
        if isinstance(shorter, Failure):
            return problem, shorter
        point = shorter
    # Of numbers that `repeats` does not know: the orbit of a part of the period is tried.
    for turns in PRIMES:
        while problem.forcing_period is None or problem.multiple % turns == 0:
            less, shorter = _part(problem, point, turns)
            if isinstance(shorter, Failure) or not _same(point, shorter):
                break
            problem, point = less, shorter
    return problem, point


def _part(problem: Problem, point: Point, turns: int) -> tuple[Problem, Point | Failure]:
    """The orbit from the same state with a part of the period."""
    if problem.forcing_period is not None:
        problem = dataclasses.replace(problem, multiple=problem.multiple // turns)
    orbit = point.orbit
    once = OrbitGuess(orbit.y0, orbit.period / turns, orbit.mode0, orbit.t0)
    return problem, begin(problem, once, point.value)


def _same(one: Point, other: Point) -> bool:
    """Whether two orbits reach equally far in all components."""
    size = np.asarray(one.anchor.extent)
    ends = zip(*((p.orbit.lowest, p.orbit.highest) for p in (one, other)), strict=True)
    away = [np.abs(ravel_pytree(a)[0] - ravel_pytree(b)[0]) / size for a, b in ends]
    return bool(np.max(away) < ACCURACY.alike)
