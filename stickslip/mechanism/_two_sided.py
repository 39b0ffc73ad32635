"""Contacts at rest whose friction left on either side is a straight line along the motion."""

from typing import Any

import jax.numpy as jnp

from stickslip.hybrid.dependence import OTHER, degrees

from ._abstract_declaration import AbstractDeclaration
from ._any_args import with_any_args
from ._declaration import at_zero
from ._moment import moment_of
from ._structure import structure_with


def two_sided_contacts(declaration: AbstractDeclaration) -> tuple[int, ...]:
    """Contacts at rest whose friction left on either side is affine in time and state.

    Each side then has a guard of its own, a straight line along the motion: nothing has to be looked
    for between the ends of a step, as it must where the lesser of the two is one guard.
    """
    structure, names = structure_with(declaration, ()), declaration.names
    count, stops = len(names.contacts), len(names.stops)
    if not count:
        return ()

    def sides(t, y, args):
        # A choice by a state counts with all it may be: stops that are open, and closed.
        now = moment_of(declaration, structure, t, *declaration.to_coordinates(y), args)
        states = [jnp.zeros(())] * count + [jnp.full((), 2.0)] * stops
        found: list[Any] = [now.at.v[0] * now.at.v[0]] * (2 * count)
        for group in structure.contact_groups:
            if group.joint_guards:
                continue
            here = now.of(group)
            force, limits = group.motion_in(here, states).force, here.static
            for i, c in enumerate(group.rows[: group.contacts]):
                found[2 * c] = limits.high[i] - force[i]
                found[2 * c + 1] = force[i] - limits.lower[i]
        return [jnp.asarray(x, jnp.float64) + 0.0 for x in found]

    def with_args(args):
        operands = jnp.zeros(()), declaration.from_coordinates(*at_zero(names))
        degree = degrees(lambda t, y: sides(t, y, args), operands, (True, True))
        return {c for c in range(count) if OTHER not in degree[2 * c : 2 * c + 2]}

    return tuple(sorted(with_any_args(with_args)))
