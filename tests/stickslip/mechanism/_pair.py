"""Two coupled blocks under friction that weakens within a tiny speed, at random."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from stickslip.mechanism import AbstractMechanism

LOW = [0.5, 0.3, 0.0, 0.5, 0.3, 0.2, 0.3, -3.0, 0.2, -0.4, 0.0, 0.5]
HIGH = [2.0, 3.0, 2.5, 4.0, 2.0, 1.0, 1.0, 0.0, 1.0, 0.4, 0.8, 4.0]


class AbstractPair(AbstractMechanism):
    """Two coupled and driven blocks; their contacts are those of a subclass."""

    p: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": self.p[0]}

    def forces(self, t, q, v, args):
        _, coupling, push, rate, stiffness, *_ = self.p
        between = coupling * (q.y - q.x)
        return {
            "x": between - q.x + push * jnp.sin(rate * t),
            "y": -between - stiffness * q.y - 0.05 * v.y,
        }

    def time_scale(self, args):
        return 1.0 / jnp.maximum(self.p[3], self.p[11])


def random_pairs(number):
    """Parameters of so many, a row each; the Stribeck speed from 1 mm/s to 1 m/s."""
    p = np.random.default_rng(0).uniform(LOW, HIGH, (number, 12))
    p[:, 7] = 10 ** p[:, 7]
    return p
