"""Stepper motors: torque by the angle that they lag behind their command, and the steps they lose."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from stickslip import AbstractSystemWrapper, Section
from stickslip.checks import (
    Given,
    Numeric,
    as_parameter,
    check_callable,
    check_handed_on,
    check_nonnegative,
    check_positive,
    check_type,
    refusal,
    whole_number,
)

from .._arguments import finite, pair
from ._winding import Winding


def _half_angles(system: Any, t: Any, y: PyTree, args: PyTree) -> list[Any]:
    r"""$\cos\frac12N(\theta^c - \theta)$ of both motors, 0 halfway between two rests."""
    while isinstance(system, AbstractSystemWrapper):
        y, args = system.inner(y, args)
        system = system.system
    drive, turn = system.drive, 1.0 / system.parameters.r
    lags = drive.lags(t, (y.one * turn, y.two * turn), args)
    return [jnp.cos(0.5 * drive.periods * lag) for lag in lags]


def _half_angle_1(system: Any, t: Any, y: PyTree, dy: PyTree, mode: Any, args: PyTree) -> Any:
    return _half_angles(system, t, y, args)[0]


def _half_angle_2(system: Any, t: Any, y: PyTree, dy: PyTree, mode: Any, args: PyTree) -> Any:
    return _half_angles(system, t, y, args)[1]


class Stepper(eqx.Module):
    r"""Two stepper motors that are commanded along a path.

    Each turns in a magnetic field that repeats $N$ times a turn, $N$ a quarter of the full steps:

    $$\tau_i = -T\sin N(\theta_i - \theta_i^c) - T_d \sin 4N\theta_i - d\,\dot\theta_i, \qquad
      r\theta_1^c = x^c + y^c,\ r\theta_2^c = x^c - y^c$$

    with $T = T_m$, or by the speed of the motor as its `Winding` has it. Under a steady load $\tau$ it
    lags by $\arcsin(\tau/T)/N$, and vibrates about that with the stiffness $N\sqrt{T^2 - \tau^2}$.
    Beyond $T$ it falls out of step, and catches the field again four full steps, or a multiple of them,
    away: events in `solution.crossings` of a run that is given its `sections`. Running at $\dot\theta$
    it has $T - d\,\dot\theta$ left. Currents are taken to follow at once, in the direction of the
    command.

    **Arguments**

    - `path(t, args) -> ((x, y), (vx, vy))`: where the collar is commanded to be [m], and its speed
      [m/s], which is not used; an `InputShaper` of `stickslip.control` is one.
    - `torque` $T_m$ [N m], positive: that of the current; `r` [m]: radius of the pulleys.
    - `detent` $T_d$ [N m], `damping` $d$ [N m s/rad], not negative; `steps` for a turn, a multiple of
      4. `winding`: a `Winding`, by default one whose voltage suffices at every speed.

    **Raises** `TypeError`, `ValueError` naming the argument.
    """

    path: Callable
    torque: Float[Array, "..."]
    r: Float[Array, "..."]
    detent: Float[Array, "..."]
    damping: Float[Array, "..."]
    winding: Winding | None
    steps: int = eqx.field(static=True)

    def __init__(
        self,
        path: Given[Callable],
        torque: Numeric,
        r: Numeric,
        *,
        detent: Numeric = 0.0,
        damping: Numeric = 0.0,
        winding: Given[Winding | None] = None,
        steps: int = 200,
    ):
        self.path = check_callable("path", path, "path(t, args)", 0.0, None)
        self.torque = as_parameter(check_positive("torque", torque))
        self.r = as_parameter(check_positive("r", r))
        self.detent = as_parameter(check_nonnegative("detent", detent))
        self.damping = as_parameter(check_nonnegative("damping", damping))
        self.winding = check_type("winding", winding, Winding | None, "a Winding or None")
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

    @property
    def sections(self) -> tuple[Section, Section]:
        """Losses of four full steps by either motor, for `SaveAt(sections=...)` of an `ElasticCoreXY`
        that it drives: where a lag passes half a period of the field, either way."""
        return (
            Section(_half_angle_1, "both", name="motor 1 loses four steps"),
            Section(_half_angle_2, "both", name="motor 2 loses four steps"),
        )

    def pull_out(self, speed: Numeric) -> Any:
        """Greatest torque $T$ of the field [N m] at a speed of the motor [rad/s]."""
        (speed,) = finite(speed=speed)
        if self.winding is None:
            return self.torque
        return self.winding.pull_out(self.torque, self.periods, speed)

    def angles(self, t: Numeric, args: PyTree = None) -> tuple[Any, Any]:
        """Commanded angles [rad] at time `t` [s]."""
        (x, y), _ = self.path(*finite(t=t), check_handed_on("args", args))
        return (x + y) / self.r, (x - y) / self.r

    def lags(self, t: Numeric, angles: tuple[Any, Any], args: PyTree = None) -> tuple[Any, Any]:
        """How far the motors are behind their command [rad]."""
        angles, (one, two) = pair("angles", angles), self.angles(t, args)
        return one - angles[0], two - angles[1]

    def margin(self, t: Numeric, angles: tuple[Any, Any], args: PyTree = None) -> tuple[Any, Any]:
        r"""Shares of the angle of pull-out that are left, $1 - 2N|\theta^c - \theta|/\pi$.

        1 at the command, 0 a quarter of a period behind it or before it, where the torque is $T$, and
        negative beyond. A share $s$ of the angle leaves $1 - \cos\frac\pi2s$ of the torque. Outputs of
        a run are mapped over, `jax.vmap(stepper.margin)(t, angles)`.
        """
        share = 2.0 * self.periods / jnp.pi
        one, two = (1.0 - share * jnp.abs(lag) for lag in self.lags(t, angles, args))
        return one, two

    def lost_steps(self, t: Numeric, angles: tuple[Any, Any], args: PyTree = None) -> tuple[Any, Any]:
        """Full steps that the motors have lost until now, multiples of 4, those gained negative."""
        turn = self.periods / (2.0 * jnp.pi)
        one, two = (4.0 * jnp.round(turn * lag) for lag in self.lags(t, angles, args))
        return one, two

    def __call__(self, t: Numeric, angles: tuple, speeds: tuple, args: PyTree) -> tuple[Any, Any]:
        """Torques of both motors [N m]."""
        N = self.periods
        one, two = (
            self.pull_out(speed) * jnp.sin(N * lag)
            - self.detent * jnp.sin(4 * N * angle)
            - self.damping * speed
            for lag, angle, speed in zip(self.lags(t, angles, args), angles, speeds, strict=True)
        )
        return one, two
