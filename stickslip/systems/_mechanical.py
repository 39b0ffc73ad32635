"""Shared by the reference systems: the state of a point, names of modes, the law of one contact."""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
from jaxtyping import ArrayLike, Real

from stickslip._fastmath import where
from stickslip._validation import as_parameter, check_positive
from stickslip.mechanism.account import AbstractMechanicalSystem as AbstractMechanicalSystem

Number = Real[ArrayLike, "..."]
System = TypeVar("System", bound=eqx.Module)

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


def with_scaled(system: System, names: Sequence[str], factor: Number) -> System:
    """`system` with the parameters of these names times `factor`, a positive number."""
    factor = as_parameter(check_positive("factor", factor))

    def parts(s: Any) -> list:
        return [getattr(s, name) for name in names]

    return eqx.tree_at(parts, system, [part * factor for part in parts(system)])
