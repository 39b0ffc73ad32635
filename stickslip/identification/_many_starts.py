"""The same fit from many starts at once."""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._code import jit_by_code
from .._types import Given
from .._validation import (
    check_callable,
    check_count,
    check_finite,
    check_in,
    check_type,
    is_concrete,
    leaves_of,
    misshaped,
    numbers,
    refusal,
)
from ..sweep import map_lanes
from ..sweep.lanes import EXECUTORS
from ..sweep.progress import Progress
from ._descent import GradientDescent
from ._evaluate import evaluation
from ._fit import Fit
from ._gradient import gradient_descent
from ._least_squares import least_squares
from ._levenberg_marquardt import LevenbergMarquardt
from ._methods import AbstractMethod
from ._sensitivity import Sensitivity
from ._unknowns import NamedUnknownRows, NamedValues, Space, checked

# Rows of a call of the program where the user names no chunk: the least, and from one to the next.
FEWEST = 8
WIDER = 4

METHODS: dict[Any, Callable[..., AbstractMethod]] = {
    least_squares: LevenbergMarquardt,
    gradient_descent: GradientDescent,
}


def many_starts(
    residual: Callable[..., Any],
    starts: NamedUnknownRows,
    *shared: PyTree,
    fit: Given[Callable[..., Fit] | AbstractMethod] = least_squares,
    chunk_size: int | None = None,
    executor: str = "auto",
    progress: bool | None = None,
    **options: Any,
) -> Fit:
    """`fit` from every start; `best` picks the best of them.

    Residuals and Jacobians of all starts that are still on their way are evaluated together, on all
    cores, by one compiled program that the methods have in common.

    **Arguments**

    - `residual(values, *shared)`; `fit`: `least_squares` or `gradient_descent`, with `options` as they
      take them, or a method such as `LevenbergMarquardt()`; `starts`, by name one row of positive
      numbers, or an `Unknown` with a row.
    - `shared`: arrays that are the same for all starts. Handed over like this, other data of the same
      shape use the program that is compiled already, as long as `residual` is the same function.
    - `chunk_size`, `executor` as for `stickslip.map_lanes`. One program serves all steps and all
      numbers of starts up to 8, or 32, 128 and so on, or any number with a `chunk_size`: where fewer
      are on their way it is filled up with copies. Some 10 to 100 starts are usual.
    - `progress`: a line on stderr with how many have ended, the step and the lowest cost; by default
      where stderr is a terminal.

    **Returns** a `Fit` with the starts in front. **Raises** as `fit` does, and `ValueError` for starts
    of different lengths, an unknown `fit`, and `shared` with numbers that are not finite. It is a loop
    of Python and does not work under `jit`. Interrupted (`KeyboardInterrupt`) it keeps no fit, but says
    where the best of them had come to.
    """
    method = _method(fit, options)
    check_callable("residual", residual, "f(values, *shared)", {}, *shared)
    check_lanes(chunk_size, executor)
    check_type("progress", progress, bool | None, "True, False or None")
    space, found, count = _rows("starts", starts)
    for i, tree in enumerate(shared):
        for name, leaf in leaves_of(f"shared[{i}]", tree):
            check_finite(name, numbers(name, leaf))
    program, _ = evaluator(residual, space, chunk_size, executor, 0, (), method.loss)
    width = _width(program, count, chunk_size)
    room = -(-count // width) * width
    shared = jax.tree.map(lambda a: np.broadcast_to(a, (room, *np.shape(a))), shared)
    program, shared = evaluator(residual, space, chunk_size, executor, room, shared, method.loss)
    now = None
    filled = {name: np.pad(a, (0, room - count), mode="edge") for name, a in found.items()}
    todo, z = np.arange(count), np.asarray(space.coordinates(filled))
    meter, best = Progress(count, name="many_starts", things="starts", shown=progress), _Best()
    try:
        meter.show("compiling")
        while todo.size:
            out, matrix = evaluated(program, z, shared, todo, width)
            best = best.or_better(z[todo], out[todo])
            if now is None:
                now = _begin(method, jnp.asarray(z), out.shape[1], space)
            now = _advance(method, now, jnp.asarray(out), jnp.asarray(matrix))
            z, left = np.asarray(now.z), np.flatnonzero(~np.asarray(now.done)[:count])
            meter.note = f"step {best.steps}, lowest cost {best.cost:.6g}"
            meter.advance(todo.size - left.size)
            todo = left
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"interrupted after {best.steps} steps: no fit is kept; {meter.done} of {count} starts had "
            f"ended. {best.said(space)}"
        ) from None
    finally:
        meter.close()
    # Cut off by NumPy: a slice of each length would be a program of its own.
    return jax.tree.map(lambda a: jax.device_put(np.asarray(a)[:count]), _finish(method, space, now))


class _Best(NamedTuple):
    """The lowest cost of all evaluations, and where it was."""

    steps: int = 0
    cost: float = math.inf
    z: np.ndarray | None = None

    def or_better(self, z: np.ndarray, residuals: np.ndarray) -> "_Best":
        costs = 0.5 * np.sum(residuals**2, axis=1)
        costs[~np.isfinite(costs)] = math.inf
        i = int(np.argmin(costs))
        if costs[i] < self.cost:
            return _Best(self.steps + 1, float(costs[i]), z[i])
        return self._replace(steps=self.steps + 1)

    def said(self, space: Space) -> str:
        if self.z is None:
            return "None was finite."
        values = space.values(jnp.asarray(self.z))
        where = ", ".join(f"{name} = {float(value):.6g}" for name, value in values.items())
        return f"The lowest cost was {self.cost:.6g}, at {where}."


def sensitivities(
    residual: Callable[..., Any],
    values: NamedUnknownRows,
    *each: PyTree,
    chunk_size: int | None = None,
    executor: str = "auto",
) -> Sensitivity:
    """`sensitivity` of many, by the program of `many_starts`.

    **Arguments:** `residual(values, *each)`; `values`, by name one row of positive numbers, or an
    `Unknown` with a row; `each`, arrays with as many rows. **Returns** a `Sensitivity` with the rows in
    front. **Raises** `TypeError`, `ValueError` for anything else.
    """
    check_callable("residual", residual, "f(values, *each)", {}, *each)
    check_lanes(chunk_size, executor)
    space, found, count = _rows("values", values)
    for i, tree in enumerate(each):
        for name, leaf in leaves_of(f"each[{i}]", tree):
            check_finite(name, leaf)
            if np.shape(leaf)[:1] != (count,):
                raise misshaped(name, leaf, f"an array of {count} rows, as values")
    each = jax.tree.map(np.asarray, each)
    program, each = evaluator(residual, space, chunk_size, executor, count, each)
    rows, z = np.arange(count), space.coordinates(found)
    matrix = evaluated(program, z, each, rows, asked_width(program, chunk_size))[1]
    return Sensitivity(space.names, jnp.asarray(matrix))


def _method(fit: Any, options: dict[str, Any]) -> AbstractMethod:
    if isinstance(fit, AbstractMethod):
        if options:
            raise refusal("options", options, "empty where fit is a method, which has its own")
        return fit
    if fit is not least_squares and fit is not gradient_descent:
        raise refusal("fit", fit, "least_squares or gradient_descent, or a method")
    return METHODS[fit](**options)


def _rows(name: str, values: Any) -> tuple[Space, NamedValues, int]:
    space, found = checked(name, values)
    shapes = {key: a.shape for key, a in found.items()}
    if len(set(shapes.values())) != 1 or len(next(iter(shapes.values()))) != 1:
        raise refusal(name, values, "rows of one length by name", but=f"of shapes {shapes}")
    if not is_concrete(found):
        raise refusal(name, values, "known: this is a loop of Python, call it outside of jit and vmap")
    (count,) = next(iter(shapes.values()))
    return space, found, count


def check_lanes(chunk_size: Any, executor: Any) -> None:
    if chunk_size is not None:
        check_count("chunk_size", chunk_size, 1)
    check_in("executor", executor, EXECUTORS)


@functools.lru_cache(maxsize=8)
def _kept_evaluator(residual, form: Space, chunk_size, executor, loss) -> map_lanes:
    def one(z, scales, shared):
        space = eqx.combine(form, scales)
        return evaluation(lambda values: residual(values, *shared), space, loss)(z)

    def each(z, rest):
        return one(z, *rest)

    return map_lanes(each, executor=executor, chunk_size=chunk_size)


def evaluator(
    residual, space: Space, chunk_size, executor, count: int, rest, loss=None
) -> tuple[map_lanes, Any]:
    """The program, and what it takes besides coordinates: scales and priors are data too."""
    scales, form = eqx.partition(space, eqx.is_array)
    scales = jax.tree.map(lambda a: np.broadcast_to(a, (count, *np.shape(a))), scales)
    try:
        hash(residual)
        make = _kept_evaluator
    except TypeError:
        make = _kept_evaluator.__wrapped__
    return make(residual, form, chunk_size, executor, loss), (scales, rest)


def _most(program: map_lanes) -> int:
    """Rows that all threads or devices take in one chunk each."""
    return program.chunk_size * max(program.threads, len(program.devices))


def _width(program: map_lanes, count: int, chunk_size: int | None) -> int:
    """Rows of every call: of few starts few, but not of each number its own, which would compile."""
    asked, width = asked_width(program, chunk_size), FEWEST
    while width < count:
        width *= WIDER
    return min(width, _most(program)) if asked is None else asked


def asked_width(program: map_lanes, chunk_size: int | None) -> int | None:
    """Rows of every call where chunks of one size are asked for: one program, however few the rows."""
    return None if chunk_size is None else _most(program)


def evaluated(
    program: map_lanes, z, each, rows: np.ndarray, width: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals and Jacobians of all lanes; those of lanes not in `rows` are zero.

    Each call of the program takes `width` rows, the last one repeated to fill it; by default all rows,
    or as many as it can take.
    """
    z, filled = np.asarray(z), []
    width = min(rows.size, _most(program)) if width is None else width
    for first in range(0, rows.size, width):
        used = rows[first : first + width]
        part = np.concatenate([used, np.full(width - used.size, used[-1])])
        found = program(z[part], jax.tree.map(lambda a, part=part: a[part], each))
        filled = filled or [np.zeros((len(z), *a.shape[1:])) for a in found]
        for all_rows, a in zip(filled, found, strict=True):
            all_rows[used] = np.asarray(a)[: used.size]
    out, matrix = filled
    return out, matrix


@jit_by_code
def _begin(method, z, rows: int, space: Space):
    return jax.vmap(lambda z: method.begin(z, rows, space))(z)


@jit_by_code
def _advance(method, now, residual, matrix):
    def one(now, residual, matrix):
        new = method.advance(now, residual, matrix)
        return jax.tree.map(lambda old, new: jnp.where(now.done, old, new), now, new)

    return jax.vmap(one)(now, residual, matrix)


@jit_by_code
def _finish(method, space: Space, now):
    return jax.vmap(lambda now: method.finish(space, now))(now)
