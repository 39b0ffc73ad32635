"""The state of a mechanism: coordinates, their rates, and states of first order, by name."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, cast

from jaxtyping import PyTree

from stickslip._types import Numeric, overridable
from stickslip._validation import as_parameter, check_finite
from stickslip.hybrid.components import per_second

from ._declaration import Names, coordinates_type, state_type
from .account import AbstractMechanicalSystem

if not TYPE_CHECKING:
    from equinox import AbstractClassVar


class AbstractWithStates(AbstractMechanicalSystem):
    """A part of `AbstractMechanism`, which says what it declares."""

    if TYPE_CHECKING:
        # Not annotated, for the reason given in `AbstractHybridSystem`.
        coordinates = cast("Mapping[str, str]", {})
        first_order = cast("Mapping[str, str]", {})
        cyclic = cast("tuple[str, ...]", ())
        contact_directions = cast("Mapping[str, Any]", {})
        velocities = cast("Mapping[str, str]", {})
        opening = cast("tuple[str, ...]", ())
        stops = cast("tuple[str, ...]", ())
        state_class = cast("type | None", None)
    else:
        coordinates: AbstractClassVar[Mapping[str, str]]
        first_order: ClassVar[Mapping[str, str]] = {}
        cyclic: ClassVar[tuple[str, ...]] = ()
        contact_directions: ClassVar[Mapping[str, Any]] = {}
        velocities: ClassVar[Mapping[str, str]] = {}
        opening: ClassVar[tuple[str, ...]] = ()
        stops: ClassVar[tuple[str, ...]] = ()
        state_class: ClassVar[type | None] = None

    def rates(self, t: Numeric, q: PyTree, v: PyTree, args: PyTree) -> Mapping[str, Any]:
        """The rate of each state in `first_order`, by name."""
        return {}

    @property
    def names(self) -> Names:
        """Names of coordinates, velocities, contacts, those that open, stops and first-order states."""
        coordinates = tuple(self.coordinates)
        velocities = tuple(self.velocities.get(name, f"v_{name}") for name in coordinates)
        contacts, opening = tuple(self.contact_directions), tuple(self.opening)
        others = tuple(self.stops), tuple(self.first_order), tuple(self.cyclic)
        return Names(coordinates, velocities, contacts, opening, *others)

    @overridable
    def units(self) -> dict[str, str]:
        """Those of the coordinates, of their rates, and of the states of first order."""
        names, given = self.names, self.coordinates
        rates = {
            v: per_second(given[q]) for q, v in zip(names.coordinates, names.velocities, strict=True)
        }
        kept = {q: unit for q, unit in given.items() if q not in names.cyclic}
        return {**kept, **rates, **self.first_order}

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
        return (
            coordinates_type(names.places)(*[self._of(y, name) for name in names.places]),
            coordinates_type(names.coordinates)(*[getattr(y, name) for name in names.velocities]),
        )

    def _of(self, y: PyTree, name: str) -> Any:
        return None if name in self.cyclic else getattr(y, name)
