"""From a special point to the other branch that begins or crosses there."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from ..hybrid import SaveAt, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem, anchor_at, equations_at, system_at
from ._equilibrium import Equilibrium
from ._family import Failure
from ._guess import OrbitGuess
from ._orbit import PeriodicOrbit
from ._point import Point, ahead, begin, correct, leaps
from ._points import doubling
from ._rest import scales_of
from ._turns import apart, turns_of


def doubled_orbit(problem: Problem, orbit: PeriodicOrbit, value: float) -> Point | Failure:
    r"""An orbit of twice the period near one with the multiplier -1, and the way on from there.

    Round twice the orbit is a branch point: the derivative takes a plane to zero. One direction in it
    is that of the orbit's own branch; the other, without change of the parameter, of doubled orbits.
    Along it the parameter changes with the square of the amplitude. The amplitude, across the orbit's
    own branch, is therefore given, and the parameter found, on whichever side doubled orbits are.
    """
    period = 2.0 * float(orbit.period)
    phase = jnp.asarray(float(orbit.t0) / period % 1.0)
    anchor, u, modes = anchor_at(
        problem, jnp.asarray([value]), orbit.y0, orbit.mode0, phase, jnp.asarray(period)
    )
    u, states = np.asarray(u), np.asarray(anchor.size).size
    _, jacobian, _ = jax.device_get(equations_at(problem, jnp.asarray(u), modes, anchor))
    if not np.all(np.isfinite(jacobian)):
        return Failure("guess_failed")
    one, two = np.linalg.svd(jacobian)[2][-2:]
    along = two[-1] * one - one[-1] * two
    knots = along[: problem.segments * states].reshape(problem.segments, states)
    along /= np.linalg.norm(knots, axis=1).max()
    own = one[-1] * one + two[-1] * two
    across = along - (along @ own) / (own @ own) * own
    found: Point | Failure = Failure("not_converged")
    for amplitude in ACCURACY.near * np.array(ACCURACY.amplitudes):
        found = correct(problem, u + amplitude * along, modes, anchor, across, along)
        # An orbit that repeats itself within the period is the old one.
        if isinstance(found, Point) and int(found.orbit.repeats) == 1:
            return found if found.tangent @ along > 0 else found.backward()
    return found if isinstance(found, Failure) else Failure("not_converged")


def birth(problem: Problem, before: Point, after: Point, distance: float) -> Point | None:
    """The orbit that a branch doubles, where it meets it between two of its own; None if it does not.

    Beyond it the branch is its own mirror image, the same orbits half a period later: there the
    parameter turns, and what half a period changes about the state changes its sign. At the point
    itself the derivative is singular; of the shorter orbit it is not, and its doubling is located.
    """
    if before.tangent[-1] * after.tangent[-1] > 0.0:
        return None
    change, other = _half_a_period(problem, before), _half_a_period(problem, after)
    if not change @ other < -0.5 * np.linalg.norm(change) * np.linalg.norm(other):
        return None
    near = [(np.linalg.norm(change), before), (np.linalg.norm(other), after)]
    low, high = 0.0, distance
    for _ in range(ACCURACY.few):
        middle = 0.5 * (low + high)
        found = ahead(problem, before, middle)
        if isinstance(found, Failure) or leaps(before, found, middle):
            break
        now = _half_a_period(problem, found)
        near.append((np.linalg.norm(now), found))
        low, high = (middle, high) if change @ now > 0.0 else (low, middle)
    for _, point in sorted(near, key=lambda pair: pair[0]):
        shorter = _doubling(problem, point)
        if shorter is not None:
            return shorter
    return min(near, key=lambda pair: pair[0])[1]


def _doubling(problem: Problem, point: Point) -> Point | None:
    """The doubling of the orbit of half the period near a point; None where there is none."""
    orbit = point.orbit
    if problem.forcing_period is not None:
        if problem.multiple % 2:
            return None
        problem = dataclasses.replace(problem, multiple=problem.multiple // 2)
    half = OrbitGuess(orbit.y0, 0.5 * orbit.period, orbit.mode0, orbit.t0)
    found, step = begin(problem, half, point.value), ACCURACY.little
    if isinstance(found, Failure):
        return None
    value, at = doubling(found), 0.0
    start, best = found, found
    for _ in range(ACCURACY.tries):
        new = ahead(problem, start, at + step)
        if isinstance(new, Failure) or new.sequence != start.sequence:
            return None
        slope = (doubling(new) - value) / step
        value, at, best = doubling(new), at + step, new
        if value == 0.0 or abs(step) <= ENGINE.slack:
            return best
        step = -value / slope if slope != 0.0 else np.inf
        if not abs(at + step) <= ACCURACY.swerves:
            return None
    return None


def _half_a_period(problem: Problem, point: Point) -> np.ndarray:
    """Change of the state in half a period, in parts of the motion's size; NaN if it fails."""
    orbit = point.orbit
    half = simulate(
        system_at(problem, point.values), orbit.t0, orbit.t0 + 0.5 * orbit.period, orbit.y0,
        orbit.mode0, problem.args, integrator=problem.integrator, saveat=SaveAt(max_events=None),
        throw=False,
    )  # fmt: skip
    away = ravel_pytree(half.y1)[0] - ravel_pytree(orbit.y0)[0]
    away = apart(away, jnp.asarray(orbit.neutral), turns_of(problem.system, orbit.y0))
    return np.asarray(jnp.where(half.successful, away / jnp.asarray(point.anchor.extent), jnp.nan))


def orbit_at_hopf(problem: Problem, rest: Equilibrium, value: float) -> Point | Failure:
    """A small orbit near a Hopf point, and the way on from there.

    As at a doubling the parameter changes with the square of the amplitude, so that the amplitude is
    given, and the parameter found. It is first tried where the field is hardly nonlinear, whatever the
    units. An orbit far from the point, by its parameter or period, is too large or of another family.
    """
    flat, unravel = ravel_pytree(rest.y)
    flat, found = np.asarray(flat, float), Failure("not_converged")
    ellipse, least = _small_ellipse(problem, rest, value)
    parts, smaller = list(ACCURACY.amplitudes), 0
    while parts:
        part = parts.pop(0)
        if part < least:
            continue
        swing = part * ellipse
        anchor, u, modes = anchor_at(
            problem, jnp.asarray([value]), unravel(jnp.asarray(flat + swing)),
            jnp.asarray(rest.mode, jnp.int32), jnp.zeros(()), jnp.asarray(rest.period),
        )  # fmt: skip
        u = np.asarray(u)
        along = np.zeros(u.size)
        along[: flat.size] = swing / np.asarray(anchor.size)
        along /= np.linalg.norm(along)
        new = correct(problem, u, modes, anchor, along, along)
        if isinstance(new, Failure):
            found = new
            continue
        away, late = _from_birth(problem, new, rest, value)
        if away <= ACCURACY.near and late <= ACCURACY.swerves:
            return new if new.tangent @ along > 0 else new.backward()
        if smaller < ACCURACY.few:
            smaller += 1
            parts.insert(0, 0.5 * part * min(0.5, np.sqrt(ACCURACY.near / max(away, ACCURACY.near))))
    return found


def _from_birth(problem: Problem, point: Point, rest: Equilibrium, value: float) -> tuple[float, float]:
    """How far an orbit is from a Hopf point, in parts of the bounds' distance and of the period."""
    away = abs(point.value - value) / float(np.asarray(problem.unit)[0])
    return away, abs(float(point.orbit.period) / float(rest.period) - 1.0)


def _small_ellipse(problem: Problem, rest: Equilibrium, value: float) -> tuple[np.ndarray, float]:
    r"""Start, from the equilibrium, of the largest linear orbit that is nearly one of the field.

    The linear orbit of $\dot w = J w$ with $J^2 w = -\omega^2 w$ begins with the swing. The difference
    of the field from the linear one, in parts of that, grows with the amplitude, and by rounding with
    ever smaller ones. The part of it from which on it does is the other number.
    """
    flat, unravel = ravel_pytree(rest.y)
    system = system_at(problem, [value])

    def field(flat):
        rates = system.vector_field(0.0, unravel(flat), jnp.asarray(rest.mode), problem.args)
        return ravel_pytree(rates)[0]

    jacobian = np.asarray(jax.jacfwd(field)(jnp.asarray(flat)))
    swing = np.asarray(rest.swing)
    other = jacobian @ swing * rest.period / (2.0 * np.pi)
    angles = np.linspace(0.0, 2.0 * np.pi, ACCURACY.around, endpoint=False)[:, None]
    ways = np.cos(angles) * swing + np.sin(angles) * other
    rates = ways @ jacobian.T
    whole = np.max(np.abs(rates), axis=0)
    parts = whole * scales_of(jacobian)[0]
    taken = parts > ENGINE.zero * np.max(parts)  # the others do not take part in this motion
    sizes = 10.0 ** np.arange(ACCURACY.tries, -ACCURACY.tries, -0.5)[:, None, None]
    states = jnp.asarray(np.asarray(flat) + sizes * ways)
    off = np.asarray(jax.vmap(jax.vmap(field))(states)) - np.asarray(field(jnp.asarray(flat)))
    off -= sizes * rates
    part = np.max(np.abs(off[:, :, taken]) / (sizes * whole[taken]), axis=(1, 2))
    good = np.flatnonzero(part <= ACCURACY.near)
    if not good.size or good[0] == 0:  # a linear field has orbits of any size
        return swing * (np.linalg.norm(flat) or 1.0) * ACCURACY.near, 0.0
    size = sizes[good[0], 0, 0]
    return size * swing, float(sizes[int(np.nanargmin(part)), 0, 0] / size)


def outward(problem: Problem, point: Point, slope: np.ndarray) -> Point:
    """The same orbit, with the branch followed as its `slope` at the end says."""
    known = _in_parts(problem, point, slope)
    states, free = np.asarray(point.anchor.size).size, 1 + (problem.forcing_period is None)
    own = np.append(point.tangent[:states], point.tangent[-free:])
    return point if own @ known >= 0 else point.backward()


def _in_parts(problem: Problem, point: Point, slope: np.ndarray) -> np.ndarray:
    """The slope of a special point in parts of the sizes that a point is measured by."""
    scales = [np.asarray(point.anchor.size)]
    if problem.forcing_period is None:
        scales.append(np.asarray([float(point.anchor.period)]))
    scales.append(np.asarray(problem.unit))
    return slope / np.concatenate(scales)


def crossing(problem: Problem, orbit: PeriodicOrbit, value: float, slope: np.ndarray):
    """Both ends of the branch that crosses another one at an orbit, from beside this one.

    There the Jacobian takes a plane to zero. One direction in it is that of the branch which is known,
    whose `slope` is that of its first point, period if it is free, and parameter. Across it lies the
    other branch.
    """
    found = begin(problem, orbit, value)
    if isinstance(found, Failure):
        return found, found
    anchor, states = found.anchor, np.asarray(found.anchor.size).size
    known = _in_parts(problem, found, slope)
    plane = np.linalg.svd(found.jacobian)[2][-2:]
    free = known.size - states
    # The states at further knots follow from the first one.
    parts = np.concatenate([plane[:, :states], plane[:, -free:]], axis=1)
    one, two = np.linalg.lstsq(parts.T, known, rcond=None)[0]
    across = np.array([-two, one]) / np.hypot(one, two) @ plane
    ends: list[Point | Failure] = []
    for way in (across, -across):
        new: Point | Failure = Failure("not_converged")
        for amplitude in ACCURACY.near * np.array(ACCURACY.amplitudes):
            new = correct(problem, found.u + amplitude * way, found.modes, anchor, way, way)
            if isinstance(new, Point):
                new = dataclasses.replace(new, tangent=new.tangent * np.sign(new.tangent @ way))
                break
        ends.append(new)
    return ends[0], ends[1]
