"""Block on rough ground under a constant force."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from stickslip._fastmath import where
from stickslip._looks_at import OBSERVABLE, looks_at, reals, state
from stickslip._validation import as_parameter, check_finite, check_nonnegative, check_positive
from stickslip.systems._mechanical import (
    AbstractMechanicalSystem,
    Motion,
    Number,
    contact_mode,
    holding_force,
    mode_at_rest,
    slip_sense,
)


class SlidingBlock(AbstractMechanicalSystem):
    r"""A block thrown over rough ground: slows down, comes to rest and stays, or turns around.

    $$m\ddot x = P + T, \qquad
      T = \begin{cases} -F_k\,\mathrm{sgn}\,\dot x & \dot x \ne 0 \\
      -P,\ |P| \le F & \dot x = 0 \end{cases} \qquad F = \max(F_s, F_k)$$

    - State `Motion`: `x` [m], `v` [m/s].
    - Modes: `"slip backward"`, `"rest"`, `"slip forward"`.
    - One guard, the speed in the sense of the slip [m/s]. Nothing ends a rest: the force is constant
      and stays in the dead zone.
    - Closed form: with $a = (F_k - P\,\mathrm{sgn}\,v_0)/m > 0$ it stops after $|v_0|/a$ at the
      distance $v_0^2/(2a)$.

    **Arguments:**

    - `mass` $m$ [kg], positive.
    - `static_force` $F_s$ and `kinetic_force` $F_k$ [N], not negative.
    - `force` $P$ [N], 0 if left out.

    ??? cite "Reference"

        Ch. Glocker, *Set-Valued Force Laws*, Springer, 2001, chapter 1.
    """

    mass: Float[Array, "..."]
    static_force: Float[Array, "..."]
    kinetic_force: Float[Array, "..."]
    force: Float[Array, "..."]

    mode_names: ClassVar = ("slip backward", "rest", "slip forward")
    guard_names: ClassVar = ("the block stops",)
    units: ClassVar = {"x": "m", "v": "m/s"}

    def __init__(self, mass: Number, static_force: Number, kinetic_force: Number, force: Number = 0.0):
        self.mass = as_parameter(check_positive("mass", mass))
        self.static_force = as_parameter(check_nonnegative("static_force", static_force))
        self.kinetic_force = as_parameter(check_nonnegative("kinetic_force", kinetic_force))
        self.force = as_parameter(check_finite("force", force))

    def vector_field(self, t, y, mode, args):
        slip = (self.force - slip_sense(mode) * self.kinetic_force) / self.mass
        return Motion(x=y.v, v=where(mode == 1, 0.0, slip))

    def guards(self, t, y, mode, args):
        return (where(mode == 1, 1.0, slip_sense(mode) * y.v),)

    def transition(self, t, y, mode, guard, args):
        limit = holding_force(self.static_force, self.kinetic_force)
        return Motion(x=y.x, v=jnp.zeros_like(y.v)), mode_at_rest(self.force, limit)

    @looks_at(t=reals, y=state)
    def initial_mode(self, t, y, args):
        limit = holding_force(self.static_force, self.kinetic_force)
        return contact_mode(y.v, self.force, limit)

    @looks_at(y=state)
    def energy(self, y):
        """Kinetic energy [J]."""
        return 0.5 * self.mass * y.v**2

    @looks_at(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """`force`: work of the constant force; `friction`: loss in the contact [W]."""
        friction = -slip_sense(mode) * self.kinetic_force
        return {"force": self.force * y.v, "friction": friction * y.v}
