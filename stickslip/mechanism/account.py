"""All that every mechanical system offers beyond the hybrid interface: its energy account."""

import abc
from typing import Any

from jaxtyping import PyTree

from stickslip._types import Numeric, Whole
from stickslip.hybrid import AbstractHybridSystem


class AbstractMechanicalSystem(AbstractHybridSystem):
    r"""A hybrid system that keeps account of its mechanical energy.

    Between events $\dot E = \sum_i P_i$ with the energy `energy(y)` [J] and the powers
    `powers(t, y, mode, args)` [W]; every power is counted as it enters the mechanical energy, so
    that a loss is negative. At an event the energy may drop (impact), which the event log shows:
    `energy(events.y_after) - energy(events.y_before)`. `WithIntegrals` integrates the powers along
    a motion.

    Methods of the reference systems **raise** `TypeError` or `ValueError` naming the argument: for
    states that lack components, values that are not numbers, unknown modes.
    """

    @abc.abstractmethod
    def energy(self, y: PyTree) -> Any:
        """Kinetic and potential energy [J]."""

    @abc.abstractmethod
    def powers(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> dict[str, Any]:
        """Powers into the mechanical energy [W] by name; friction, damping and the like are <= 0."""
