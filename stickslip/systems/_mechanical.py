"""Shared by the reference systems: the state of a point, names of modes, the law of one contact."""

from typing import Any, NamedTuple

from jaxtyping import ArrayLike, Real

from stickslip._fastmath import where
from stickslip.mechanism.account import AbstractMechanicalSystem as AbstractMechanicalSystem

Number = Real[ArrayLike, "..."]

SLIP_MODES = ("slip backward", "stick", "slip forward")
BACKWARD, STICK, FORWARD = range(3)  # their numbers


class Motion(NamedTuple):
    """State of a point on a line: position `x` [m] and velocity `v` [m/s]."""

    x: Any
    v: Any


def holding_force(static_force: Any, kinetic_force: Any) -> Any:
    """Largest friction force at rest: a body held by less than it would slide with cannot leave rest
    (Filippov's sliding mode), so the kinetic force is the threshold where it is the greater one."""
    return where(kinetic_force > static_force, kinetic_force, static_force)


def slip_sense(mode: Any) -> Any:
    """Sign of the relative velocity, -1, 0 or +1, in the modes `SLIP_MODES`."""
    return where(mode == STICK, 0.0, where(mode == BACKWARD, -1.0, 1.0))


def mode_at_rest(load: Any, limit: Any) -> Any:
    """Mode of a contact without relative velocity under `load` [N], all force but friction.

    Beyond `limit` [N] the load starts a slip in its own sense.
    """
    return where(load > limit, FORWARD, where(load < -limit, BACKWARD, STICK))


def contact_mode(relative_velocity: Any, load: Any, limit: Any) -> Any:
    """Mode of a contact: the sense of its slip; without one the load decides."""
    at_rest = mode_at_rest(load, limit)
    return where(relative_velocity < 0.0, BACKWARD, where(relative_velocity > 0.0, FORWARD, at_rest))
