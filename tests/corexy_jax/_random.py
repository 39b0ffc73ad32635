"""Machines and frictions drawn at random, for comparisons entry by entry."""

import jax.numpy as jnp
import numpy as np

from corexy_jax import CoreXYParameters, FrictionForces, PassivePulleys
from corexy_jax._parameters import TABLE_1


def machine(seed: int) -> CoreXYParameters:
    """All parameters 0.5 to 2 times those of Table 1, the friction arm different from the radius."""
    rng = np.random.default_rng(seed)
    values = {name: value * rng.uniform(0.5, 2.0) for name, value in TABLE_1.items()}
    return CoreXYParameters(**values, r_f=0.05 * rng.uniform(0.5, 2.0))


def frictions(seed: int) -> FrictionForces:
    """Thirteen unrelated numbers, so that every entry of a formula shows."""
    draw = np.random.default_rng(seed + 1000).normal(size=14)
    return FrictionForces(
        jnp.asarray(draw[0]),
        jnp.asarray(draw[1]),
        PassivePulleys(*map(jnp.asarray, draw[2:10])),
        *map(jnp.asarray, draw[10:14]),
    )
