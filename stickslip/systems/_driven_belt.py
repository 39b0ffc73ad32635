"""Block on a belt that a DC drive moves: the full model, with smooth friction."""

from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float, PyTree

from .._argument_checks import OBSERVABLE, check_arguments, instance, parameters, reals, state
from .._types import Given, Numeric, Whole
from ..friction import AbstractFrictionLaw
from ..friction.law import Number
from ._block_mechanics import (
    BLOCK,
    AbstractBlockOnBelt,
    Block,
    check_law,
    check_rim,
    set_a,
)
from ._dc_drive import DCDrive


class DrivenBlockState(NamedTuple):
    """Block, pendulum and drive."""

    x: Any  # displacement of the block [m]
    vx: Any  # its velocity [m/s]
    y: Any  # displacement of the pendulum's rim [m]
    vy: Any  # its velocity [m/s]
    omega: Any  # speed of the rotor [rad/s]
    i_w: Any  # current of the winding [A]


DRIVEN_UNITS = {"x": "m", "vx": "m/s", "y": "m", "vy": "m/s", "omega": "rad/s", "i_w": "A"}


class AbstractBlockOnDrivenBelt(AbstractBlockOnBelt):
    """Full model: a drive moves the belt under the block, which loads it."""

    drive: DCDrive

    @check_arguments(drive=instance(DCDrive, "a DCDrive"))
    @parameters(**BLOCK)
    def __init__(
        self,
        *,
        m: Number,
        M: Number,
        J: Number,
        k1: Number,
        k2: Number,
        k3: Number,
        c1: Number,
        c2: Number,
        r: Number,
        Q: Number,
        law: AbstractFrictionLaw,
        drive: DCDrive,
        g: Number = 9.81,
    ):
        check_rim(J, r)
        self.law = check_law(law, self.set_valued)
        self.drive = drive

    @classmethod
    def constructed(
        cls: type[Block], k3: Number, **changes: Given[ArrayLike | AbstractFrictionLaw | DCDrive]
    ) -> Block:
        """Set A and the **constructed** drive at `k3` [N/m]; `changes` replace single parameters."""
        given = set_a(k3, changes, cls.set_valued)
        if "drive" not in given:
            given["drive"] = DCDrive.constructed()
        return cls(**given)

    @check_arguments(y=state)
    def belt_velocity(self, y: DrivenBlockState) -> Float[Array, "..."]:
        """Velocity of the belt $V_b$ [m/s]."""
        return self.drive.belt_velocity(y)

    @check_arguments(y=state)
    def energy(self, y: DrivenBlockState) -> Any:
        """Energy of block, pendulum, turning parts and winding [J]."""
        block = self.kinetic_energy(0.0, y) + self.potential_energy(0.0, y)
        return block + self.drive.stored_energy(0.0, y)

    @check_arguments(**OBSERVABLE)
    def contact_power(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree = None) -> Any:
        """Power of the contact on block and belt as the equations in use have it [W].

        With the consistent `belt_reaction` it is `friction_power`, not positive; as printed the belt
        feels $-T_s$ and the contact creates energy.
        """
        on_belt = self._sign * self.belt_velocity(y)
        return self.friction_force(t, y, mode, args) * (on_belt - y.vx)

    @check_arguments(**OBSERVABLE)
    def gear_power(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree = None) -> Any:
        """Power of the worm gear [W]: a loss while the motor drives, see `DCDrive` on `eta`."""
        T_s = self.friction_force(t, y, mode, args)
        return self.drive.load_power(y, T_s) - self._sign * T_s * self.belt_velocity(y)

    @check_arguments(**OBSERVABLE)
    def powers(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> dict[str, Any]:
        """Powers into `energy` [W]."""
        return {
            "supply": self.drive.electrical_power(t, y, mode, args),
            "motor": self.drive.loss_power(t, y, mode, args),
            "gear": self.gear_power(t, y, mode, args),
            "contact": self.contact_power(t, y, mode, args),
            "dampers": self.damper_power(t, y, mode, args),
        }

    @property
    def _sign(self) -> float:
        return 1.0 if self.drive.belt_reaction == "consistent" else -1.0

    def scaled(self, factor: Number) -> Any:
        """All masses, forces and torques of block and drive times `factor`: the motion is the same."""
        changed: Any = super().scaled(factor)
        return eqx.tree_at(lambda s: s.drive, changed, self.drive.scaled(factor))


class BlockOnDrivenBelt(AbstractBlockOnDrivenBelt):
    r"""Full model, Eqs. (1)-(12): the block on the belt loads the drive, which moves the belt.

    `AbstractBlockOnBelt` has the equations of block and pendulum, `DCDrive` those of the drive with
    the switches for the signs that the paper prints (`belt_reaction`, `motor_friction`). The state is
    `DrivenBlockState(x, vx, y, vy, omega, i_w)`, $V_b = r_\mathrm{bp}\omega/\rho$; the modes are those
    of the drive. The law is smooth.

    **Stiffness**: contact (about 2,000 1/s for set A) and winding ($R_w/L_w$ = 1,000 1/s) both bound
    the step of explicit methods; see `DCDrive`.

    `BlockOnDrivenBelt.constructed(k3=85.0)` is set A with the drive `DCDrive.constructed()`, all
    **constructed**. Errors: `ValueError` naming a parameter, its value and what is allowed.

    ??? cite "Reference"

        *Influence of Frequency of Excitation on Bifurcational Behaviour of an Experimental 2-DoF
        Mechanical System with Stick-Slip Friction*, Eqs. (1)-(12), second case.
    """

    if TYPE_CHECKING:  # which would take the fields for the arguments
        __init__ = AbstractBlockOnDrivenBelt.__init__

    set_valued: ClassVar = False
    mode_names: ClassVar = DCDrive.mode_names
    guard_names: ClassVar = DCDrive.guard_names
    guard_scales: ClassVar = DCDrive.guard_scales
    units: ClassVar = DRIVEN_UNITS

    def vector_field(self, t, y, mode, args):
        loads = self.loads(y)
        T_s = self.sliding_force(y, loads)
        return DrivenBlockState(*self.slope(y, loads, T_s), *self.drive.slope(y, T_s, mode))

    def guards(self, t, y, mode, args):
        return self.drive.drive_guards(y, self.friction_force(t, y), mode)

    def transition(self, t, y, mode, guard, args):
        landed = y._replace(omega=jnp.zeros_like(y.omega))
        return landed, self.drive.mode_after(landed, self.friction_force(t, landed), guard)

    @check_arguments(t=reals, y=state)
    def initial_mode(self, t, y, args):
        return self.drive.initial_mode(t, y, self.friction_force(t, y))
