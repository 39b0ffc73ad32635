"""Declarations that cannot be right are refused by name, before anything compiles."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from stickslip._validation import DeclarationError, is_concrete, refusal
from stickslip.friction import AbstractFrictionLaw

from ._contact import Contact
from ._declaration import coordinates_type, directions_of, in_order, mass_of


def check_declaration(mechanism: Any) -> None:
    """Raise `ValueError` or `TypeError` naming what a mechanism declares wrongly."""
    for name in ("coordinates", "contact_directions"):
        if not isinstance(getattr(mechanism, name), Mapping):
            raise refusal(name, getattr(mechanism, name), "a mapping by name", TypeError)
    coordinates = mechanism.coordinates
    if not coordinates:
        raise refusal("coordinates", coordinates, "a mapping from at least one name to its unit")
    for name, unit in coordinates.items():
        if not isinstance(name, str) or not name.isidentifier() or name.startswith("_"):
            raise refusal("coordinates", name, "names that are identifiers, as fields of the state")
        if not isinstance(unit, str):
            raise refusal(f"coordinates[{name!r}]", unit, "a unit, such as 'm'", TypeError)
    for name in mechanism.velocities:
        if name not in coordinates:
            choices = ", ".join(map(repr, coordinates))
            raise refusal("velocities", name, f"a mapping with keys out of {choices}")
    names = mechanism.names
    fields = (*names.coordinates, *names.velocities)
    for name in fields:
        if fields.count(name) > 1:
            raise refusal("velocities", name, "a name that no other coordinate or velocity has")
    for name in names.contacts:
        if not isinstance(name, str) or not name or " / " in name:
            raise refusal("contact_directions", name, "names of contacts: texts without ' / '")
    for name in names.opening:
        if name not in names.contacts:
            raise refusal("opening", name, f"names of contacts: {', '.join(map(repr, names.contacts))}")
    if len(names.contacts) > 31:
        raise refusal("contact_directions", len(names.contacts), "at most 31 contacts")
    directions_of(mechanism.contact_directions, names.coordinates)
    for island in mechanism.islands:
        if island.dependent and not hasattr(island, "lines"):
            those = ", ".join(names.contacts[c] for c in island.rows)
            why = "constant where they depend on each other, of at most 12 contacts of a group"
            raise refusal("contact_directions", those, why)
    _check_mass(mechanism)


def _check_mass(mechanism: Any) -> None:
    """Refuse a mass matrix that is not symmetric positive definite where the coordinates are 0."""
    names = mechanism.names.coordinates
    given = mechanism.mass_matrix(coordinates_type(names)(*[0.0] * len(names)))
    mass = mass_of(given, names)
    entries = mass.diagonal if mass.full is None else [x for row in mass.full for x in row]
    if not all(is_concrete(x) for x in entries) or any(np.ndim(x) for x in entries):
        return  # traced, or one for each lane
    if mass.full is None:
        for name, m in zip(names, entries, strict=True):
            if not float(m) > 0.0 or not np.isfinite(float(m)):
                raise refusal(f"mass_matrix(q)[{name!r}]", float(m), "finite and positive")
        return
    matrix = np.array([[float(x) for x in row] for row in mass.full])
    if not np.isfinite(matrix).all() or not np.allclose(matrix, matrix.T, rtol=1e-12, atol=0.0):
        raise refusal("mass_matrix(q)", matrix.tolist(), "finite and symmetric")
    if np.linalg.eigvalsh(matrix).min() <= 0.0:
        raise refusal("mass_matrix(q)", matrix.tolist(), "positive definite")


def check_contacts(mechanism: Any, given: Any) -> list[Contact]:
    """The contacts in order, with laws that the event-driven form admits."""
    names = mechanism.names.contacts
    if isinstance(given, Mapping):
        missing = [name for name in names if name not in given]
        if missing:
            raise refusal("contacts(t, q, v, args)", sorted(given), f"a Contact for {missing[0]!r} too")
    contacts = in_order("contacts(t, q, v, args)", given, names, "a Contact for each") if names else []
    for name, contact in zip(names, contacts, strict=True):
        if not isinstance(contact, Contact):
            raise refusal(f"contacts(...)[{name!r}]", contact, "a Contact", TypeError)
    return contacts


def check_law(name: str, law: Any) -> None:
    """Refuse a law that has no set-valued form, by the name of its contact."""
    if not isinstance(law, AbstractFrictionLaw):
        what = f"the law of contact {name!r}"
        raise DeclarationError(str(refusal(what, law, "a friction law of stickslip.friction")))
    if law.num_states or not law.set_valued:
        form = "bristles" if law.num_states else "regularised"
        why = f"a set-valued law without internal state; `.{form}()` of the mechanism takes this one"
        raise DeclarationError(str(refusal(f"the law of contact {name!r}", law, why)))


def check_load(name: str, load: Any) -> None:
    """Refuse a contact that pulls."""
    if not np.all(np.asarray(load) >= 0.0):
        raise refusal(f"the normal force of contact {name!r} at the start", load, "not negative")
