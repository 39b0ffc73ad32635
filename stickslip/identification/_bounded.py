r"""Steps of a linear model in the values, in the coordinates of bounded unknowns.

The coordinate of a value with the bound 0 is its logarithm, so a value that belongs at its bound has a
coordinate that goes to minus infinity, with a column of the Jacobian that vanishes: damping in such
coordinates creeps. Here the coordinates stay, and the steps are those of the values: a step $d$ of the
linear model in $z$ moves the value by $d\,\mathrm{d}p/\mathrm{d}z$, but leaves at least a part of its
distance to a bound, and at most so many times it: what is hardly seen yet would go too far. The term
that the map adds to the second derivative, $g_i p''_i/p'_i$ where it is positive, parts an unknown that
goes to its bound from the others. Both as in T. F. Coleman and Y. Li, An interior trust region approach
for nonlinear minimization subject to bounds, SIAM J. Optim. 6 (1996) 418."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from ._accuracy import ACCURACY
from ._unknowns import Space


class Kinds(NamedTuple):
    """Which coordinates belong to values with a bound, and which to values between two."""

    bounded: Bool[Array, " unknown"]
    between: Bool[Array, " unknown"]


def kinds_of(space: Space | None, count: int) -> Kinds:
    """Map of the unknowns of a space; what comes behind them is open, and all is without a space."""
    ends = [] if space is None else [(low is not None, high is not None) for low, high in space.bounds]
    ends += [(False, False)] * (count - len(ends))
    return Kinds(jnp.array([a or b for a, b in ends]), jnp.array([a and b for a, b in ends]))


def _part(kinds: Kinds, z: Any) -> Any:
    """Place between two bounds, from 0 to 1; 0 for others."""
    return jnp.where(kinds.between, jax.nn.sigmoid(z), 0.0)


def curvature(kinds: Kinds, z: Any, gradient: Any) -> Any:
    """Term that the map of the coordinates adds to the second derivatives, where it is positive."""
    bend = jnp.where(kinds.bounded, 1.0 - 2.0 * _part(kinds, z), 0.0)
    return jnp.maximum(bend * gradient, 0.0)


def within(kinds: Kinds, z: Any, step: Any) -> Any:
    """The linear step, as far as the bounds let it go."""
    s = _part(kinds, z)
    down = jnp.where(kinds.bounded, (ACCURACY.left_to_bound - 1.0) / (1.0 - s), -jnp.inf)
    to_upper = (1.0 - ACCURACY.left_to_bound) / jnp.where(kinds.between, s, 1.0)
    up = jnp.where(kinds.between, to_upper, ACCURACY.away_from_bound - 1.0)
    up = jnp.where(kinds.bounded, up, jnp.inf)
    return jnp.clip(step, down, up)


def coordinates_after(kinds: Kinds, z: Any, step: Any) -> Any:
    """Coordinates of the values after such a step."""
    s = _part(kinds, z)
    step_in = jnp.where(kinds.bounded, step, 0.0)
    bent = z + jnp.log1p((1.0 - s) * step_in) - jnp.log1p(-s * step_in)
    return jnp.where(kinds.bounded, bent, z + step)
