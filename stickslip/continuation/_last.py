"""Ends of a branch of orbits: a Hopf point, or an orbit whose period grows without bound."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from ..hybrid.accuracy import ACCURACY as ENGINE
from ._accuracy import ACCURACY
from ._along import Problem
from ._equilibria import axis_pair
from ._point import Point
from ._rest import Field, Rest, equilibrium_at


def hopf_point(problem: Problem, point: Point) -> Point | None:
    """The equilibrium that an orbit without events has shrunk to, where a pair crosses the axis.

    As an orbit of no extent, whose period is that of the pair. None where there is none.
    """
    orbit = point.orbit
    if problem.forcing_period is not None or int(orbit.events.count):
        return None
    field = Field(problem.system, problem.names[0], orbit.t0, orbit.y0, orbit.mode0, problem.args)
    low, high = (np.asarray(ravel_pytree(tree)[0]) for tree in (orbit.lowest, orbit.highest))
    hold = np.append(np.zeros(low.size), 1.0)
    turn = 2.0 * np.pi / float(orbit.period)
    unit = float(np.asarray(problem.unit)[0])

    def rate(rest: Rest) -> float:
        """Growth of the pair that turns about as fast as the orbit."""
        found = rest.eigenvalues
        return float(np.real(found[np.argmin(np.abs(np.abs(np.imag(found)) - turn))]))

    def at(z: np.ndarray) -> Rest | None:
        return equilibrium_at(field, z, hold, hold, None)

    old = at(np.append(0.5 * (low + high), point.value))
    if old is None:
        return None
    new = at(old.z + np.append(np.zeros(low.size), ACCURACY.little * unit))
    for _ in range(ACCURACY.tries):
        if new is None or rate(new) == rate(old):
            break
        step = -rate(new) * (new.value - old.value) / (rate(new) - rate(old))
        if abs(step) <= ACCURACY.short * unit:
            break
        old, new = new, at(new.z + np.append(np.zeros(low.size), step))
    pair = None if new is None else axis_pair(new)
    if new is None or pair is None or not abs(rate(new)) <= ENGINE.zero * turn:
        return None
    period = 2.0 * np.pi / abs(new.eigenvalues[pair].imag)
    # Another pair may cross the axis nearby: the orbit turns as fast as its own.
    if abs(period / float(orbit.period) - 1.0) > ACCURACY.shrinks:
        return None
    y = jax.tree.map(np.asarray, field.unravel(jnp.asarray(new.z[:-1])))
    still = eqx.tree_at(
        lambda o: (o.y0, o.lowest, o.highest, o.period), orbit, (y, y, y, np.asarray(period))
    )
    return dataclasses.replace(point, orbit=still, values=new.z[-1:])


def endless(points: list[Point], unit: float) -> tuple[str, bool]:
    r"""Words for a branch whose period grows without bound, and whether nothing is left of it.

    Toward an orbit that is homoclinic to a saddle the parameter goes as $e^{-\lambda T}$, toward one
    on which two equilibria meet (SNIC) as $T^{-2}$: the rate by which the parameter changes with the
    period is a straight line over the period, or, with the slope -3, over both logarithms. The words
    are empty where the last doubling of the period follows neither, or it has not doubled yet.
    """
    period = np.array([float(p.orbit.period) for p in points])
    value = np.array([p.value for p in points])
    turns = np.flatnonzero(np.diff(period) <= 0.0)
    begin = int(turns[-1]) + 1 if turns.size else 0
    period, value = period[begin:], value[begin:]
    # Steps of the parameter that are more than its rounding.
    moved = np.abs(np.diff(value)) > ENGINE.slack * unit
    count = int(np.argmin(moved)) if not moved.all() else moved.size
    period, value, stopped = period[: count + 1], value[: count + 1], count < moved.size
    early = np.flatnonzero(period < period[-1] / ACCURACY.strays)
    if not early.size or period.size <= ACCURACY.few:
        return "", False
    begin = min(int(early[-1]) + 1, period.size - ACCURACY.few - 1)
    period, value = period[begin:], value[begin:]
    change = np.diff(value)
    if not (np.all(change > 0.0) or np.all(change < 0.0)):
        return "", False
    rate = np.log(np.abs(change / np.diff(period)))
    middle = 0.5 * (period[1:] + period[:-1])
    # Two laws, each a straight line in its own scales: the one that fits is what lies at the end.
    for kind, x in (("saddle", middle), ("SNIC", np.log(middle))):
        slope, start = np.polyfit(x, rate, 1)
        left = np.sqrt(np.mean((rate - slope * x - start) ** 2))
        if slope >= 0.0 or left > ACCURACY.near * np.ptp(rate):
            continue
        way = np.sign(change[-1]) * np.exp(slope * x[-1] + start)
        if kind == "saddle" and -slope * period[-1] > ACCURACY.steep:
            left = way / -slope * np.exp(slope * (period[-1] - middle[-1]))
            return _words("a saddle", value[-1] + left), stopped or bool(
                abs(left) <= ENGINE.same * unit
            )
        # The rate goes as the third power there: the parameter as the second.
        if kind == "SNIC" and abs(slope + 3.0) <= ACCURACY.swerves:
            left = 0.5 * way * middle[-1] ** 3 / period[-1] ** 2
            over = bool(abs(left) <= ENGINE.same * unit)
            return _words("a saddle-node, SNIC", value[-1] + left), over
    return "", False


def _words(kind: str, value: float) -> str:
    return f"homoclinic to {kind}: the period grows without bound toward {value:.10g}"
