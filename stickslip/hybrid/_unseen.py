"""Components of a state whose motion does not say how long a step may be, read off while tracing.

The error of a step is that of its motion. A rotor that turns evenly has none, whatever the length, and
what it does to others once a turn would be jumped over. It can hide something only where the field or
an event function depends on it in a way that can rise and fall again: through a power or a function of
it, and not where it is a straight line, a parabola or bends once or twice.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._jaxpr import called_program, walk
from ._tolerance import Ends
from .accuracy import ACCURACY
from .components import components_of, entries, period_of

# Turns a function can make along a line: 1 of a straight line, 2 of a parabola or what bends once, 3 of
# what bends twice or levels off at both ends. With more it may be flat, rise, fall, and be flat again.
HIDES = 4
# Added to the turns of a function that is not a polynomial: kinks of several terms add up.
BENT = 2 * HIDES

_SAME = {
    "neg", "copy", "copy_p", "real", "optimization_barrier", "stop_gradient",
    "reduce_precision",
}  # fmt: skip
_SHAPED = {"reshape", "squeeze", "expand_dims"}
# One that rises all along, or falls, may be flat at both ends but not come back.
_MONOTONIC = {
    "tanh", "logistic", "exp", "exp2", "expm1", "log", "log1p", "atan", "asinh", "sinh", "erf", "cbrt",
    "sqrt", "sign",
}  # fmt: skip


class Watched(NamedTuple):
    """Numbers of one leaf of the state that a step must not move too far; hashable."""

    leaf: int
    way: tuple[float, ...]  # longest in one step, infinite where no period is declared
    free: tuple[bool, ...]  # watched at all times, the others while they move evenly
    hides: tuple[bool, ...]  # the others are not watched


def turns(closed: Any, columns: list[np.ndarray], count: int) -> list[np.ndarray]:
    """How many turns each number of the results can make as one of `count` columns moves.

    `columns[i]`: the column of each number of operand `i`, -1 for none. The last axis of a result is
    the column; one more behind the others is 0 only where the result is zero in any case.
    """
    given = []
    for column in columns:
        found = np.zeros((*column.shape, count + 1), np.uint8)
        found[..., count] = 1
        for index in np.ndindex(column.shape):
            if column[index] >= 0:
                found[(*index, column[index])] = 1
        given.append(found)
    return [_number(a) for a in _walk(closed.jaxpr, given, count)]


def _number(a: np.ndarray) -> np.ndarray:
    return a & (BENT - 1)


def _turn_code(number: Any, *bent: Any) -> np.ndarray:
    """At most `HIDES` turns, of no polynomial where that holds for one of `bent`."""
    number = np.minimum(number, HIDES)
    bits = [np.where(number > 0, b, 0) & BENT for b in bent]
    return functools.reduce(np.bitwise_or, bits, number).astype(np.uint8)


def _any_of(rows: Any, axis: Any = 0) -> np.ndarray:
    """Any of `rows`: each number may be that of one of them."""
    rows = np.asarray(rows)
    return _turn_code(_number(rows).max(axis=axis), np.bitwise_or.reduce(rows & BENT, axis=axis))


def _constant(value: Any, shape: tuple, count: int) -> np.ndarray:
    found = np.zeros((*shape, count + 1), np.uint8)
    found[..., count] = np.asarray(value != 0, np.uint8)
    return found


def _walk(jaxpr: Any, given: list[np.ndarray], count: int) -> list[np.ndarray]:
    def constant(variable: Any, number: Any) -> np.ndarray:
        shape = getattr(variable.aval, "shape", ())
        return _constant(1 if number is None else number, shape, count)

    return walk(jaxpr, given, lambda eqn, operands: _equation(eqn, operands, count), constant)


def _equation(eqn: Any, given: list[np.ndarray], count: int) -> list[np.ndarray]:
    name, p = eqn.primitive.name, eqn.params
    shapes = [getattr(var.aval, "shape", ()) for var in eqn.outvars]
    if not any(a[..., :count].any() for a in given) and name not in _PLAIN:
        return [_constant(1, shape, count) for shape in shapes]
    rule = _RULES.get(name)
    if rule is not None:
        return [np.broadcast_to(rule(p, shapes[0], *given), (*shapes[0], count + 1))]
    if name == "cond" and not given[0][..., :count].any():
        rows = [_walk(b.jaxpr, given[1:], count) for b in p["branches"]]
        return [_any_of(np.stack(column)) for column in zip(*rows, strict=True)]
    inner = called_program(eqn)
    if inner is not None:
        return _walk(inner[0], given, count)
    # Of what is not known each number depends on all, in any way.
    one = all(a.shape[:-1] in ((), shapes[0]) for a in given) and name not in _MIXES
    alike = functools.reduce(np.logical_or, given) if one else None
    reach = functools.reduce(np.logical_or, (a.any(axis=tuple(range(a.ndim - 1))) for a in given))
    rows: Any = (alike if one and shape == shapes[0] else reach for shape in shapes)
    return [
        np.where(np.broadcast_to(row, (*shape, count + 1)), HIDES, 0).astype(np.uint8)
        for row, shape in zip(rows, shapes, strict=True)
    ]


def _zero(a: np.ndarray) -> np.ndarray:
    return np.asarray(~a.any(axis=-1, keepdims=True))


def _sum(p, shape, a, b):
    a, b = np.broadcast_arrays(a, b)
    one, other = _number(a).astype(int), _number(b).astype(int)
    added = np.where((one > 0) & (other > 0), one + other - 1, one + other)
    highest = np.maximum(one, other)
    return _turn_code(np.where((a | b) & BENT, added, highest), a, b)


def _product(p, shape, a, b):
    found = _turn_code(_number(a).astype(int) + _number(b), a, b)
    return np.where(_zero(a) | _zero(b), 0, found).astype(np.uint8)


def _quotient(p, shape, a, b):
    bent = np.where(b[..., :-1] > 0, HIDES, a[..., :-1])
    found = np.concatenate([bent, np.maximum(a, b)[..., -1:]], axis=-1)
    return np.where(_zero(a), 0, found)


def _turns_of_conversion(p, shape, a, *_):
    smooth = jnp.issubdtype(p["new_dtype"], jnp.floating)
    return a if smooth else np.where(a > 0, HIDES, 0).astype(np.uint8)


def _larger(p, shape, a, b):
    one, other = (np.maximum(_number(x).astype(int), 1) for x in (a, b))
    return _turn_code(np.where((a > 0) | (b > 0), 2 * (one + other) - 2, 0), BENT)


def _times(number: int, *bent: int) -> Callable:
    return lambda p, shape, a, *_: _turn_code(number * _number(a).astype(int), a, *bent)


def _power(p, shape, a):
    return _times(p["y"])(p, shape, a) if p["y"] > 0 else np.where(a > 0, HIDES, 0).astype(np.uint8)


def _rising(p, shape, a, *_):
    found = _times(3, BENT)(p, shape, a)
    return np.concatenate([found[..., :-1], np.ones_like(found[..., -1:])], axis=-1)


def _turns_of_choice(p, shape, which, *cases):
    found = _any_of(np.stack(np.broadcast_arrays(*cases)))
    by = np.concatenate([which[..., :-1] > 0, np.zeros_like(which[..., -1:], bool)], axis=-1)
    return np.where(by, HIDES, found)


def _turns_of_reduction(p, shape, a):
    return _turns_of_sum(a, tuple(p["axes"]))


def _turns_of_sum(a, axes):
    # A sum of several that bend may turn as often as all of them.
    several = ((a & BENT) > 0).any(axis=axes) & ((_number(a) > 1).sum(axis=axes) > 1)
    return np.where(several, HIDES, _any_of(a, axes)).astype(np.uint8)


def _broadcast(p, shape, a, *_):
    expanded = np.ones(len(shape), int)
    for axis, to in enumerate(p["broadcast_dimensions"]):
        expanded[to] = a.shape[axis]
    return a.reshape(*expanded, a.shape[-1])


def _turns_of_slice(p, shape, a):
    strides = p["strides"] or (1,) * len(p["start_indices"])
    at = zip(p["start_indices"], p["limit_indices"], strides, strict=True)
    return a[tuple(slice(*part) for part in at)]


def _product_of_matrices(p, shape, a, b):
    # Each number is a sum over all.
    one, other = (_turns_of_sum(x, tuple(range(x.ndim - 1))) for x in (a, b))
    return _turn_code(_number(one).astype(int) + _number(other), one, other)


_RULES: dict[str, Callable] = {
    **dict.fromkeys(_SAME, lambda p, shape, a, *_: a),
    **dict.fromkeys(_SHAPED, lambda p, shape, a, *_: a.reshape(*shape, a.shape[-1])),
    **dict.fromkeys(_MONOTONIC, _rising),
    **dict.fromkeys(("add", "sub", "add_any"), _sum),
    **dict.fromkeys(("max", "min"), _larger),
    "convert_element_type": _turns_of_conversion, "mul": _product, "div": _quotient,
    "abs": _times(2, BENT), "square": _times(2), "integer_pow": _power,
    "clamp": lambda p, shape, *of: _times(3, BENT)(p, shape, _any_of(np.broadcast_arrays(*of))),
    "select_n": _turns_of_choice, "reduce_sum": _turns_of_reduction,
    "dot_general": _product_of_matrices, "broadcast_in_dim": _broadcast, "slice": _turns_of_slice,
    "transpose": lambda p, shape, a: a.transpose(*p["permutation"], a.ndim - 1),
    "rev": lambda p, shape, a: np.flip(a, p["dimensions"]),
    "concatenate": lambda p, shape, *parts: np.concatenate(parts, axis=p["dimension"]),
    "stack": lambda p, shape, *parts: np.stack(parts, axis=p["axis"]),
}  # fmt: skip
# Those under which zero stays zero; and those that mix the numbers of an array of the same shape.
_PLAIN = _SAME | _SHAPED | {
    "mul", "convert_element_type", "broadcast_in_dim", "slice", "concatenate", "stack", "select_n",
    "jit",
}  # fmt: skip
_MIXES = {"cumsum", "cumprod", "sort", "gather", "scatter", "triangular_solve", "while", "scan"}


class Hiding(NamedTuple):
    """Components of a state that may hide something from the error of a step."""

    any: bool
    runs_free: bool  # whether one without a period does; nothing it drives acts back on it
    watched: tuple[Watched, ...]


def hiding(system: Any, closed: Any, y: PyTree) -> Hiding:
    """By the program `closed` of the field and the event functions of time and state."""
    leaves = jax.tree.leaves(y)
    sizes = [np.size(leaf) for leaf in leaves]
    apart = sum(sizes) <= ACCURACY.numbers_told_apart
    starts = np.cumsum([0, *sizes])
    columns = [
        (begin + np.arange(size)).reshape(np.shape(leaf)) if apart else np.full(np.shape(leaf), i)
        for i, (leaf, size, begin) in enumerate(zip(leaves, sizes, starts[:-1], strict=True))
    ]
    operands = closed.jaxpr.invars
    time = [np.full(var.aval.shape, -1) for var in operands[: len(operands) - len(leaves)]]
    count = sum(sizes) if apart else len(leaves)
    rows = [row.reshape(-1, count + 1) for row in turns(closed, [*time, *columns], count)]
    field = np.zeros((count, count + 1), np.uint8)
    for column, row in zip(columns, rows, strict=False):
        np.maximum.at(field, column.ravel(), row)
    # In its own rate, as a speed in its friction, the error of its motion sees it.
    others = np.where(np.eye(count, dtype=bool), 0, field[:, :count])
    events = np.concatenate([np.zeros((1, count + 1), np.uint8), *rows[len(leaves) :]])[:, :count]
    hides = np.concatenate([others, events]).max(axis=0) >= HIDES
    hides &= field.any(axis=1)  # the others never move
    reaches = field[:, :count] > 0
    for through in range(count):
        reaches |= reaches[:, through : through + 1] & reaches[through]
    free = ~np.diagonal(reaches)
    found, runs_free = [], False
    for i, (name, leaf) in enumerate(components_of(y).items()):
        mine = columns[i].ravel()
        if not mine.size or not hides[mine].any():
            continue
        way = []
        for number, hidden in zip(entries(name, np.shape(leaf)), hides[mine], strict=True):
            period = period_of(system, number) or period_of(system, name)
            way.append(ACCURACY.of_period * period if hidden and period else math.inf)
        asked = zip(way, free[mine].tolist(), hides[mine].tolist(), strict=True)
        runs_free |= any(math.isinf(w) and f and h for w, f, h in asked)
        found.append(Watched(i, tuple(way), tuple(free[mine].tolist()), tuple(hides[mine].tolist())))
    return Hiding(bool(hides.any()), runs_free, tuple(found))


def step_excess(watched: tuple[Watched, ...], h: Any, longest: Any, ends: Ends, order: int) -> Any:
    """How far a step went beyond its bound, as a scaled error: 1 at the bound.

    Components that run free, and others while they move evenly, go no farther than a part
    (`ACCURACY.of_period`) of their period in a step, others `ACCURACY.of_seen_period` times as far; an
    even motion without a period lasts no longer than `longest` [s].
    """
    most: Any = jnp.zeros_like(h)
    leaves = [jax.tree.leaves(tree) for tree in (ends.y0, ends.y1, ends.dy0, ends.dy1)]
    for one in watched:
        y0, y1, dy0, dy1 = (jnp.ravel(leaf[one.leaf]) for leaf in leaves)
        moved, size = jnp.abs(y1 - y0), jnp.maximum(jnp.abs(y0), jnp.abs(y1))
        bend = jnp.abs(y1 - y0 - 0.5 * h * (dy0 + dy1))
        even = (bend <= ACCURACY.same * moved + ACCURACY.rounding * size) & (
            moved > ACCURACY.slack * size
        )
        way, free, hides = np.asarray(one.way), np.asarray(one.free), np.asarray(one.hides)
        way = jnp.where(even | free, way, ACCURACY.of_seen_period * way)
        lasts = jnp.where(even & ~free & np.isinf(one.way), h / longest, 0.0)
        most = jnp.maximum(most, jnp.max(jnp.where(hides, jnp.maximum(lasts, moved / way), 0.0)))
    return most**order
