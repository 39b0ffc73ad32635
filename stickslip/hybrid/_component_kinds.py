"""Which components of a state are compared with each other."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._tolerance import COORDINATES, MIXED, STILL, VELOCITIES, generic
from ._wrapper import AbstractSystemWrapper
from .components import components_of, per_second
from .system import AbstractHybridSystem


def component_kinds(system: AbstractHybridSystem, y: PyTree) -> tuple[str, ...]:
    """Kind of each leaf of `y`, whose largest number a small one is measured against.

    Coordinates and velocities are told by their units; other components with a unit that the system
    states, as those of first order, are of the kind of that unit. A component without one, or of a
    wrapper, as an integral is, is compared with all that moves (`MIXED`). The number of a piece of a
    load, or what a controller holds, does not move (`STILL`).
    """
    while isinstance(system, AbstractSystemWrapper):
        system = system.system
    units = [system.units.get(name) for name in components_of(y)]
    stated = {unit for unit in units if unit is not None}

    def kind(unit: str | None, counts: bool) -> str:
        if counts:
            return STILL
        if unit is None:
            return MIXED
        return (
            VELOCITIES if unit.endswith("/s") else COORDINATES if per_second(unit) in stated else unit
        )

    kinds = tuple(map(kind, units, jax.tree.leaves(_counts(y))))
    if {*kinds} <= {COORDINATES, VELOCITIES, MIXED, STILL}:
        # Measured together, they need not be told apart: less to compute at every step.
        return tuple(COORDINATES if kind == VELOCITIES else kind for kind in kinds)
    return kinds


def sizes_driven(
    field: Callable, t: Any, y: PyTree, kinds: tuple[str, ...], lasts: Any
) -> dict[str, tuple]:
    r"""Sizes of the other kinds that coordinates of 1, and velocities of 1, drive, at the start.

    With $R_{kl}$, the largest slope of kind $k$ under numbers 1 of kind $l$, they are
    $\sum_n (\tau R)^n \tau R$ over the other kinds, $\tau$ one over the largest rate of a kind or of
    the motion, or what the run `lasts` [s]: a current under a speed, a filter's voltage under that.
    All units cancel.
    """
    motion = [kind for kind in (COORDINATES, VELOCITIES) if kind in kinds]
    others = sorted({*kinds} - {COORDINATES, VELOCITIES, MIXED, STILL})
    if not others or not motion:
        return {}
    rows = [*motion, *others]
    ones, form = jax.tree.flatten(generic(jax.tree.map(jnp.ones_like, y)))

    def slopes(chosen):  # of all kinds, along one of them
        along = [
            a * chosen[rows.index(k)] if k in rows else 0.0 * a
            for k, a in zip(kinds, ones, strict=True)
        ]
        _, moved = jax.jvp(lambda y: field(t, y), (y,), (jax.tree.unflatten(form, along),))
        found = dict.fromkeys(rows, jnp.zeros(()))
        for kind, leaf in zip(kinds, jax.tree.leaves(moved), strict=True):
            if kind in rows:
                size = jnp.where(jnp.isfinite(leaf), jnp.abs(leaf), 0.0)
                found[kind] = jnp.maximum(found[kind], jnp.max(size))
        return jnp.stack(list(found.values()))

    matrix = jax.vmap(slopes, out_axes=1)(jnp.eye(len(rows)))
    fastest = jnp.max(jnp.diagonal(matrix))
    if len(motion) == 2:
        fastest = jnp.maximum(fastest, jnp.sqrt(matrix[0, 1] * matrix[1, 0]))
    span = jnp.minimum(lasts, 1.0 / jnp.where(fastest > 0.0, fastest, 1.0 / lasts))
    first = span * matrix[len(motion) :, : len(motion)]
    among, found = span * matrix[len(motion) :, len(motion) :], first
    for _ in others[1:]:
        found = first + among @ found
    found = jax.lax.stop_gradient(found)
    by_rates = [row[motion.index(VELOCITIES)] if VELOCITIES in motion else 0.0 for row in found]
    by_places = [row[0] if COORDINATES in motion else 0.0 for row in found]
    return dict(zip(others, zip(by_places, by_rates, strict=True), strict=True))


def _counts(y: PyTree) -> PyTree:
    """Whether the leaves are held between events, as the number of a piece.

    A state of a wrapper names such parts as `held`, a constant of its class.
    """

    def of(node: Any) -> Any:
        if not _holds(node):
            return False
        parts = zip(node._fields, node, strict=True)
        return [jax.tree.map(lambda _: True, a) if n in node.held else _counts(a) for n, a in parts]

    return jax.tree.map(of, y, is_leaf=_holds)


def _holds(node: Any) -> bool:
    return isinstance(node, tuple) and isinstance(getattr(type(node), "held", None), tuple)
