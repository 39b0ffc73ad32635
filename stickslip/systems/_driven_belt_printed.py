"""The block on a driven belt with signs as the paper prints them: what no mechanism has.

With `belt_reaction="printed"` the belt feels the same force as the block and not the opposite one, with
`motor_friction="printed"` friction drives the rotor. Neither is a contact between two bodies, whose law
says what sticks; so modes are tried one after the other here.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from .._fastmath import where
from ..hybrid.status import NO_MODE
from ._block_mechanics import Loads
from ._dc_drive import RESTING, TURNING_BACKWARD, TURNING_FORWARD, DCDrive
from ._mechanical import BACKWARD, FORWARD, SLIP_MODES, STICK, slip_sense

CONTACTS = (*SLIP_MODES, "open")
PARTS = len(CONTACTS)  # mode number = 4 drive + contact
GUARDS = (
    "friction reaches its upper static limit",
    "friction reaches its lower static limit",
    "relative velocity reaches zero",
    *DCDrive.guard_names,
)
SCALES = (1.0, 1.0, 1.0, *DCDrive.guard_scales)
# Rest before motion, and contact before drive: the order in which modes are tried.
_PREFERENCE = tuple(
    (drive, contact)
    for contacts in ((STICK,), (BACKWARD, FORWARD))
    for drive in (RESTING, TURNING_FORWARD, TURNING_BACKWARD)
    for contact in contacts
)


class Moves(NamedTuple):
    """Quantities that follow from a state and a mode."""

    loads: Loads
    T_s: Any
    torque: Any
    ax: Any
    domega: Any


def moves(system: Any, y: Any, drive_mode: Any, contact: Any) -> Moves:
    """Forces and accelerations in a mode of the drive and one of the contact."""
    drive, loads = system.drive, system.loads(y)
    v = y.vx - system.belt_velocity(y)
    slip = system.law.kinetic(v, slip_sense(contact)) * loads.normal + system.law.drag(v)
    # Belt acceleration = free + per_force * T_s, and the block's is the same while it sticks.
    free_torque = drive.torque(y, 0.0) - slip_sense(drive_mode) * drive.kinetic_torque
    belt = where(drive_mode == RESTING, 0.0, drive.transmission / drive.inertia)
    per_mass = 1.0 / system.m
    held = (-per_mass * loads.on_block - belt * free_torque) / (per_mass + belt * drive.reaction)
    T_s = where(contact == STICK, held, slip)
    domega = drive.slope(y, T_s, drive_mode).omega
    ax = -per_mass * (loads.on_block + T_s)
    together = where(contact == STICK, drive.transmission * domega, ax)
    return Moves(loads, T_s, drive.torque(y, T_s), together, domega)


def guards(system: Any, y: Any, mode: Any) -> tuple:
    """Guards named `GUARDS`."""
    contact = mode % PARTS
    now, stick = moves(system, y, mode // PARTS, contact), contact == STICK
    low, high = system.law.static_interval()
    v = y.vx - system.belt_velocity(y)
    return (
        where(stick, high * now.loads.normal - now.T_s, 1.0),
        where(stick, now.T_s - low * now.loads.normal, 1.0),
        where(stick, 1.0, slip_sense(contact) * v),
        *system.drive.drive_guards(y, now.T_s, mode // PARTS),
    )


def transition(system: Any, y: Any, mode: Any, guard: Any) -> tuple[Any, Any]:
    """State and mode after one of the `GUARDS`."""
    together = (guard <= 2) | ((mode % PARTS) == STICK)
    omega = where((guard == 3) | ((mode // PARTS) == RESTING), 0.0, y.omega)
    y = y._replace(omega=omega, vx=where(together, system.drive.transmission * omega, y.vx))
    contact = where(guard == 0, FORWARD, where(guard == 1, BACKWARD, NO_MODE))
    drive = where(guard == 4, TURNING_FORWARD, where(guard == 5, TURNING_BACKWARD, NO_MODE))
    # A rotor that was already at rest, or a block already stuck, may lose its hold as well.
    return y, first_mode(system, y, together, contact, drive)


def first_mode(
    system: Any, y: Any, together: Any, forced_contact: Any = NO_MODE, forced_drive: Any = NO_MODE
) -> Any:
    """First mode whose forces lie within their limits and whose accelerations have its sense.

    `together`: the block has the belt's velocity. A forced part is taken unchecked, because at the
    static limit its acceleration may begin at zero.
    """
    low, high = system.law.static_interval()
    still = y.omega == 0
    v = y.vx - system.belt_velocity(y)
    found = jnp.asarray(NO_MODE)
    for drive, contact in reversed(_PREFERENCE):
        now = moves(system, y, jnp.asarray(drive), jnp.asarray(contact))
        normal, T_s = now.loads.normal, now.T_s
        relative = now.ax - system.drive.transmission * now.domega
        if contact == STICK:
            holds = together & (T_s <= high * normal) & (T_s >= low * normal)
        else:
            sense = 1.0 if contact == FORWARD else -1.0
            holds = jnp.where(together, relative * sense > 0, v * sense > 0)
        if drive == RESTING:
            rests = still & (jnp.abs(now.torque) <= system.drive.T_st)
        else:
            sense = 1.0 if drive == TURNING_FORWARD else -1.0
            rests = jnp.where(still, now.domega * sense > 0, y.omega * sense > 0)
        holds = jnp.where(forced_contact == NO_MODE, holds, forced_contact == contact)
        rests = jnp.where(forced_drive == NO_MODE, rests, forced_drive == drive)
        found = where(holds & rests, PARTS * drive + contact, found)
    return found
