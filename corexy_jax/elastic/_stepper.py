"""Stepper motors: torque by the angle that they lag behind their command, and the steps they lose."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from stickslip.checks import (
    Given,
    Numeric,
    as_parameter,
    check_callable,
    check_handed_on,
    check_nonnegative,
    check_positive,
    refusal,
    whole_number,
)

from .._arguments import finite, pair


class Stepper(eqx.Module):
    r"""Two stepper motors that are commanded along a path.

    Each turns in a magnetic field that repeats $N$ times a turn, $N$ a quarter of the full steps:

    $$\tau_i = -T_m \sin N(\theta_i - \theta_i^c) - T_d \sin 4N\theta_i - d\,\dot\theta_i, \qquad
      r\theta_1^c = x^c + y^c,\ r\theta_2^c = x^c - y^c$$

    Under a steady load $\tau$ it lags by $\arcsin(\tau/T_m)/N$. Beyond $T_m$ it falls out of step, and
    catches the field again four full steps, or a multiple of them, away. Running at $\dot\theta$ it has
    $T_m - d\,\dot\theta$ left, and none at the speed $T_m/d$.

    **Arguments**

    - `path(t, args) -> ((x, y), (vx, vy))`: where the collar is commanded to be [m], and its speed
      [m/s], which is not used; an `InputShaper` of `stickslip.control` is one.
    - `torque` $T_m$ [N m], positive: that of the current; `r` [m]: radius of the pulleys.
    - `detent` $T_d$ [N m], `damping` $d$ [N m s/rad], not negative; `steps` for a turn, a multiple of
      4.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    path: Callable
    torque: Float[Array, "..."]
    r: Float[Array, "..."]
    detent: Float[Array, "..."]
    damping: Float[Array, "..."]
    steps: int = eqx.field(static=True)

    def __init__(
        self,
        path: Given[Callable],
        torque: Numeric,
        r: Numeric,
        *,
        detent: Numeric = 0.0,
        damping: Numeric = 0.0,
        steps: int = 200,
    ):
        self.path = check_callable("path", path, "path(t, args)", 0.0, None)
        self.torque = as_parameter(check_positive("torque", torque))
        self.r = as_parameter(check_positive("r", r))
        self.detent = as_parameter(check_nonnegative("detent", detent))
        self.damping = as_parameter(check_nonnegative("damping", damping))
        self.steps = whole_number("steps", steps, 4, 40_000)
        if steps % 4:
            raise refusal("steps", steps, "a multiple of 4")

    @property
    def periods(self) -> int:
        """Periods $N$ of the field in a turn."""
        return self.steps // 4

    @property
    def stiffness(self) -> Any:
        """Torque by the angle [N m/rad] at the command, without detent torque."""
        return self.periods * self.torque

    def angles(self, t: Numeric, args: PyTree = None) -> tuple[Any, Any]:
        """Commanded angles [rad] at time `t` [s]."""
        (x, y), _ = self.path(*finite(t=t), check_handed_on("args", args))
        return (x + y) / self.r, (x - y) / self.r

    def lags(self, t: Numeric, angles: tuple[Any, Any], args: PyTree = None) -> tuple[Any, Any]:
        """How far the motors are behind their command [rad]."""
        angles, (one, two) = pair("angles", angles), self.angles(t, args)
        return one - angles[0], two - angles[1]

    def lost_steps(self, t: Numeric, angles: tuple[Any, Any], args: PyTree = None) -> tuple[Any, Any]:
        """Full steps that the motors have lost until now, multiples of 4, those gained negative."""
        turn = self.periods / (2.0 * jnp.pi)
        one, two = (4.0 * jnp.round(turn * lag) for lag in self.lags(t, angles, args))
        return one, two

    def __call__(self, t: Numeric, angles: tuple, speeds: tuple, args: PyTree) -> tuple[Any, Any]:
        """Torques of both motors [N m]."""
        N = self.periods
        one, two = (
            self.torque * jnp.sin(N * lag) - self.detent * jnp.sin(4 * N * angle) - self.damping * speed
            for lag, angle, speed in zip(self.lags(t, angles, args), angles, speeds, strict=True)
        )
        return one, two
