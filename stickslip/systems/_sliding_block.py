"""Block on rough ground under a constant force."""

from typing import ClassVar

from jaxtyping import Array, Float

from stickslip._argument_checks import OBSERVABLE, check_arguments, parameters
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems._mechanical import Motion, Number


class SlidingBlock(AbstractMechanism):
    r"""A block thrown over rough ground: slows down, comes to rest and stays, or turns around.

    $$m\ddot x = P + T, \qquad
      T = \begin{cases} -F_k\,\mathrm{sgn}\,\dot x & \dot x \ne 0 \\
      -P,\ |P| \le F & \dot x = 0 \end{cases} \qquad F = \max(F_s, F_k)$$

    - State `Motion`: `x` [m], `v` [m/s].
    - Modes: `"slip backward"`, `"rest"`, `"slip forward"`.
    - One guard: the speed in the sense of the slip [m/s], and at rest the friction that is left [N].
      Nothing ends a rest: the force is constant and stays in the dead zone.
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

    parameter_units: ClassVar = {"mass": "kg", "static_force": "N", "kinetic_force": "N", "force": "N"}

    coordinates: ClassVar = {"x": "m"}
    velocities: ClassVar = {"x": "v"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}
    state_class: ClassVar = Motion
    mode_names: ClassVar = ("slip backward", "rest", "slip forward")

    @parameters(
        mass="positive", static_force="not negative", kinetic_force="not negative", force="finite",
    )  # fmt: skip
    def __init__(self, mass: Number, static_force: Number, kinetic_force: Number, force: Number = 0.0):
        pass

    def mass_matrix(self, q):
        return {"x": self.mass}

    def forces(self, t, q, v, args):
        return {"x": self.force}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(Coulomb(self.static_force, self.kinetic_force))}

    @check_arguments(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """`force`: work of the constant force; `friction`: loss in the contact [W]."""
        friction = self.friction_forces(t, y, mode, args)["ground"]
        return {"force": self.force * y.v, "friction": friction * y.v}
