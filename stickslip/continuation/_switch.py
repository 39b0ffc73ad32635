"""From a period doubling to the branch of doubled orbits that begins there."""

import jax.numpy as jnp
import numpy as np

from ._along import Problem, anchored
from ._follow import Failure, Point, correct, turned
from ._orbit import PeriodicOrbit

# First amplitudes of the doubled orbit that are tried, in parts of the motion's size.
AMPLITUDES = (1e-2, 3e-3, 3e-2, 1e-3)


def doubled(problem: Problem, orbit: PeriodicOrbit, value: float) -> Point | Failure:
    r"""An orbit of twice the period near one with the multiplier -1, and the way on from there.

    In the direction of the eigenvector of -1 the doubled branch begins across the other one: there the
    parameter changes with the square of the amplitude. The amplitude is therefore given, and the
    parameter found, on whichever side the doubled orbits are.
    """
    period = 2.0 * float(orbit.period)
    phase = jnp.asarray(float(orbit.t0) / period % 1.0)
    anchor, u, modes = anchored(
        problem, jnp.asarray(value), orbit.y0, orbit.mode0, phase, jnp.asarray(period), 0.0
    )
    u, size = np.asarray(u), np.asarray(anchor.size)
    values, vectors = np.linalg.eig(np.asarray(orbit.monodromy) * size[None, :] / size[:, None])
    vector = np.real(vectors[:, int(np.argmin(np.abs(values + 1.0)))])
    along = np.zeros(u.size)
    along[: size.size] = vector / np.linalg.norm(vector)
    found: Point | Failure = Failure("not_converged")
    for amplitude in AMPLITUDES:
        found = correct(problem, u + amplitude * along, modes, anchor, along, along)
        # An orbit that repeats itself within the period is the old one.
        if isinstance(found, Point) and int(found.orbit.repeats) == 1:
            return found if found.tangent @ along > 0 else turned(found)
    return found if isinstance(found, Failure) else Failure("not_converged")
