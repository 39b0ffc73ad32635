"""Block on a moving belt, held by a spring, with Coulomb friction."""

from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip._fastmath import where
from stickslip._looks_at import OBSERVABLE, looks_at, modes, reals, state
from stickslip._types import Whole
from stickslip._validation import as_parameter, check_finite, check_nonnegative, check_positive
from stickslip.systems._mechanical import (
    SLIP_MODES,
    AbstractMechanicalSystem,
    Motion,
    Number,
    contact_mode,
    holding_force,
    mode_at_rest,
    slip_sense,
)


class CoulombOscillator(AbstractMechanicalSystem):
    r"""Stick-slip oscillator: mass and spring on a belt, Coulomb friction between block and belt.

    $$m\ddot x + kx = T, \qquad
      T = \begin{cases} +F_k & \dot x < v_b \\ kx,\ |kx| \le F & \dot x = v_b \\
      -F_k & \dot x > v_b \end{cases} \qquad F = \max(F_s, F_k)$$

    - State `Motion`: `x` [m] from the unloaded spring, `v` [m/s]; both against the ground.
    - Modes: `"slip backward"` (slower than the belt), `"stick"` (with the belt), `"slip forward"`
      (faster than the belt).
    - One guard. In stick: distance of the spring force to the limit that the belt is driving it to,
      the other limit recedes [N]. In slip: relative speed times $\sqrt{km}$, so that it is in newtons
      too, and has one magnitude.
    - At rest with $F_s < F_k$ the threshold is $F_k$ (sliding mode of Filippov).
    - In every mode the motion is harmonic or uniform, so that all of it has a closed form. Started
      in stick, with $F_k \le F_s$ and $D = (F_s - F_k)/k$, $\omega^2 = k/m$, it has the period
      $2D/v_b + 2(\pi - \arctan(D\omega/v_b))/\omega$.

    **Arguments:**

    - `mass` $m$ [kg] and `stiffness` $k$ [N/m], positive.
    - `static_force` $F_s$ and `kinetic_force` $F_k$ [N], not negative.
    - `belt_speed` $v_b$ [m/s], of either sign; 0 is an oscillator on rough ground.

    ??? cite "Reference"

        K. Popp, N. Hinrichs, M. Oestreich, "Analysis of a self-excited friction oscillator with
        external excitation", in *Dynamics with Friction*, World Scientific, 1996.
    """

    mass: Float[Array, "..."]
    stiffness: Float[Array, "..."]
    static_force: Float[Array, "..."]
    kinetic_force: Float[Array, "..."]
    belt_speed: Float[Array, "..."]

    mode_names: ClassVar = SLIP_MODES
    guard_names: ClassVar = ("friction reaches its limit, or the block the speed of the belt",)
    units: ClassVar = {"x": "m", "v": "m/s"}

    def __init__(
        self,
        mass: Number,
        stiffness: Number,
        static_force: Number,
        kinetic_force: Number,
        belt_speed: Number,
    ):
        self.mass = as_parameter(check_positive("mass", mass))
        self.stiffness = as_parameter(check_positive("stiffness", stiffness))
        self.static_force = as_parameter(check_nonnegative("static_force", static_force))
        self.kinetic_force = as_parameter(check_nonnegative("kinetic_force", kinetic_force))
        self.belt_speed = as_parameter(check_finite("belt_speed", belt_speed))

    @looks_at(y=state, mode=modes)
    def friction(self, y: Motion, mode: Whole) -> Any:
        """Force of the belt on the block [N]."""
        return where(mode == 1, self.stiffness * y.x, -slip_sense(mode) * self.kinetic_force)

    def vector_field(self, t, y, mode, args):
        slip = -slip_sense(mode) * self.kinetic_force - self.stiffness * y.x
        return Motion(x=y.v, v=where(mode == 1, 0.0, slip / self.mass))

    def guards(self, t, y, mode, args):
        limit = holding_force(self.static_force, self.kinetic_force)
        reserve = limit - jnp.sign(self.belt_speed) * self.stiffness * y.x
        speed = slip_sense(mode) * (y.v - self.belt_speed)
        return (where(mode == 1, reserve, jnp.sqrt(self.stiffness * self.mass) * speed),)

    @property
    def guard_scales(self) -> tuple:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The largest friction force, or what stops the speed of the belt in a quarter period [N]."""
        inertia = jnp.sqrt(self.stiffness * self.mass) * jnp.abs(self.belt_speed)
        scale = jnp.maximum(jnp.maximum(self.static_force, self.kinetic_force), inertia)
        return (where(scale > 0.0, scale, 1.0),)

    def transition(self, t, y, mode, guard, args):
        limit = holding_force(self.static_force, self.kinetic_force)
        load = -self.stiffness * y.x
        onset = where(load > 0.0, 2, 0)
        mode = where(mode == 1, onset, mode_at_rest(load, limit))
        return Motion(x=y.x, v=self.belt_speed), mode

    @looks_at(t=reals, y=state)
    def initial_mode(self, t, y, args):
        limit = holding_force(self.static_force, self.kinetic_force)
        return contact_mode(y.v - self.belt_speed, -self.stiffness * y.x, limit)

    @looks_at(y=state)
    def energy(self, y):
        """Kinetic energy and energy of the spring [J]."""
        return 0.5 * (self.mass * y.v**2 + self.stiffness * y.x**2)

    @looks_at(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """`belt`: work of the drive; `friction`: loss in the contact [W]."""
        friction = self.friction(y, mode)
        return {
            "belt": friction * self.belt_speed,
            "friction": friction * (y.v - self.belt_speed),
        }
