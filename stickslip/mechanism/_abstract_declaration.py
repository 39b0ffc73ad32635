"""Declaration of a mechanism: the abstract class that all analyses and evaluations are given."""

import abc
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from jaxtyping import PyTree

from stickslip._types import Numeric, Whole, overridable
from stickslip._validation import as_parameter, check_finite
from stickslip.hybrid.components import per_second

from ._contact import Contact
from ._declaration import Names, coordinates_type, directions_of, state_type
from ._modes import mode_of, states_of
from ._rows import NumberRow
from ._scalars import Mass
from ._stop import Stop
from .account import AbstractMechanicalSystem

if not TYPE_CHECKING:
    from equinox import AbstractClassVar


class AbstractDeclaration(AbstractMechanicalSystem):
    """The part of `AbstractMechanism` that a user declares, with its names and states."""

    if TYPE_CHECKING:
        # Not annotated, for the reason given in `AbstractHybridSystem`.
        coordinates = cast("Mapping[str, str]", {})
        first_order = cast("Mapping[str, str]", {})
        cyclic = cast("tuple[str, ...]", ())
        contact_directions = cast("Mapping[str, Any]", {})
        velocities = cast("Mapping[str, str]", {})
        opening = cast("tuple[str, ...]", ())
        stops = cast("tuple[str, ...]", ())
        rubbing = cast("Mapping[str, str]", {})
        planar = cast("Mapping[str, str]", {})
        state_class = cast("type | None", None)
    else:
        coordinates: AbstractClassVar[Mapping[str, str]]
        first_order: ClassVar[Mapping[str, str]] = {}
        cyclic: ClassVar[tuple[str, ...]] = ()
        contact_directions: ClassVar[Mapping[str, Any]] = {}
        velocities: ClassVar[Mapping[str, str]] = {}
        opening: ClassVar[tuple[str, ...]] = ()
        stops: ClassVar[tuple[str, ...]] = ()
        rubbing: ClassVar[Mapping[str, str]] = {}
        planar: ClassVar[Mapping[str, str]] = {}
        state_class: ClassVar[type | None] = None

    @abc.abstractmethod
    def mass_matrix(self, q: PyTree) -> Any:
        """Inertia: a mass for each coordinate, or the rows of a symmetric positive definite matrix.

        A mapping by coordinate or a sequence in their order, its entries numbers or again such rows.
        A row is an array in a sequence only: by name, arrays are masses of many lanes.
        """

    @abc.abstractmethod
    def forces(self, t: Numeric, q: PyTree, v: PyTree, args: PyTree) -> Any:
        """Generalised forces [N] other than those of the contacts, gyroscopic ones too.

        A mapping by coordinate, where a missing one is 0, or a sequence in their order.
        """

    def contacts(
        self, t: Numeric, q: PyTree, v: PyTree, args: PyTree
    ) -> Mapping[str, Contact] | Sequence[Contact]:
        """A `Contact` for each name in `contact_directions`."""
        return {}

    def gaps(self, t: Numeric, q: PyTree, args: PyTree) -> Mapping[str, Stop]:
        """A `Stop` for each name in `stops`; the gradient of its gap by `q` is its direction."""
        return {}

    def rates(self, t: Numeric, q: PyTree, v: PyTree, args: PyTree) -> Mapping[str, Any]:
        """The rate of each state in `first_order`, by name."""
        return {}

    def switches(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, t: Numeric, q: PyTree, v: PyTree, args: PyTree
    ) -> tuple:
        """Scalars at whose changes of sign a force bends or jumps without showing it.

        `AbstractHybridSystem.switches` says which those are, and what follows.
        """
        return ()

    def potential_energy(self, q: PyTree) -> Any:
        """Potential energy [J] of those forces that have one; 0 if left out.

        Energy in states of first order belongs to it too, as $\\frac12 L i^2$ of a winding.
        """
        return 0.0

    # -- what follows, as far as it is needed to evaluate a declaration

    @property
    @abc.abstractmethod
    def two_sided_contacts(self) -> tuple[int, ...]:
        """Contacts with a guard for each of the two limits of their friction at rest."""

    @abc.abstractmethod
    def motion_together(self, group: Any, mass: Mass, force: NumberRow, rest: NumberRow) -> tuple:
        """Motion of dependent contacts: acceleration of each velocity, and force of all in `rest`."""

    # -- names, states and modes

    @property
    def names(self) -> Names:
        """Names of coordinates, velocities, contacts, those that open, stops and first-order states."""
        coordinates = tuple(self.coordinates)
        velocities = tuple(self.velocities.get(name, f"v_{name}") for name in coordinates)
        contacts, opening = tuple(self.contact_directions), tuple(self.opening)
        others = tuple(self.stops), tuple(self.first_order), tuple(self.cyclic)
        return Names(coordinates, velocities, contacts, opening, *others)

    @property
    def directions(self) -> np.ndarray:
        """Directions of the contacts `[contact, coordinate]`, NaN where `contacts` returns them."""
        return directions_of(self.contact_directions, tuple(self.coordinates))

    @overridable
    def units(self) -> dict[str, str]:
        """Those of the coordinates, of their rates, and of the states of first order."""
        names, given = self.names, self.coordinates
        rates = {
            v: per_second(given[q]) for q, v in zip(names.coordinates, names.velocities, strict=True)
        }
        kept = {q: unit for q, unit in given.items() if q not in names.cyclic}
        return {**kept, **rates, **self.first_order}

    def states(self, mode: Whole) -> Any:
        """-1, 0, 1 or 2 for each contact, backward to open; 0 or 2 for each stop, closed or open."""
        return states_of(mode, len(self.contact_directions), len(self.stops))

    def mode_of(self, states: PyTree) -> Any:
        """The mode with these states."""
        return mode_of(list(states), len(self.stops))

    def state(self, **values: Numeric) -> Any:
        """A state by the names of its components; what is left out is 0.

        **Raises** `TypeError` for an unknown name, `ValueError` for a value that is not finite.
        """
        names = self.names
        known = (*names.kept, *names.velocities)
        for name in values:
            if name not in known:
                raise TypeError(f"state() has no component {name!r}: there are {', '.join(known)}.")
        numbers = [as_parameter(check_finite(name, values.get(name, 0.0))) for name in known]
        return self._kind(known)(**dict(zip(known, numbers, strict=True)))

    def from_coordinates(self, q: PyTree, v: PyTree) -> Any:
        """The state of these coordinates (after them the states of first order) and velocities.

        Linear, so that it takes rates too.
        """
        names = self.names
        known = (*names.kept, *names.velocities)
        places = [x for name, x in zip(names.places, q, strict=True) if name not in names.cyclic]
        return self._kind(known)(**dict(zip(known, (*places, *v), strict=True)))

    def _kind(self, names: tuple[str, ...]) -> type:
        return self.state_class or state_type(names)

    def to_coordinates(self, y: PyTree) -> tuple[Any, Any]:
        """Coordinates (after them the states of first order) and velocities of a state.

        The velocities have the names of the coordinates.
        """
        names = self.names
        places = [None if name in names.cyclic else getattr(y, name) for name in names.places]
        return (
            coordinates_type(names.places)(*places),
            coordinates_type(names.coordinates)(*[getattr(y, name) for name in names.velocities]),
        )
