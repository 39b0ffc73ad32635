"""Zeros of functions where the equations of the orbit are singular: found from orbits on both sides."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import brentq

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem, equations_at, orbit_at
from ._family import Failure
from ._point import Point, correct

# Orbits at these numbers of widths around the zero.
NODES = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])


def zero_beside(
    problem: Problem, before: Point, after: Point, test: Callable[[Point], float]
) -> Point | Failure:
    """The point between two others where a function is zero.

    Where two branches cross Newton's method has no step: at the point itself, and near it, it ends on
    either branch. So nothing is solved there. Orbits at a safe distance on both sides are, from the
    cubic through the ends; the zero is that of the polynomial through their values, and its orbit is
    on the polynomial through these orbits.
    """
    chord = after.u - before.u
    length = float(np.linalg.norm(chord))
    one, two = (p.tangent * length for p in (before, after))

    def cubic(x: float) -> tuple[np.ndarray, np.ndarray]:
        """State on the way between the ends, and its direction there."""
        a, b = one + two - 2.0 * chord, 3.0 * chord - 2.0 * one - two
        way = one + x * (2.0 * b + 3.0 * a * x)
        return before.u + x * (one + x * (b + a * x)), way / np.linalg.norm(way)

    known: dict[float, Point | Failure] = {0.0: before, 1.0: after}

    def at(x: float) -> Point | Failure:
        if x not in known:
            there, way = cubic(x)
            found = correct(problem, there, before.modes, before.anchor, way, way)
            if isinstance(found, Point) and (
                found.sequence != before.sequence
                or np.linalg.norm(found.u - there) > 0.5 * ACCURACY.swerves * length
            ):
                found = Failure("not_converged")
            known[x] = found
        return known[x]

    ends = test(before), test(after)
    root, why = ends[0] / (ends[0] - ends[1]), Failure("not_converged")
    for width in ACCURACY.widths:
        middle = root
        for _ in range(ACCURACY.few):
            nodes = middle + width * NODES
            points = [at(float(x)) for x in nodes]
            good = [p for p in points if isinstance(p, Point)]
            if len(good) < len(points):
                why = next(p for p in points if isinstance(p, Failure))
                break
            values = np.array([test(p) for p in good])
            zeros = [_zero(nodes[part], values[part]) for part in (slice(None), slice(1, 5))]
            if zeros[0] is None or zeros[1] is None:
                why = Failure("the function jumps there")
                break
            middle, moved = zeros[0], abs(zeros[0] - middle)
            # The zero was not between the inner orbits: they are placed anew around it.
            if moved > 0.5 * width:
                continue
            # The orbits reach beyond both ends, where the zero of another step may lie.
            if abs(zeros[0] - zeros[1]) > ENGINE.same or not 0.0 <= zeros[0] <= 1.0:
                break
            return _on(problem, before, nodes, good, zeros[0])
    return why


def _zero(nodes: np.ndarray, values: np.ndarray) -> float | None:
    """Zero of the polynomial through values that change their sign once."""
    changes = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    if changes.size != 1:
        return None
    k = int(changes[0])
    curve = BarycentricInterpolator(nodes, values)
    root: Any = brentq(lambda x: float(curve(x)), nodes[k], nodes[k + 1], xtol=1e-15)
    return float(root)


def _on(
    problem: Problem, before: Point, nodes: np.ndarray, points: list[Point], x: float
) -> Point | Failure:
    """The orbit of the polynomial through orbits, as it is."""
    u = np.asarray(BarycentricInterpolator(nodes, np.stack([p.u for p in points]))(x))
    tangent = np.asarray(BarycentricInterpolator(nodes, np.stack([p.tangent for p in points]))(x))
    modes = points[2].modes
    found = jax.device_get(equations_at(problem, jnp.asarray(u), modes, before.anchor))
    residual, jacobian, closing = found
    if not (np.all(closing.good) and np.max(np.abs(residual)) <= ENGINE.zero):
        return Failure("not_converged")
    orbit = orbit_at(problem, u, jnp.asarray(modes), before.anchor, found)
    if not bool(orbit.successful):
        return Failure(str(orbit.result))
    values = u[-len(problem.names) :] * np.asarray(problem.unit)
    return dataclasses.replace(
        points[2], u=u, modes=modes, tangent=tangent / np.linalg.norm(tangent), jacobian=jacobian,
        orbit=orbit, values=values,
    )  # fmt: skip
