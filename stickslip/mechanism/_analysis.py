"""Structure of a declaration: what inertia couples, and what changes with time, state and `args`."""

from typing import Any

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np

from stickslip._validation import DeclarationError, refusal
from stickslip.hybrid.dependence import NONE, degrees

from ._abstract import abstract, numbers_of, traced_with, with_numbers
from ._abstract_declaration import AbstractDeclaration
from ._any_args import Looked, Sealed, with_any_args
from ._contact import drags
from ._declaration import at_zero, coordinates_type, in_order, mass_of
from ._folding import affine_forms
from ._gaps import constant_slopes, slopes_under
from ._known import numbers_from
from ._scalars import is_zero


def coupled_velocities(declaration: AbstractDeclaration) -> np.ndarray:
    """Which velocities the inertia couples, as booleans `[n, n]`."""
    names, seen = declaration.names, []

    def entries(q):
        seen.append(mass_of(declaration.mass_matrix(q), names.coordinates).full)
        return 0.0

    jax.eval_shape(entries, at_zero(names)[0])
    found = np.eye(len(names.coordinates), dtype=bool)
    if seen[0] is not None:
        found = np.array([[not is_zero(x) for x in row] for row in seen[0]])
    return found | found.T


def inertia_forms(declaration: AbstractDeclaration) -> np.ndarray | None:
    """A full mass matrix as a sum of constant ones, one for each number that it is affine in.

    An array `[k, n, n]`. None where the mass is diagonal, and where one of its entries is not affine in
    parameters and coordinates: a combination of entries that vanishes in each of the sum
    vanishes everywhere.
    """
    names = declaration.names
    leaves, form = abstract(declaration)

    def entries(numbers, q):
        whole = jax.tree.unflatten(form, with_numbers(leaves, numbers))
        mass = whole.mass_matrix(coordinates_type(names.places)(*q))
        full = mass_of(mass, names.coordinates).full
        return [jnp.asarray(x, jnp.float64) + 0.0 for row in full or [] for x in row]

    scalar = jax.ShapeDtypeStruct((), jnp.float64)
    q = [None if name in names.cyclic else scalar for name in names.places]
    found = affine_forms(entries, (numbers_of(leaves), q))
    known = [x for x in found if x is not None]
    if not found or len(known) < len(found):
        return None
    n = len(names.coordinates)
    parts = np.array(known).T
    return parts[(parts != 0.0).any(axis=1)].reshape(-1, n, n)


def _steady_under(declaration: AbstractDeclaration, args: Any) -> set[int]:
    """Contacts whose normal force changes neither with time nor with the state under `args`."""
    names = declaration.names

    def loads(t, q, v):
        contacts = in_order("contacts(...)", declaration.contacts(t, q, v, args), names.contacts, "")
        return [jnp.asarray(c.normal_force, jnp.float64) + 0.0 for c in contacts]

    found = degrees(loads, (jnp.zeros(()), *at_zero(names)), (True,) * 3)
    return {c for c, degree in enumerate(found) if degree == NONE}


def steady_contacts(declaration: AbstractDeclaration) -> set[int]:
    """The same whatever `args` are."""
    return with_any_args(lambda args: _steady_under(declaration, args))


def contacts_without_drag(declaration: AbstractDeclaration) -> set[int]:
    """Contacts whose law resists by their normal force alone, whatever `args` are."""
    names = declaration.names

    def under(args):
        found = set()

        def laws(t, q, v):
            contacts = in_order(
                "contacts(...)", declaration.contacts(t, q, v, args), names.contacts, ""
            )
            found.update(c for c, contact in enumerate(contacts) if not drags(contact.law))
            return 0.0

        jax.eval_shape(laws, jnp.zeros(()), *at_zero(names))
        return found

    return with_any_args(under)


def check_args(declaration: AbstractDeclaration, args: Any) -> None:
    """Raise for `args` under which something changes that is known to be constant without them."""
    if args is not None:
        changed = traced_with(_changed_by, (declaration, args))
        if changed:
            allowed = "that whatever the kind of `args`, or depend on them otherwise than by it"
            why = "constant without `args`, but not with these"
            raise DeclarationError(str(refusal(changed[0], why, allowed)))


def _changed_by(given: tuple[AbstractDeclaration, Any]) -> list[str]:
    """Dependence that a declaration states so: it asks for `type(args)`, which nothing shows before the
    run."""
    declaration, args = given
    names = declaration.names
    loads, gaps = steady_contacts(declaration), constant_slopes(declaration)
    try:
        loads = loads - _steady_under(declaration, args) if loads else loads
        gaps = gaps - slopes_under(declaration, args) if gaps else gaps
    except Exception:
        return []  # whole numbers in `args` are none here: the run has them as they are
    found = [f"the normal force of contact {names.contacts[c]!r}" for c in loads]
    return found + [f"the slope of the gap of stop {names.stops[k]!r}" for k, *_ in gaps]


def sampled_directions(given: tuple[AbstractDeclaration, Any]) -> list[np.ndarray]:
    """Directions of all contacts [contact, coordinate] for two sets of numbers in general position.

    `given`: the declaration and its `args`; None for those that are not known: the list is empty where
    they have a say. Dependence here can raise an error; from independence nothing follows.
    """
    declaration, _ = given
    names = declaration.names
    leaves, form = abstract(given)

    def directions(numbers, t, q, v):
        whole, args = jax.tree.unflatten(form, with_numbers(leaves, numbers))
        args = Sealed() if args is None else args
        contacts = in_order("contacts(...)", whole.contacts(t, q, v, args), names.contacts, "")
        rows = (
            contact.direction if np.isnan(row).any() else row
            for row, contact in zip(declaration.directions, contacts, strict=True)
        )
        entries = (x for row in rows for x in in_order("direction", row, names.coordinates, ""))
        return [jnp.asarray(x, jnp.float64) for x in entries]

    found, random = [], np.random.default_rng(0)
    try:
        shapes = numbers_of(leaves), jnp.zeros(()), *at_zero(names)
        closed = jax.make_jaxpr(directions)(*shapes)
        for _ in range(2):
            numbers = [random.uniform(0.5, 1.5, x.shape) for x in jax.tree.leaves(shapes)]
            entries = numbers_from(closed, numbers)
            if entries is None:
                with jax.ensure_compile_time_eval():
                    entries = jax.jit(jax.extend.core.jaxpr_as_fun(closed))(*numbers)
            found.append(np.array(entries, float).reshape(declaration.directions.shape))
    except (Exception, Looked):
        return []
    return found


def driven_contacts(given: tuple[AbstractDeclaration, Any]) -> tuple[str, ...]:
    """Contacts whose counter surface may move under `args`: all but those of speed 0."""
    (declaration, args), seen = given, []
    names = declaration.names

    def speeds(t, q, v):
        contacts = in_order("contacts(...)", declaration.contacts(t, q, v, args), names.contacts, "")
        seen.extend(not is_zero(contact.surface_speed) for contact in contacts)
        return 0.0

    try:
        jax.eval_shape(speeds, jnp.zeros(()), *at_zero(names))
    except Exception:  # whole numbers in `args` are no such here; the run has them as they are
        return names.contacts
    return tuple(name for name, moves in zip(names.contacts, seen, strict=True) if moves)
