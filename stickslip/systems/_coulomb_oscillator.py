"""Block on a moving belt, held by a spring, with Coulomb friction."""

from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip._argument_checks import OBSERVABLE, check_arguments, modes, parameters, state
from stickslip._fastmath import where
from stickslip._types import Whole
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems._mechanical import SLIP_MODES, STICK, Motion, Number, holding_force, slip_sense


class CoulombOscillator(AbstractMechanism):
    r"""Stick-slip oscillator: mass and spring on a belt, Coulomb friction between block and belt.

    $$m\ddot x + kx = T, \qquad
      T = \begin{cases} +F_k & \dot x < v_b \\ kx,\ |kx| \le F & \dot x = v_b \\
      -F_k & \dot x > v_b \end{cases} \qquad F = \max(F_s, F_k)$$

    - State `Motion`: `x` [m] from the unloaded spring, `v` [m/s]; both against the ground.
    - Modes: `"slip backward"` (slower than the belt), `"stick"` (with the belt), `"slip forward"`
      (faster than the belt).
    - One guard: in stick the friction that is left [N], in slip the relative speed in its sense [m/s].
    - At rest with $F_s < F_k$ the threshold is $F_k$ (sliding mode of Filippov).
    - In every mode the motion is harmonic or uniform, so that all of it has a closed form. Started
      in stick, with $F_k \le F_s$ and $D = (F_s - F_k)/k$, $\omega^2 = k/m$, it has the period
      $2D/v_b + 2(\pi - \arctan(D\omega/v_b))/\omega$.

    **Arguments:**

    - `mass` $m$ [kg] and `stiffness` $k$ [N/m], positive.
    - `static_force` $F_s$ and `kinetic_force` $F_k$ [N], not negative.
    - `belt_speed` $v_b$ [m/s], of either sign; 0 is an oscillator on rough ground. Where it comes to
      rest there just where friction can hold it, rounding decides, without a flag.

    ??? cite "Reference"

        K. Popp, N. Hinrichs, M. Oestreich, "Analysis of a self-excited friction oscillator with
        external excitation", in *Dynamics with Friction*, World Scientific, 1996.
    """

    mass: Float[Array, "..."]
    stiffness: Float[Array, "..."]
    static_force: Float[Array, "..."]
    kinetic_force: Float[Array, "..."]
    belt_speed: Float[Array, "..."]

    parameter_units: ClassVar = {
        "mass": "kg", "stiffness": "N/m", "static_force": "N", "kinetic_force": "N",
        "belt_speed": "m/s",
    }  # fmt: skip

    coordinates: ClassVar = {"x": "m"}
    velocities: ClassVar = {"x": "v"}
    contact_directions: ClassVar = {"belt": {"x": 1.0}}
    state_class: ClassVar = Motion
    mode_names: ClassVar = SLIP_MODES

    @parameters(
        mass="positive", stiffness="positive", static_force="not negative",
        kinetic_force="not negative", belt_speed="finite",
    )  # fmt: skip
    def __init__(
        self,
        mass: Number,
        stiffness: Number,
        static_force: Number,
        kinetic_force: Number,
        belt_speed: Number,
    ):
        pass

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": -self.stiffness * q.x}

    def contacts(self, t, q, v, args):
        law = Coulomb(self.static_force, self.kinetic_force)
        return {"belt": Contact(law, surface_speed=self.belt_speed)}

    def potential_energy(self, q):
        return 0.5 * self.stiffness * q.x**2

    # On a belt whose speed is constant the load grows in the sense of that speed: one straight line
    # does for both limits of friction, and costs half of what the general guards cost.

    @property
    def two_sided_contacts(self) -> tuple[int, ...]:
        """None: one guard looks after both limits."""
        return ()

    def guards(self, t, y, mode, args):
        limit = holding_force(self.static_force, self.kinetic_force)
        reserve = limit - jnp.sign(self.belt_speed) * self.stiffness * y.x
        speed = slip_sense(mode) * (y.v - self.belt_speed)
        return (where(mode == STICK, reserve, jnp.sqrt(self.stiffness * self.mass) * speed),)

    @property
    def guard_scales(self) -> tuple:
        """The largest friction force, or what stops the speed of the belt in a quarter period [N]."""
        inertia = jnp.sqrt(self.stiffness * self.mass) * jnp.abs(self.belt_speed)
        scale = jnp.maximum(jnp.maximum(self.static_force, self.kinetic_force), inertia)
        return (where(scale > 0.0, scale, 1.0),)

    @check_arguments(y=state, mode=modes)
    def friction(self, y: Motion, mode: Whole) -> Any:
        """Force of the belt on the block [N]."""
        return self.friction_forces(0.0, y, mode)["belt"]

    @check_arguments(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """`belt`: work of the drive; `friction`: loss in the contact [W]."""
        friction = self.friction(y, mode)
        return {
            "belt": friction * self.belt_speed,
            "friction": friction * (y.v - self.belt_speed),
        }
