"""Block on a belt that a DC drive moves: the full model, with set-valued friction."""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
from jaxtyping import PyTree

from .._fastmath import where
from .._looks_at import OBSERVABLE, looks_at, reals, state
from .._types import Numeric, Whole
from ..hybrid._system import NO_MODE
from ._block_mechanics import Loads
from ._block_on_belt import BACKWARD, FORWARD, STICK, sense_of
from ._dc_drive import RESTING, TURNING_BACKWARD, TURNING_FORWARD, DCDrive, turning_sense
from ._driven_belt import DRIVEN_UNITS, AbstractBlockOnDrivenBelt, DrivenBlockState

# Rest before motion, and contact before drive: the order in which modes are tried.
_PREFERENCE = tuple(
    (drive, contact)
    for contacts in ((STICK,), (BACKWARD, FORWARD))
    for drive in (RESTING, TURNING_FORWARD, TURNING_BACKWARD)
    for contact in contacts
)


class _Motion(NamedTuple):
    """What follows from a state and a mode."""

    loads: Loads
    T_s: Any
    torque: Any
    ax: Any
    domega: Any


class BlockOnDrivenBeltSetValued(AbstractBlockOnDrivenBelt):
    r"""Full model, Eqs. (1)-(11), with a set-valued law: the block sticks and slips.

    As `BlockOnDrivenBelt`, with the contact of `BlockOnBeltSetValued`. Each of the nine modes is one
    of the drive (`"turning backward"`, `"resting"`, `"turning forward"`) with one of the contact
    (`"slip backward"`, `"stick"`, `"slip forward"`); mode number = 3 drive + contact. A sticking block
    moves with the belt, $\ddot x = \dot V_b$, so that block and rotor share one acceleration and
    $T_s$ follows from it. At an event the mode is the first, rest before motion, whose forces lie
    within their limits and whose accelerations have the sense of its motion; `-1` if there is none.

    `BlockOnDrivenBeltSetValued.constructed(k3=85.0)` is set A (**constructed**) with the set-valued
    limit of its law. Errors as for `BlockOnDrivenBelt`.
    """

    set_valued: ClassVar = True
    mode_names: ClassVar = tuple(
        f"{drive}, {contact}"
        for drive in DCDrive.mode_names
        for contact in ("slip backward", "stick", "slip forward")
    )
    guard_names: ClassVar = (
        "friction reaches its upper static limit",
        "friction reaches its lower static limit",
        "relative velocity reaches zero",
        *DCDrive.guard_names,
    )
    guard_scales: ClassVar = (1.0, 1.0, 1.0, *DCDrive.guard_scales)
    units: ClassVar = DRIVEN_UNITS

    @looks_at(**OBSERVABLE)
    def friction_force(self, t: Numeric, y: DrivenBlockState, mode: Whole, args: PyTree = None) -> Any:
        """Friction force $T_s$ [N] as in (11); the block feels $-T_s$. At rest, what holds it."""
        return self._motion(y, mode // 3, mode % 3).T_s

    def _motion(self, y, drive_mode, contact) -> _Motion:
        drive, loads = self.drive, self.loads(y)
        v = y.vx - self.belt_velocity(y)
        slip = self.law.kinetic(v, sense_of(contact)) * loads.normal + self.law.drag(v)
        # Belt acceleration = free + per_force * T_s, and the block's is the same while it sticks.
        free_torque = drive.torque(y, 0.0) - turning_sense(drive_mode) * drive.kinetic_torque
        belt = where(drive_mode == RESTING, 0.0, drive.transmission / drive.inertia)
        per_mass = 1.0 / self.m
        held = (-per_mass * loads.on_block - belt * free_torque) / (per_mass + belt * drive.reaction)
        T_s = where(contact == STICK, held, slip)
        domega = drive.slope(y, T_s, drive_mode).omega
        ax = -per_mass * (loads.on_block + T_s)
        together = where(contact == STICK, drive.transmission * domega, ax)
        return _Motion(loads, T_s, drive.torque(y, T_s), together, domega)

    def vector_field(self, t, y, mode, args):
        motion = self._motion(y, mode // 3, mode % 3)
        dy = self.slope(y, motion.loads, motion.T_s)._replace(vx=motion.ax)
        return DrivenBlockState(*dy, omega=motion.domega, i_w=self.drive.current_rate(y))

    def guards(self, t, y, mode, args):
        contact = mode % 3
        motion, stick = self._motion(y, mode // 3, contact), contact == STICK
        low, high = self.law.static_interval()
        v = y.vx - self.belt_velocity(y)
        return (
            where(stick, high * motion.loads.normal - motion.T_s, 1.0),
            where(stick, motion.T_s - low * motion.loads.normal, 1.0),
            where(stick, 1.0, sense_of(contact) * v),
            *self.drive.drive_guards(y, motion.T_s, mode // 3),
        )

    def transition(self, t, y, mode, guard, args):
        stops = guard == 3
        stuck = (mode % 3) == STICK
        omega = where(stops | ((mode // 3) == RESTING), 0.0, y.omega)
        with_belt = self.drive.transmission * omega
        y = y._replace(omega=omega, vx=where((guard <= 2) | stuck, with_belt, y.vx))
        forced_contact = where(guard == 0, FORWARD, where(guard == 1, BACKWARD, NO_MODE))
        forced_drive = where(guard == 4, TURNING_FORWARD, where(guard == 5, TURNING_BACKWARD, NO_MODE))
        # A rotor that was already at rest, or a block already stuck, may lose its hold as well.
        return y, self._admissible(y, (guard <= 2) | stuck, forced_contact, forced_drive)

    @looks_at(t=reals, y=state)
    def initial_mode(self, t, y, args):
        together = y.vx == self.belt_velocity(y)
        return self._admissible(y, together, jnp.asarray(NO_MODE), jnp.asarray(NO_MODE))

    def _admissible(self, y, together, forced_contact, forced_drive):
        """First admissible mode; `together`: the block has the belt's velocity. A forced part is taken
        unchecked, because at the static limit its acceleration may begin at zero."""
        low, high = self.law.static_interval()
        still = y.omega == 0
        v = y.vx - self.belt_velocity(y)
        found = jnp.asarray(NO_MODE)
        for drive, contact in reversed(_PREFERENCE):
            motion = self._motion(y, jnp.asarray(drive), jnp.asarray(contact))
            normal, T_s = motion.loads.normal, motion.T_s
            relative = motion.ax - self.drive.transmission * motion.domega
            if contact == STICK:
                holds = together & (T_s <= high * normal) & (T_s >= low * normal)
            else:
                sense = 1.0 if contact == FORWARD else -1.0
                holds = jnp.where(together, relative * sense > 0, v * sense > 0)
            if drive == RESTING:
                rests = still & (jnp.abs(motion.torque) <= self.drive.T_st)
            else:
                sense = 1.0 if drive == TURNING_FORWARD else -1.0
                rests = jnp.where(still, motion.domega * sense > 0, y.omega * sense > 0)
            holds = jnp.where(forced_contact == NO_MODE, holds, forced_contact == contact)
            rests = jnp.where(forced_drive == NO_MODE, rests, forced_drive == drive)
            found = where(holds & rests, 3 * drive + contact, found)
        return found
