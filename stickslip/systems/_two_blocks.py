"""Two coupled blocks on one moving belt."""

from typing import Any, ClassVar, NamedTuple

from jaxtyping import Array, Float

from stickslip._argument_checks import OBSERVABLE, check_arguments, parameters
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems._mechanical import Number


class PairMotion(NamedTuple):
    """State of two points: positions `x_1`, `x_2` [m] and velocities `v_1`, `v_2` [m/s]."""

    x_1: Any
    v_1: Any
    x_2: Any
    v_2: Any


class TwoBlocksOnBelt(AbstractMechanism):
    r"""Two stick-slip oscillators on one belt, coupled by a spring.

    $$m_i\ddot x_i = q_i + T_i, \qquad q_i = -k_i x_i - k_c\,(x_i - x_j)$$

    with Coulomb friction $T_i$ between block and belt as in `CoulombOscillator`: $-F_{k,i}$ times
    the sense of the slip, or $-q_i$ in stick as long as $|q_i| \le \max(F_{s,i}, F_{k,i})$.

    - State `PairMotion`: `x_1`, `x_2` [m] from the unloaded springs, `v_1`, `v_2` [m/s].
    - Modes: that of block 1 and that of block 2, `"stick / slip forward"`.
    - Guards: for each block, in stick the friction that is left [N], in slip its relative speed [m/s].
    - Closed form: linear with constant coefficients in every mode. Without coupling two
      `CoulombOscillator`s; alike and alike started, both blocks have their events at one instant.

    **Arguments:**

    - `mass_1`, `mass_2` [kg], positive; `stiffness_1`, `stiffness_2` and `coupling` $k_c$ [N/m], not
      negative.
    - `static_force_1`, `static_force_2`, `kinetic_force_1`, `kinetic_force_2` [N], not negative.
    - `belt_speed` [m/s], of either sign.

    ??? cite "Reference"

        U. Galvanetto, S. R. Bishop, "Dynamics of a simple damped oscillator undergoing stick-slip
        vibrations", Meccanica 34, 1999, and U. Galvanetto, "Some discontinuous bifurcations in a
        two-block stick-slip system", Journal of Sound and Vibration 248, 2001.
    """

    mass_1: Float[Array, "..."]
    mass_2: Float[Array, "..."]
    stiffness_1: Float[Array, "..."]
    stiffness_2: Float[Array, "..."]
    coupling: Float[Array, "..."]
    static_force_1: Float[Array, "..."]
    static_force_2: Float[Array, "..."]
    kinetic_force_1: Float[Array, "..."]
    kinetic_force_2: Float[Array, "..."]
    belt_speed: Float[Array, "..."]

    parameter_units: ClassVar = {
        "mass_1": "kg", "mass_2": "kg", "stiffness_1": "N/m", "stiffness_2": "N/m",
        "coupling": "N/m", "static_force_1": "N", "static_force_2": "N", "kinetic_force_1": "N",
        "kinetic_force_2": "N", "belt_speed": "m/s",
    }  # fmt: skip

    coordinates: ClassVar = {"x_1": "m", "x_2": "m"}
    velocities: ClassVar = {"x_1": "v_1", "x_2": "v_2"}
    contact_directions: ClassVar = {"block 1": {"x_1": 1.0}, "block 2": {"x_2": 1.0}}
    state_class: ClassVar = PairMotion

    @parameters(
        mass_1="positive", mass_2="positive", stiffness_1="not negative", stiffness_2="not negative",
        coupling="not negative", static_force_1="not negative", static_force_2="not negative",
        kinetic_force_1="not negative", kinetic_force_2="not negative", belt_speed="finite",
    )  # fmt: skip
    def __init__(
        self,
        *,
        mass_1: Number,
        mass_2: Number,
        stiffness_1: Number,
        stiffness_2: Number,
        coupling: Number,
        static_force_1: Number,
        static_force_2: Number,
        kinetic_force_1: Number,
        kinetic_force_2: Number,
        belt_speed: Number,
    ):
        pass

    def mass_matrix(self, q):
        return {"x_1": self.mass_1, "x_2": self.mass_2}

    def forces(self, t, q, v, args):
        between = self.coupling * (q.x_1 - q.x_2)
        return {
            "x_1": -self.stiffness_1 * q.x_1 - between,
            "x_2": -self.stiffness_2 * q.x_2 + between,
        }

    def contacts(self, t, q, v, args):
        one = Coulomb(self.static_force_1, self.kinetic_force_1)
        two = Coulomb(self.static_force_2, self.kinetic_force_2)
        return {
            "block 1": Contact(one, surface_speed=self.belt_speed),
            "block 2": Contact(two, surface_speed=self.belt_speed),
        }

    def potential_energy(self, q):
        return 0.5 * (
            self.stiffness_1 * q.x_1**2
            + self.stiffness_2 * q.x_2**2
            + self.coupling * (q.x_1 - q.x_2) ** 2
        )

    @check_arguments(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """`belt`: work of the drive; `friction_1`, `friction_2`: losses in the contacts [W]."""
        one, two = self.friction_forces(t, y, mode, args).values()
        return {
            "belt": (one + two) * self.belt_speed,
            "friction_1": one * (y.v_1 - self.belt_speed),
            "friction_2": two * (y.v_2 - self.belt_speed),
        }
