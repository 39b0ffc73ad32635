"""One instant of a mechanism, evaluated: what is declared then, and what follows when asked for."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._validation import DeclarationError, refusal
from stickslip.hybrid.dependence import NONE, degrees

from ._abstract_declaration import AbstractDeclaration
from ._contact import contacts_in_order
from ._declaration import in_order, mass_of
from ._first_order import rates_of
from ._gaps import stops_at
from ._group import AbstractContactGroup
from ._instant import Instant, floats
from ._local import LocalInstant
from ._scalars import times, total
from ._search import relative
from ._structure import Structure


def moment_of(
    declaration: AbstractDeclaration, structure: Structure, t: Any, q: Any, v: Any, args: Any
) -> "Moment":
    """A mechanism at time `t`, at the coordinates `q` with the rates `v`."""
    coordinates = structure.names.coordinates
    force = in_order("forces(t, q, v, args)", declaration.forces(t, q, v, args), coordinates, "forces")
    mass = mass_of(declaration.mass_matrix(q), coordinates)
    rates = rates_of(declaration, t, q, v, args)
    contacts, directions, speeds, stops, surfaces = touching(declaration, structure, t, q, v, args)
    pushes = []
    for name, contact in zip(structure.names.contacts, contacts, strict=True):
        push, what = contact.normal_direction, f"contacts(...)[{name!r}].normal_direction"
        pushes.append(None if push is None else in_order(what, push, coordinates, "numbers"))
    at = Instant(q, v, mass, force, contacts, directions, speeds, stops, surfaces, rates, pushes)
    return Moment(declaration, structure, t, at, args)


def touching(
    declaration: AbstractDeclaration, structure: Structure, t: Any, q: Any, v: Any, args: Any
) -> tuple:
    """Contacts, directions, speeds, stops and surfaces, as an `Instant` has them."""
    names = structure.names
    contacts = contacts_in_order(names.contacts, declaration.contacts(t, q, v, args))
    rows = []
    for name, row, contact in zip(names.contacts, structure.directions, contacts, strict=True):
        if np.isnan(row).any():
            what = f"contacts(...)[{name!r}].direction"
            rows.append(in_order(what, contact.direction, names.coordinates, "numbers"))
        elif contact.direction is not None:
            allowed = "left out, as `contact_directions` has constant numbers for it"
            raise refusal(f"contacts(...)[{name!r}].direction", contact.direction, allowed)
        else:
            rows.append([float(x) for x in row])
    stops = stops_at(declaration, structure.slopes, t, q, args)
    rows += [stop.row for stop in stops]
    surfaces = [contact.surface_speed for contact in contacts]
    surfaces += [times(-1.0, stop.rate) for stop in stops]
    speeds = list(relative(rows, v, surfaces))
    return contacts, rows, speeds, stops, surfaces


class Moment:
    """A mechanism at time `t`: its `structure`, the instant `at`, and the declaration for rates.

    The verbs of a mechanism (`_verbs`) are functions of a moment and of states of the contacts.
    """

    def __init__(
        self, declaration: AbstractDeclaration, structure: Structure, t: Any, at: Instant, args: Any
    ):
        self.declaration, self.structure, self.at = declaration, structure, at
        self.t, self.args = t, args

    def moved_to(self, q: Any, v: Any) -> "Moment":
        """The same instant at other coordinates and velocities."""
        q, v = type(self.at.q)(*q), type(self.at.v)(*v)
        return moment_of(self.declaration, self.structure, self.t, q, v, self.args)

    def touching(self, t: Any, q: Any, v: Any) -> tuple:
        """`touching` at another time and place."""
        return touching(self.declaration, self.structure, t, q, v, self.args)

    def of(self, group: AbstractContactGroup) -> LocalInstant:
        """The part of a group."""
        together = self.declaration.motion_together
        return LocalInstant(group.part, self.at, self.surface_accelerations, together, group.row)

    def load(self, c: int) -> tuple[Any, Any]:
        """Normal force of contact `c`, and its rate by time and coordinates."""

        def load(t, q):
            return jnp.asarray(self.touching(t, q, self.at.v)[0][c].normal_force, jnp.float64) + 0.0 * t

        t = jnp.asarray(self.t, jnp.float64)
        return jax.jvp(load, (t, floats(self.at.q)), (jnp.ones_like(t), floats(self.at.q_rate)))

    @functools.cached_property
    def surface_accelerations(self) -> list[Any]:
        r"""$\gamma = \dot w - \dot n \cdot v$: what $n \cdot a$ is while the contact rests.

        The constant 0 where neither direction nor surface speed depends on time or coordinates. Raises
        `DeclarationError` where one of them depends on the velocities.
        """
        at, names = self.at, self.structure.names.contacts
        if not at.speeds:
            return []

        def speeds(t, q):
            return self.touching(t, q, at.v)[2]

        def speeds_of_surfaces(v):
            contacts, rows, *_ = self.touching(t, at.q, v)
            return [
                sum(jnp.asarray(x, jnp.float64) + 0.0 for x in (contact.surface_speed, *row))
                for contact, row in zip(contacts, rows, strict=False)
            ]

        t = jnp.asarray(self.t, jnp.float64)
        q, v, q_rate = floats(at.q), floats(at.v), floats(at.q_rate)
        for name, depends in zip(
            names, degrees(speeds_of_surfaces, (v,), (True,)) if names else [], strict=True
        ):
            if depends != NONE:
                what = f"surface_speed and direction of contact {name!r}"
                allowed = (
                    "functions of time and coordinates (a surface that moves belongs to the direction)"
                )
                raise DeclarationError(str(refusal(what, "functions of the velocities", allowed)))
        depends = degrees(speeds, (t, q), (True, True))
        if all(d == NONE for d in depends):
            return [0.0] * len(depends)
        self._check_surfaces([c for c, d in enumerate(depends) if d != NONE])
        rates = jax.jvp(speeds, (t, q), (jnp.ones_like(t), q_rate))[1]
        return [0.0 if d == NONE else -r for d, r in zip(depends, rates, strict=True)]

    def _check_surfaces(self, moving: list[int]) -> None:
        """Raise for surfaces that move or turn beside others on which something would rest as well."""
        slopes, count = self.structure.slopes, len(self.structure.names.contacts)
        # Of one velocity a stop without a speed of its own holds everything that is at rest.
        still = [count + k for k, rate in enumerate(slopes[:, -1]) if rate == 0.0]
        for group in self.structure.contact_groups:
            moves = [c for c in group.rows if c in moving]
            rows = group.not_followed(moves, still, functools.partial(self._is_straight, group))
            if rows:
                others = ", ".join(
                    self.structure.names_of_rows([c for c in group.rows if c not in rows])
                )
                beside = f" beside {others}" if others else ""
                allowed = (
                    f"of constant speed{beside}: what rests on two surfaces cannot follow both. Stops "
                    "and contacts of constant directions may move where they touch one coordinate that "
                    "nothing couples with another, and where no direction depends on others; else put "
                    "a stiff spring in place of one"
                )
                what = "surfaces of contacts and stops whose directions depend on each other"
                those = ", ".join(self.structure.names_of_rows(rows))
                raise DeclarationError(str(refusal(what, those, allowed)))

    def _is_straight(self, group: AbstractContactGroup) -> bool:
        """Whether the directions of all contacts of a group are constant during a run."""
        if not np.isnan(group.directions[: group.contacts]).any():
            return True

        def directions(t, q):
            rows = self.touching(t, q, self.at.v)[1]
            return [jnp.asarray(total(rows[c])) + 0.0 for c in group.rows[: group.contacts]]

        operands = jnp.asarray(self.t, jnp.float64), floats(self.at.q)
        return all(d == NONE for d in degrees(directions, operands, (True, True)))
