"""The scaled error of a step: what counts as small in each component of the state."""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from .._validation import check_mapping, check_positive, leaves_of, refusal, shape_refusal
from .accuracy import ACCURACY
from .components import components_of

# Kinds of components beside those of one unit: coordinates, velocities, all without a unit, numbers.
COORDINATES, VELOCITIES, MIXED, STILL = "coordinates", "velocities", "mixed", "still"
TOLERANCE = (
    "None, a positive number, a mapping from names of components or from units, or a pytree with the "
    "structure of the state"
)


def check_tolerances(name: str, atol: Any) -> None:
    """Raise if `atol` cannot be the absolute tolerance of any state."""
    if isinstance(atol, Mapping):
        check_mapping(name, atol, TOLERANCE)
    elif atol is not None and not jax.tree.leaves(atol):
        raise refusal(name, atol, TOLERANCE)
    for where, leaf in leaves_of(name, atol):
        check_positive(where, leaf)


def component_tolerances(atol: Any, y: PyTree, units: Mapping[str, str]) -> tuple:
    """Absolute tolerance of each leaf of `y`, None where it follows the size of the motion.

    `atol` is None, a number, a pytree with the structure of `y`, or a mapping from names of
    components or from units to numbers.

    Raises `ValueError` or `TypeError` naming `atol` for anything else.
    """
    leaves, form = jax.tree.flatten(y)
    if atol is None:
        return (None,) * len(leaves)
    if jax.tree.structure(atol) == form and not isinstance(atol, Mapping):
        given = zip(leaves_of("atol", atol), leaves, strict=True)
        return tuple(_number(name, value, like) for (name, value), like in given)
    if isinstance(atol, Mapping):
        names = list(components_of(y))
        known = {*names, *(units.get(name) for name in names)} - {None}
        for key in atol:
            if key not in known:
                choices = ", ".join(sorted(map(repr, known)))
                raise refusal("atol", dict(atol), f"a mapping from some of {choices}")
        keys = (name if name in atol else units.get(name) for name in names)
        found = zip(keys, leaves, strict=True)
        return tuple(
            None if atol.get(key) is None else _number(f"atol[{key!r}]", atol[key], like)
            for key, like in found
        )
    if jax.tree.structure(atol) != jax.tree.structure(0.0):
        raise refusal("atol", atol, TOLERANCE)
    return tuple(_number("atol", atol, like) for like in leaves)


def _number(name: str, value: Any, like: Any) -> Array:
    """The tolerance of a leaf of the state: one number, or one for each of its numbers."""
    if jnp.shape(value) not in ((), jnp.shape(like)):
        raise shape_refusal(name, value, f"one number or of shape {jnp.shape(like)}, as in the state")
    return jax.lax.stop_gradient(jnp.asarray(check_positive(name, value), jnp.float64))


def sizes(y: PyTree) -> PyTree:
    """Magnitude of each component; what the largest so far begins with."""
    return jax.tree.map(jnp.abs, y)


def largest_magnitude(size: PyTree, y: PyTree) -> PyTree:
    """Largest magnitude so far, of each component."""
    return jax.tree.map(lambda s, a: jnp.maximum(s, jnp.abs(a)), size, y)


def largest_of_kinds(kinds: tuple[str, ...], sizes: list) -> dict[str, Any]:
    """The largest number of each kind; of what is `MIXED` that of all that moves."""
    most: dict[str, Any] = {}
    for kind, size in zip(kinds, sizes, strict=True):
        most[kind] = jnp.maximum(most.get(kind, ACCURACY.tiny), jnp.max(size))
    moves = [largest for kind, largest in most.items() if kind != STILL]
    most[MIXED] = functools.reduce(jnp.maximum, moves, ACCURACY.tiny)
    return most


def least_sizes(kinds: tuple[str, ...], most: dict[str, Any], noise: "Noise") -> list:
    """The least size of each leaf: a part of the largest number of its kind.

    Coordinates and velocities are measured together: a velocity that a contact holds at rest may be
    nothing but rounding. So may be a state of another kind that it drives: that is measured by what
    the motion would drive in it. Next to other kinds hardly anything is small, as their units are
    others; but what begins like a high power of the time has no digit at first, and has to end
    somewhere.
    """
    places, rates = (most.get(kind, 0.0) for kind in (COORDINATES, VELOCITIES))
    sizes = {**most, **dict.fromkeys((COORDINATES, VELOCITIES), jnp.maximum(places, rates))}
    for kind, (by_places, by_rates) in noise.driven.items():
        sizes[kind] = jnp.maximum(most[kind], by_places * places + by_rates * rates)
    if len({*kinds} - {STILL}) == 1:
        return [ACCURACY.smallest * sizes[kind] for kind in kinds]
    other = ACCURACY.smallest**5 * most[MIXED]
    return [jnp.maximum(ACCURACY.smallest * sizes[kind], other) for kind in kinds]


def generic(size: PyTree) -> PyTree:
    """`size`, each component times a factor near 1 of its own: sums of them do not cancel by chance."""
    leaves, form = jax.tree.flatten(size)
    factors = [0.75 + 0.5 * ((0.6180339887 * i) % 1.0) for i in range(len(leaves))]
    return jax.tree.unflatten(form, [f * s for f, s in zip(factors, leaves, strict=True)])


def cancelling(field: Any, t: Any, y: PyTree) -> PyTree:
    r"""Size of the terms that add up to the slope at the start, $|J y|$, $J$ the slope of the field.

    At a rest the terms of a force cancel, and what is left of them is rounding: an error estimate
    below it means nothing.
    """
    _, moved = jax.jvp(lambda y: field(t, y), (y,), (generic(y),))
    return jax.lax.stop_gradient(jax.tree.map(jnp.abs, moved))


class Noise(NamedTuple):
    """Magnitudes that rounding is a part of."""

    time: Any  # largest time of the run [s]
    terms: PyTree  # terms that add up to the slope
    driven: dict[str, tuple]  # sizes of other kinds under coordinates of 1, and under velocities of 1


class Ends(NamedTuple):
    """A step between two states, and their slopes."""

    h: Any
    y0: PyTree
    y1: PyTree
    dy0: PyTree
    dy1: PyTree


def scales(
    rtol: Any, atols: tuple, kinds: tuple[str, ...], noise: Noise, size: PyTree, step: Ends
) -> list:
    """Meaning of an error of 1 in each leaf: `atol + rtol max(|y0|, |y1|)`.

    Without an absolute tolerance, `rtol` times the largest magnitude so far, of the component itself
    or of a part (`ACCURACY.smallest`) of the largest component of its kind. Added to this are the
    rounding of the field and the motion within the rounding of the time: a field that jumps where the
    state is still zero leaves an error of the size of the motion however short the step. The slope at
    the end of a longer step does not count: where a stiff motion explodes, it grows faster than the
    error.
    """
    size = step.y0 if size is None else size
    leaves = [
        jax.tree.leaves(tree) for tree in (size, step.y0, step.y1, noise.terms, step.dy0, step.dy1)
    ]
    moved = [jnp.maximum(s, jnp.abs(b)) for s, _, b, *_ in zip(*leaves, strict=True)]
    most = largest_of_kinds(kinds, moved)
    found = []
    short = step.h <= ACCURACY.short * ACCURACY.few_roundings * noise.time
    rows = zip(atols, least_sizes(kinds, most, noise), *leaves, strict=True)
    for atol, least, s, a, b, n, da, db in rows:
        here = jnp.maximum(jnp.abs(a), jnp.abs(b))
        if atol is None:
            here = jnp.maximum(jnp.maximum(s, here), least)
            ends = jnp.where(short, jnp.maximum(jnp.abs(da), jnp.abs(db)), jnp.abs(da))
            unsure = n * step.h + noise.time * ends
            found.append(jnp.maximum(rtol * here + ACCURACY.few_roundings * unsure, ACCURACY.tiny))
        else:
            found.append(atol + rtol * here)
    return found


def error_norm(errors: tuple[PyTree, ...], scale: list) -> Array:
    """Root mean square of the error estimate relative to `scale`.

    With two estimates (DOP853) they are combined as in Hairer, Norsett & Wanner II.10:
    `e5^2 / sqrt(e5^2 + 0.01 e3^2)`.
    """

    def squares(error):
        total, count = 0.0, 0
        for e, s in zip(jax.tree.leaves(error), scale, strict=True):
            # Clipped, lest the two squares become infinite and their ratio NaN.
            total = total + jnp.sum(jnp.clip(e / s, -1e70, 1e70) ** 2)
            count += e.size
        return total / count

    first = squares(errors[0])
    if len(errors) == 1:
        return jnp.sqrt(first)
    second = squares(errors[1])
    denominator = first + 0.01 * second
    return first / jnp.sqrt(jnp.where(denominator > 0, denominator, 1.0))


def largest_surprise(surprise: PyTree, scale: list, ends: Ends, rtol: Any) -> Any:
    """The largest of `surprise` relative to `scale`, where it is more than a part of the motion.

    The last stage and the end are the same instant, and states that differ by an error of low order.
    In a smooth motion their slopes differ by more than `scale` and far less than this part. Where a
    friction law has its peak at the very end, of all slopes that of the end alone may know it, and no
    error estimate has it.
    """
    expected = rtol**ACCURACY.expected
    most: Any = 0.0
    leaves = [jax.tree.leaves(tree) for tree in (surprise, ends.dy0, ends.dy1)]
    for e, da, db, s in zip(*leaves, scale, strict=True):
        part = expected * ends.h * jnp.maximum(jnp.abs(da), jnp.abs(db))
        most = jnp.maximum(most, jnp.max(jnp.where(jnp.abs(e) > part, jnp.abs(e) / s, 0.0)))
    return jnp.minimum(most, 1e70)


def too_loose(atols: tuple, kinds: tuple[str, ...], noise: Noise, size: PyTree) -> Any:
    """Whether an absolute tolerance is above the motion of a component that does move."""
    leaves = jax.tree.leaves(size) if atols else []
    least = least_sizes(kinds, largest_of_kinds(kinds, leaves), noise) if leaves else []
    loose: Any = jnp.zeros((), bool)
    for atol, small, s in zip(atols, least, leaves, strict=True):
        if atol is not None:
            # A component that is rounding next to the others does not move.
            loose = loose | jnp.any((s > 1e-8 * small) & (atol > ACCURACY.loose * s))
    return loose
