"""An input shaper for each axis of the head."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from stickslip.checks import Given, Numeric, check_type
from stickslip.control import InputShaper


class AxisShapers(eqx.Module):
    """Two shapers of one path, as firmware has them: the head's `x` by the one, its `y` by the other.

    A path itself, `path(t, args) -> ((x, y), (vx, vy))`. `times` [s] are those of all parts, for
    `Trajectory.breaks`. **Arguments:** `x`, `y`: each an `InputShaper` of the path. **Raises**
    `TypeError` naming the argument.
    """

    x: InputShaper
    y: InputShaper

    def __init__(self, x: Given[InputShaper], y: Given[InputShaper]):
        self.x = check_type("x", x, InputShaper, "an InputShaper")
        self.y = check_type("y", y, InputShaper, "an InputShaper")

    @property
    def times(self) -> Float[Array, " part"]:
        """When the parts of both come [s]."""
        return jnp.concatenate([self.x.times, self.y.times])

    def __call__(self, t: Numeric, args: PyTree) -> tuple[Any, Any]:
        """Position [m] and velocity [m/s] at time `t` [s]."""
        (x, _), (vx, _) = self.x(t, args)
        (_, y), (_, vy) = self.y(t, args)
        return (x, y), (vx, vy)
