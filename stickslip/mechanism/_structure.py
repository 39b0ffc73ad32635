"""Structure of a mechanism: all that its declaration says once and for all, found once by tracing."""

import functools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from stickslip._validation import DeclarationError, refusal

from ._abstract_declaration import AbstractDeclaration
from ._analysis import coupled_velocities, inertia_forms, steady_contacts
from ._declaration import Names
from ._gaps import slope_table
from ._group import AbstractContactGroup
from ._kinds import group_of
from ._local import Part


class GuardNumbers(NamedTuple):
    """Numbers of the guards: `own` of each contact (two where it has a second one), and of each stop;
    `joint` of groups, by their first contact; those of contacts that `open`, or `lift` without; and
    how `many` there are."""

    own: dict[int, tuple[int, ...]]
    joint: dict[int, int]
    opens: dict[int, int]
    lifts: dict[int, int]
    stops: dict[int, int]
    many: int


class Structure:
    """All that a declaration says once and for all, whatever its numbers.

    - `names`; `directions` of the contacts `[contact, coordinate]` and `slopes` of the gaps
      `[stop, coordinate, and time last]`, NaN where they are not constant;
    - `groups`: velocities that contacts and inertia couple, with what is on them;
    - `opening`, `lifting`: contacts that open, and others that may lose their normal force;
      `two_sided`: those with a guard for each limit of their friction.
    """

    def __init__(
        self, names: Names, directions: np.ndarray, slopes: np.ndarray, parts: list[Part],
        lifting: tuple[int, ...], two_sided: tuple[int, ...],
    ):  # fmt: skip
        self.names, self.directions, self.slopes = names, directions, slopes
        self.opening = tuple(names.contacts.index(name) for name in names.opening)
        self.lifting, self.two_sided = lifting, two_sided
        self.groups = tuple(self._group_of(part) for part in parts)

    def _group_of(self, part: Part) -> AbstractContactGroup:
        found = group_of(part)
        if found is None:
            raise self.dependent(part)
        return found

    def dependent(self, part: Part) -> Exception:
        """The error of a group whose directions depend on each other as no kind of groups allows."""
        those = ", ".join(self.names_of_rows(part.rows))
        why = "constant where they depend on each other, of at most 12 contacts of a group"
        if not part.stops:
            return refusal("contact_directions", those, why)
        return DeclarationError(str(refusal("directions of contacts and stops", those, why)))

    def names_of_rows(self, rows: tuple[int, ...] | list[int]) -> list[str]:
        """Names of some of the contacts and stops."""
        names = self.names.contacts + self.names.stops
        return [names[c] for c in rows]

    @functools.cached_property
    def contact_groups(self) -> tuple[AbstractContactGroup, ...]:
        """Groups that have a contact or a stop."""
        return tuple(group for group in self.groups if group.rows)

    @functools.cached_property
    def guards(self) -> GuardNumbers:
        """The numbers of all guards, in the order of `guard_names`."""
        count = len(self.names.contacts)
        own: dict[int, tuple[int, ...]] = {c: (c,) for c in range(count)}
        own.update({c: (c, count + k) for k, c in enumerate(self.two_sided)})
        after = iter(range(count + len(self.two_sided), 10**6))
        joint = {group.rows[0]: next(after) for group in self.contact_groups if group.joint_guards}
        opens, lifts = ({c: next(after) for c in those} for those in (self.opening, self.lifting))
        stops = {count + k: next(after) for k in range(len(self.names.stops))}
        return GuardNumbers(own, joint, opens, lifts, stops, next(after))

    @property
    def guard_names(self) -> tuple[str, ...]:
        """One guard per contact, and per second limit of its friction, per group of dependent contacts,
        per contact that may open or lose its normal force, per stop."""
        names = self.names
        own = [f"{name} stops or gives way" for name in names.contacts]
        own += [f"{names.contacts[c]} gives way forward" for c in self.two_sided]
        for group in self.contact_groups:
            if group.joint_guards:
                own.append(" and ".join(self.names_of_rows(group.rows)) + " give way")
        own += [f"{name} opens or closes" for name in names.opening]
        own += [f"{names.contacts[c]} loses its normal force" for c in self.lifting]
        return (*own, *(f"{name} is met or left" for name in names.stops))


def structure_of(declaration: AbstractDeclaration) -> Structure:
    """The structure of a mechanism."""
    return structure_with(declaration, declaration.two_sided_contacts)


def structure_with(declaration: AbstractDeclaration, two_sided: tuple[int, ...]) -> Structure:
    """The structure of a mechanism of which these contacts have two guards."""
    names, directions, slopes = declaration.names, declaration.directions, slope_table(declaration)
    for name, row in zip(names.stops, slopes[:, :-1], strict=True):
        if not row.any():
            why = "a function of the coordinates"
            raise DeclarationError(str(refusal(f"the gap of stop {name!r}", "a constant", why)))
    steady = steady_contacts(declaration)
    opening = tuple(names.contacts.index(name) for name in names.opening)
    others = {*opening, *steady, *map(names.contacts.index, declaration.rubbing)}
    lifting = tuple(c for c in range(len(names.contacts)) if c not in others)
    J = np.vstack([directions, slopes[:, :-1]])
    inertia = inertia_forms(declaration)
    rubbing = tuple(
        (names.contacts.index(name), len(names.contacts) + names.stops.index(stop))
        for name, stop in declaration.rubbing.items()
    )
    planar = tuple(
        (names.contacts.index(first), names.contacts.index(second))
        for first, second in declaration.planar.items()
    )
    coupled = coupled_velocities(declaration)
    parts = [
        Part(columns, rows, J[np.ix_(rows, columns)],
             None if inertia is None else inertia[:, columns][:, :, columns],
             sum(c >= len(directions) for c in rows), opening, lifting, two_sided,
             tuple(pair for pair in rubbing if pair[0] in rows),
             tuple(pair for pair in planar if pair[0] in rows),
             bool(coupled[np.ix_(columns, columns)].sum() > len(columns)),
             tuple((names.contacts + names.stops)[c] for c in rows))
        for columns, rows in _coupled_sets(J, coupled, rubbing + planar)
    ]  # fmt: skip
    return Structure(names, directions, slopes, parts, lifting, two_sided)


def _coupled_sets(
    J: np.ndarray, inertia: np.ndarray, pairs: tuple[tuple[int, int], ...]
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Velocities that contacts or inertia couple, and the contacts and stops on them.

    Contacts of different groups cannot change each other's accelerations, so each group is treated
    alone: the cost of a mechanism grows with the sizes of its groups, not with the number of modes.
    """
    joined, n = inertia.copy(), J.shape[1]
    touches = np.isnan(J) | (J != 0)
    for touched in (*touches, *(touches[c] | touches[k] for c, k in pairs)):
        joined |= np.outer(touched, touched)
    label = list(range(n))
    for _ in range(n):
        for i, j in zip(*np.nonzero(joined), strict=True):
            label[i] = label[j] = min(label[i], label[j])
    for one in sorted(set(label)):
        columns = tuple(j for j in range(n) if label[j] == one)
        yield columns, tuple(c for c in range(len(J)) if touches[c, columns].any())
