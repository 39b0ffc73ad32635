"""The kinds of groups of contacts, and the one place where the kind of a group is chosen."""

from ._dependent import DependentContacts, DependentWithStops
from ._group import AbstractContactGroup
from ._independent import CoupledContacts, FreeVelocities, SeparateContacts
from ._local import Part
from ._one_velocity import ContactsOnOneVelocity, StopsOnOneVelocity
from ._planar import PlanarContact
from ._rubbing_stop import RubbingStop
from ._varying import VaryingContacts

KINDS: tuple[type[AbstractContactGroup], ...] = (
    FreeVelocities,
    PlanarContact,
    RubbingStop,
    StopsOnOneVelocity,
    ContactsOnOneVelocity,
    VaryingContacts,
    SeparateContacts,
    CoupledContacts,
    DependentContacts,
    DependentWithStops,
)


def group_of(part: Part) -> AbstractContactGroup | None:
    """The group declared so, of the first kind that takes it; None where no kind does."""
    return next((kind(part) for kind in KINDS if kind.takes(part)), None)
