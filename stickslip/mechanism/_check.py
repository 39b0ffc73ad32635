"""Errors for declarations that cannot be right, by name, before anything compiles."""

import keyword
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from stickslip._validation import DeclarationError, is_concrete, refusal
from stickslip.hybrid.accuracy import ACCURACY as ENGINE
from stickslip.hybrid.dependence import NONE, degrees

from ._abstract import traced_with
from ._abstract_declaration import AbstractDeclaration
from ._analysis import sampled_directions
from ._declaration import at_zero, directions_of, mass_of
from ._gaps import check_stop_names, check_without_args
from ._known import numbers_known
from ._laws import RESISTING
from ._modes import MOST


def check_declaration(mechanism: Any) -> None:
    """Raise `ValueError` or `TypeError` naming what a mechanism declares wrongly."""
    for name in ("coordinates", "contact_directions"):
        if not isinstance(getattr(mechanism, name), Mapping):
            raise refusal(name, getattr(mechanism, name), "a mapping by name", TypeError)
    coordinates = mechanism.coordinates
    if not coordinates:
        raise refusal("coordinates", coordinates, "a mapping from at least one name to its unit")
    for name, unit in coordinates.items():
        _check_field("coordinates", name)
        if not isinstance(unit, str):
            raise refusal(f"coordinates[{name!r}]", unit, "a unit, such as 'm'", TypeError)
    for name in mechanism.velocities:
        if name not in coordinates:
            choices = ", ".join(map(repr, coordinates))
            raise refusal("velocities", name, f"a mapping with keys out of {choices}")
        _check_field("velocities", mechanism.velocities[name])
    names = mechanism.names
    fields = (*names.coordinates, *names.velocities)
    for name in fields:
        if fields.count(name) > 1:
            raise refusal("velocities", name, "a name that no other coordinate or velocity has")
    _check_first_order(mechanism, fields)
    for name in names.contacts:
        if not isinstance(name, str) or not name or " / " in name:
            raise refusal("contact_directions", name, "names of contacts: texts without ' / '")
    for name in names.opening:
        if name not in names.contacts:
            raise refusal("opening", name, f"names of contacts: {', '.join(map(repr, names.contacts))}")
    if len(names.contacts) > MOST:
        allowed = f"at most {MOST} contacts, whose mode is a number of 64 bits"
        raise refusal("contact_directions", f"{len(names.contacts)} contacts", allowed)
    for name in mechanism.cyclic:
        if name not in coordinates:
            raise refusal("cyclic", name, f"names of coordinates: {', '.join(map(repr, coordinates))}")
    check_stop_names(mechanism)
    for name, stop in mechanism.rubbing.items():
        for one, those, what in (name, names.contacts, "contacts"), (stop, names.stops, "stops"):
            if one not in those:
                raise refusal("rubbing", one, f"names of {what}: {', '.join(map(repr, those))}")
    _check_planar(mechanism)
    directions_of(mechanism.contact_directions, names.coordinates)
    try:
        _check_structure(mechanism)
        check_mass(mechanism)
    except (TypeError, ValueError, IndexError):
        # Parameters of many lanes at once are judged where a lane is traced.
        if not any(np.ndim(leaf) for leaf in jax.tree.leaves(mechanism)):
            raise


def _check_planar(mechanism: Any) -> None:
    given, contacts = mechanism.planar, mechanism.names.contacts
    if not isinstance(given, Mapping):
        raise refusal("planar", given, "a mapping from one contact to another", TypeError)
    both = [*given, *given.values()]
    for name in both:
        if name not in contacts or both.count(name) > 1:
            allowed = f"names of contacts, each at most once: {', '.join(map(repr, contacts))}"
            raise refusal("planar", name, allowed)
    for first, second in given.items():
        if second in mechanism.opening:
            raise refusal("opening", second, f"{first!r}, which opens both of a planar contact")
        for name in first, second:
            if name in mechanism.rubbing:
                raise refusal("rubbing", name, "a contact that is not planar")


def _check_first_order(mechanism: Any, others: tuple[str, ...]) -> None:
    given = mechanism.first_order
    if not isinstance(given, Mapping):
        raise refusal("first_order", given, "a mapping from names to units", TypeError)
    for name, unit in given.items():
        _check_field("first_order", name)
        if name in others:
            raise refusal("first_order", name, "a name that no coordinate and no velocity has")
        if not isinstance(unit, str):
            raise refusal(f"first_order[{name!r}]", unit, "a unit, such as 'A'", TypeError)
    if given and type(mechanism).rates is AbstractDeclaration.rates:
        raise refusal(
            "first_order", tuple(given), "with a method `rates` that returns the rate of each"
        )


def _check_structure(mechanism: Any) -> None:
    if mechanism.stops:
        traced_with(check_without_args, mechanism)
    check_directions(mechanism, None)


def check_directions(mechanism: Any, args: Any) -> None:
    """Raise for directions that vary and always depend on each other; None for unknown `args`."""
    for group in mechanism.structure.contact_groups:
        part = group.part
        if part.in_general_position and _depend(mechanism, part.rows[: part.contacts], args):
            raise mechanism.structure.dependent(part)


def _depend(mechanism: Any, rows: tuple[int, ...], args: Any) -> bool:
    """Whether contacts that may all stick at once have directions that depend on each other."""
    names = mechanism.names
    those = [c for c in rows if names.contacts[c] not in names.opening]
    if len(those) < 2:
        return False
    found = [sample[those] for sample in traced_with(sampled_directions, (mechanism, args))]
    if not found or not np.isfinite(found).all():
        return False
    sizes = [np.linalg.norm(J, axis=1, keepdims=True) + 1e-300 for J in found]
    return all(np.linalg.svd(J / s)[1].min() < ENGINE.zero for J, s in zip(found, sizes, strict=True))


def _check_field(what: str, name: Any) -> None:
    if (
        not isinstance(name, str)
        or not name.isidentifier()
        or name.startswith("_")
        or keyword.iskeyword(name)
    ):
        raise refusal(what, name, "names that are identifiers, as fields of the state")


def check_mass(mechanism: Any, q: Any = None) -> None:
    """Raise for a mass matrix that is not symmetric positive definite at `q`.

    Without `q` only what does not depend on the coordinates is judged: an inertia may vanish somewhere,
    as in polar coordinates.
    """
    if q is None and traced_with(_varies, mechanism):
        return
    q = at_zero(mechanism.names, 0.0)[0] if q is None else q
    entries = numbers_known(inertia_entries, mechanism, q) if is_concrete((mechanism, q)) else None
    entries = inertia_entries(mechanism, q) if entries is None else entries
    _check_inertia(mechanism.names.coordinates, entries)


def _check_inertia(names: tuple[str, ...], entries: list[Any]) -> None:
    if not all(type(x) is float or (is_concrete(x) and not np.ndim(x)) for x in entries):
        return  # traced, or one for each lane
    n, numbers = len(names), [float(x) for x in entries]
    if n == len(numbers):
        for name, m in zip(names, numbers, strict=True):
            if not 0.0 < m < np.inf:
                raise refusal(f"mass_matrix(q)[{name!r}]", m, "finite and positive")
        return
    matrix = np.array(numbers).reshape(n, n)
    # By the inertias that an entry joins: one that cancels in rounding has no size of its own.
    sizes = np.sqrt(np.abs(np.diag(matrix)))
    skew = np.abs(matrix - matrix.T) > 1e-12 * np.outer(sizes, sizes)
    if not np.isfinite(matrix).all() or np.any(skew):
        raise refusal("mass_matrix(q)", matrix.tolist(), "finite and symmetric")
    if np.linalg.eigvalsh(matrix).min() <= 0.0:
        raise refusal("mass_matrix(q)", matrix.tolist(), "positive definite")


def inertia_entries(mechanism: Any, q: Any) -> list[Any]:
    """Entries of the mass matrix: of its diagonal, or row by row."""
    mass = mass_of(mechanism.mass_matrix(q), mechanism.names.coordinates)
    if mass.full is None:
        return list(mass.diagonal or ())
    return [x for row in mass.full for x in row]


def _varies(mechanism: Any) -> bool:
    """Whether the inertia depends on the coordinates."""

    def entries(q):
        return [jnp.asarray(x, jnp.float64) + 0.0 for x in inertia_entries(mechanism, q)]

    q, _ = at_zero(mechanism.names)
    return any(d != NONE for d in degrees(entries, (q,), (True,)))


def check_law(name: str, law: Any) -> None:
    """Raise for a law that has no set-valued form, by the name of its contact."""
    if law.num_states or not law.set_valued:
        form = "bristles" if law.num_states else "regularised"
        why = f"a set-valued law without internal state; `.{form}()` of the mechanism takes this one"
        raise DeclarationError(str(refusal(f"the law of contact {name!r}", law, why)))


def check_numbers_at_start(mechanism: Any, found: list[Any], mode: Any) -> None:
    """Raise for inertia that is none, for a contact that pulls at the start, or drives in place of
    resisting there; in a mode for a contact that sticks and slides, or a stop that is closed and not
    met: it would be held at that speed, or there.

    `found`: the numbers that the mechanism has at the start.
    """
    names = mechanism.names
    fixed = [name for name in names.contacts if name not in names.opening]
    ends = [len(fixed), len(RESISTING) * len(names.contacts)]
    m, k = len(names.contacts) + len(names.stops), len(names.stops)
    ends += [0, 0, 0, 0, 0] if mode is None else [m, m, m, k, k]
    # Python compares its own numbers in a tenth of the time that NumPy takes for one.
    left = iter([x if x.ndim else x.item() for x in found])
    loads, coefficients, *held = ([next(left) for _ in range(number)] for number in ends)
    _check_inertia(names.coordinates, [*left])
    for name, load in zip(fixed, loads, strict=True):
        good = load >= 0.0
        if good is not True and not np.all(good):
            raise refusal(f"the normal force of contact {name!r} at the start", load, "not negative")
    laws = iter(coefficients)
    for name in names.contacts:
        for what in RESISTING:
            coefficient = next(laws)
            bad = coefficient < 0.0
            if bad is not False and np.any(bad):
                allowed = "not negative: friction resists, and this drives"
                raise refusal(f"the {what} of contact {name!r}", coefficient, allowed)
    one = all(isinstance(x, float) for row in held for x in row)  # else as the run says
    if mode is not None and one:
        _check_held(names, mechanism.mode_names[int(mode)], *held)


def _check_held(
    names: Any, mode: str, states: list, speeds: list, fastest: list, gaps: list, farthest: list
) -> None:
    n = len(names.contacts)
    moves = [_differs(u, size) for u, size in zip(speeds, fastest, strict=True)]
    apart = [_differs(gap, size) for gap, size in zip(gaps, farthest, strict=True)]
    for c, contact in enumerate(names.contacts):
        if states[c] == 0.0 and moves[c]:
            allowed = f"a mode in which contact {contact!r} does not stick, or left out"
            but = f"and it slides at {speeds[c]:.6g}"
            raise refusal("mode0", mode, allowed, but=but)
    for c, stop in enumerate(names.stops):
        if states[n + c] != 0.0:
            continue
        allowed = f"a mode in which stop {stop!r} is open, or left out"
        but = f"its gap is {gaps[c]:.6g}" if apart[c] else f"its gap changes at {speeds[n + c]:.6g}"
        if apart[c] or moves[n + c]:
            raise refusal("mode0", mode, allowed, but=f"and {but}")


def _differs(value: Any, size: Any) -> bool:
    """Whether a number made of terms of this size is not zero, rounding aside."""
    return bool(abs(value) > ENGINE.same * size + ENGINE.slack)
