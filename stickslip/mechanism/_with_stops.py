"""What a mechanism with rigid stops declares and offers on top of one with contacts."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from jaxtyping import PyTree

from stickslip._argument_checks import OBSERVABLE, check_arguments
from stickslip._fastmath import where
from stickslip._types import Numeric, Whole

from ._abstract import traced_with
from ._instant import Instant, loaded, motion_of, surface_accelerations
from ._modes import mode_of, states_of
from ._scalars import is_zero
from ._states import AbstractWithStates
from ._stop import Stop, slopes

if TYPE_CHECKING:
    from ._mechanism import AbstractMechanism


class AbstractWithStops(AbstractWithStates):
    """A part of `AbstractMechanism`, which says what it declares."""

    def gaps(self, t: Numeric, q: PyTree, args: PyTree) -> Mapping[str, Stop]:
        """A `Stop` for each name in `stops`; the gradient of its gap by `q` is its direction."""
        return {}

    @property
    def slopes(self) -> np.ndarray:
        """Slopes of the gaps `[stop, coordinate, and time last]`, NaN where they are not constant."""
        none = np.zeros((0, len(self.coordinates) + 1))
        return traced_with(slopes, self) if self.stops else none

    def states(self, mode: Whole) -> Any:
        """-1, 0, 1 or 2 for each contact, backward to open; 0 or 2 for each stop, closed or open."""
        return states_of(mode, len(self.contact_directions), len(self.stops))

    def mode_of(self, states: PyTree) -> Any:
        """The mode with these states."""
        return mode_of(list(states), len(self.stops))

    def held(self, t: Numeric, at: Instant, states: PyTree, args: PyTree) -> list[Any]:
        """Force in each contact and each stop if it is at rest."""
        machine = cast("AbstractMechanism", self)
        force, gamma = loaded(machine, at, states), surface_accelerations(machine, t, at, args)
        held: list[Any] = [0.0] * len(states)
        for island in machine.islands:
            motion = motion_of(island, at, states, force, gamma)
            for c, borne in zip(island.rows, motion.force, strict=True):
                held[c] = borne
        return held

    @check_arguments(**OBSERVABLE)
    def stop_forces(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree = None) -> dict[str, Any]:
        """Force of each stop on the mechanism, along the gradient of its gap [N], by name.

        0 where it is open. A stop that shares its load with contacts at rest in no unique way bears
        what those that lead leave to it.
        """
        at = cast("AbstractMechanism", self).instant(t, y, args)
        states = self.states(mode)
        first = len(at.contacts)
        held = self.held(t, at, states, args)
        return {
            name: where(states[first + k] == 0.0, held[first + k], 0.0)
            for k, name in enumerate(self.stops)
        }

    def drives_of_stops(self, t: Numeric, y: PyTree, mode: Whole, args: PyTree) -> dict[str, Any]:
        """Power of each stop that moves [W], by name, while the mechanism rests on it."""
        stops = cast("AbstractMechanism", self).instant(t, y, args).stops
        moving = [k for k, stop in enumerate(stops) if not is_zero(stop.rate)]
        borne = self.stop_forces(t, y, mode, args) if moving else {}
        names = {k: self.names.stops[k] for k in moving}
        return {f"drive of {name}": -borne[name] * stops[k].rate for k, name in names.items()}
