"""Block on a belt that a DC drive moves: the full model, with set-valued friction."""

from typing import TYPE_CHECKING, Any, ClassVar

import jax.numpy as jnp
from jaxtyping import PyTree

from .._argument_checks import OBSERVABLE, check_arguments, reals, state
from .._types import Numeric, Whole
from .._validation import refusal
from ..friction import Coulomb
from ..mechanism import AbstractMechanism, Contact, Instant
from . import _driven_belt_printed as printed
from ._dc_drive import DCDrive
from ._driven_belt import DRIVEN_UNITS, AbstractBlockOnDrivenBelt, DrivenBlockState


class BlockOnDrivenBeltSetValued(AbstractBlockOnDrivenBelt, AbstractMechanism):
    r"""Full model, Eqs. (1)-(11), with a set-valued law: the block sticks and slips.

    As `BlockOnDrivenBelt`, with the contact of `BlockOnBeltSetValued`. Declared with the travel $s$ of
    the belt as coordinate of the drive, which nothing depends on; $V_b = \dot s$. Equation (7) is then

    $$\frac{\eta\rho^2}{r_\mathrm{bp}^2}\left(J_\mathrm{dc} + \frac{J_\mathrm{bp}}{\eta\rho^2}\right)
      \ddot s = \frac{\eta\rho}{r_\mathrm{bp}}(k_m i_w - b\,\omega - T_k\,\mathrm{sgn}\,\omega) + T_s$$

    with the contacts "block" (sliding speed $\dot x - V_b$, force $-T_s$) and "bearing" (speed $V_b$).

    Each mode is one of the drive (`"turning backward"`, `"resting"`, `"turning forward"`) with one of
    the contact (`"slip backward"`, `"stick"`, `"slip forward"`); mode number = 4 drive + contact, and
    the modes with an `"open"` contact are never taken. The run ends with
    `RESULTS.no_admissible_mode` where $N$ falls to zero.

    **Signs as printed** do not describe a mechanism: with `belt_reaction="printed"` the drive has a
    negative inertia for the contact, with `motor_friction="printed"` its friction drives. For these
    the mode is the first, rest before motion, whose forces lie within their limits and whose
    accelerations have the sense of its motion; `-1` if there is none; and $N$ may fall below zero.
    They have no smooth forms by `regularised` and `bristles`: `BlockOnDrivenBelt` has them.

    `BlockOnDrivenBeltSetValued.constructed(k3=85.0)` is set A (**constructed**) with the set-valued
    limit of its law. Errors as for `BlockOnDrivenBelt`.
    """

    if TYPE_CHECKING:  # which would take the fields for the arguments
        __init__ = AbstractBlockOnDrivenBelt.__init__

    set_valued: ClassVar = True
    coordinates: ClassVar = {"x": "m", "y": "m", "s": "m"}
    velocities: ClassVar = {"x": "vx", "y": "vy", "s": "omega"}
    first_order: ClassVar = {"i_w": "A"}
    cyclic: ClassVar = ("s",)
    contact_directions: ClassVar = {"block": {"x": 1.0, "s": -1.0}, "bearing": {"s": 1.0}}
    state_class: ClassVar = DrivenBlockState
    units: ClassVar = DRIVEN_UNITS
    mode_names: ClassVar = tuple(
        f"{drive}, {contact}" for drive in DCDrive.mode_names for contact in printed.CONTACTS
    )

    def to_coordinates(self, y):
        q, v = super().to_coordinates(y)
        return q, v._replace(s=self.drive.transmission * y.omega)

    def from_coordinates(self, q, v):
        return super().from_coordinates(q, v._replace(s=v.s / self.drive.transmission))

    @property
    def _per_torque(self):
        """Force along the belt per torque of the rotor [1/m]."""
        return self.drive.eta / self.drive.transmission

    def mass_matrix(self, q):
        drive = self._per_torque * self.drive.inertia / self.drive.transmission
        return {"x": self.m, "y": self.J / (self.r * self.r), "s": drive}

    def forces(self, t, q, v, args):
        if self._is_printed:
            signs = f"{self.drive.belt_reaction}, {self.drive.motor_friction}"
            raise refusal(
                "belt_reaction, motor_friction", signs, "consistent: no mechanism has these signs"
            )
        y = self.from_coordinates(q, v)
        loads = self.loads(y)
        torque = self.drive.torque(y, 0.0)
        return {"x": -loads.on_block, "y": -loads.on_rim, "s": self._per_torque * torque}

    def rates(self, t, q, v, args):
        return {"i_w": self.drive.current_rate(self.from_coordinates(q, v))}

    def contacts(self, t, q, v, args):
        N = self.loads(self.from_coordinates(q, v)).normal
        dry = Coulomb(self._per_torque * self.drive.T_st, self._per_torque * self.drive.T_k)
        return {"block": Contact(self.law, N), "bearing": Contact(dry)}

    def smooth_powers(self, at: Instant, friction: list) -> dict[str, Any]:
        """Powers into `energy` [W], as `powers`: what the gear loses depends on the friction."""
        y = self.from_coordinates(at.q, at.v)
        drive, T_s = self.drive, -friction[0]
        # `loss_power` has the dry friction of the set-valued law, which is another one here.
        dry = drive.kinetic_torque * jnp.abs(y.omega) + friction[1] / self._per_torque * y.omega
        return {
            "supply": drive.electrical_power(0.0, y),
            "motor": drive.loss_power(0.0, y) + dry,
            "gear": drive.load_power(y, T_s) - T_s * self.belt_velocity(y),
            "contact": T_s * (self.belt_velocity(y) - y.vx),
            "dampers": self.damper_power(0.0, y),
        }

    @check_arguments(**OBSERVABLE)
    def friction_force(self, t: Numeric, y: DrivenBlockState, mode: Whole, args: PyTree = None) -> Any:
        """Friction force $T_s$ [N] as in (11); the block feels $-T_s$. At rest, what holds it."""
        if self._is_printed:
            return printed.moves(self, y, mode // printed.PARTS, mode % printed.PARTS).T_s
        return -self.friction_forces(t, y, mode, args)["block"]

    # -- signs as printed

    @property
    def _is_printed(self) -> bool:
        return "printed" in (self.drive.belt_reaction, self.drive.motor_friction)

    @property
    def guard_names(self) -> tuple[str, ...]:
        """Those of the contacts; of block, belt and drive where a sign is as printed."""
        return printed.GUARDS if self._is_printed else super().guard_names

    @property
    def guard_scales(self) -> Any:
        """Of torques a thousandth where a sign is as printed."""
        return printed.SCALES if self._is_printed else super().guard_scales

    def held_state(self, t, y, mode, args):
        return y if self._is_printed else super().held_state(t, y, mode, args)

    def vector_field(self, t, y, mode, args):
        if not self._is_printed:
            return super().vector_field(t, y, mode, args)
        now = printed.moves(self, y, mode // printed.PARTS, mode % printed.PARTS)
        dy = self.slope(y, now.loads, now.T_s)._replace(vx=now.ax)
        return DrivenBlockState(*dy, omega=now.domega, i_w=self.drive.current_rate(y))

    def guards(self, t, y, mode, args):
        if self._is_printed:
            return printed.guards(self, y, mode)
        return super().guards(t, y, mode, args)

    def transition(self, t, y, mode, guard, args):
        if self._is_printed:
            return printed.transition(self, y, mode, guard)
        return super().transition(t, y, mode, guard, args)

    @check_arguments(t=reals, y=state)
    def initial_mode(self, t, y, args):
        if self._is_printed:
            return printed.first_mode(self, y, y.vx == self.belt_velocity(y))
        return super().initial_mode(t, y, args)
