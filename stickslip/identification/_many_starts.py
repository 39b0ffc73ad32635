"""The same fit from many starts at once, and starts spread over the space of the unknowns."""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from .._argument_checks import check_arguments, choice, count, instance, or_none, static_number
from .._jit_by_code import jit_by_code
from .._types import Given
from .._validation import (
    check_callable,
    check_finite,
    is_concrete,
    leaves_of,
    numbers,
    refusal,
    shape_refusal,
)
from ..progress import Progress
from ..sweep import map_lanes
from ..sweep.lanes import EXECUTORS, VECTOR
from ._accuracy import ACCURACY
from ._evaluate import evaluation
from ._fit import Fit
from ._gauss_newton import LevenbergMarquardt
from ._least_squares import A_METHOD
from ._methods import AbstractIterativeMethod
from ._sensitivity import Sensitivity
from ._unknowns import NamedUnknownRows, NamedUnknowns, NamedValues, Space, scalars, space_of

LANES = {"chunk_size": or_none(count(1)), "executor": choice(EXECUTORS)}


@check_arguments(count=count(1), spread=static_number("positive"), seed=count(0))
def sobol_starts(
    unknowns: NamedUnknowns, count: int, *, spread: float = 2.0, seed: int = 0
) -> dict[str, np.ndarray]:
    """Starts for `many_starts` that fill the space of the unknowns evenly: a scrambled Sobol sequence.

    An unknown with two finite bounds is spread evenly between them; one with a prior as the prior is,
    within the bounds; any other within a factor `spread` of its start, or of its distance from the
    bound, on both sides; without bounds within `spread` times its scale. The first start is the
    unknowns' own.

    **Arguments:** `unknowns` as for `least_squares`; `count`; `spread`, above 1; `seed`.
    **Returns** rows of values by name: for a `Problem`, `problem.fit(starts=...)` and `fits(rows)` keep
    bounds, units and priors; for `many_starts` each row belongs into its `Unknown` again, for plain
    rows are of positive unknowns. **Raises** `TypeError`, `ValueError` for anything else.
    """
    from scipy.stats import norm, qmc

    space, first = scalars("unknowns", unknowns)
    sobol: Any = qmc.Sobol  # `seed` is called `rng` in new versions, which take both
    points = sobol(len(space.names), seed=seed).random(2 ** int(np.ceil(np.log2(count + 1))))
    points = np.clip(points[:count], 1e-3, 1.0 - 1e-3)
    found = {}
    for i, name in enumerate(space.names):
        value, u = float(first[name]), points[:, i]
        low, high = space.bounds[i]
        prior = space.priors[i]
        if prior is not None:
            row = float(prior.mean) + float(prior.sd) * norm.ppf(u)
        elif low is not None and high is not None:
            row = low + (high - low) * u
        elif low is not None or high is not None:
            bound: Any = low if high is None else high
            row = bound + (value - bound) * spread ** (2.0 * u - 1.0)
        else:
            row = value + float(space.scales[i]) * spread * (2.0 * u - 1.0)
        row = _inside(row, low, high, value)
        row[0] = value
        found[name] = row
    return found


def _inside(row: np.ndarray, low: float | None, high: float | None, value: float) -> np.ndarray:
    """Rows of a prior may lie beyond the bounds: those come back to the start."""
    good = np.ones(row.shape, bool)
    if low is not None:
        good &= row > low
    if high is not None:
        good &= row < high
    return np.where(good, row, value)


@check_arguments(method=A_METHOD, progress=or_none(instance(bool, "True, False or None")), **LANES)
def many_starts(
    residual: Callable[..., Any],
    starts: NamedUnknownRows,
    *shared: PyTree,
    method: Given[AbstractIterativeMethod | None] = None,
    chunk_size: int | None = None,
    executor: str = "auto",
    progress: bool | None = None,
) -> Fit:
    """A fit from every start; `best` picks the best of them.

    Residuals and Jacobians of all starts that are still on their way are evaluated together, on all
    cores, by one compiled program that the methods have in common.

    **Arguments**

    - `residual(values, *shared)`; `starts`, by name one row of positive numbers, or an `Unknown` with a
      row. `method`, by default `LevenbergMarquardt()`.
    - `shared`: arrays that are the same for all starts. Handed over like this, other data of the same
      shape use the program that is compiled already, as long as `residual` is the same function.
    - `chunk_size`, `executor` as for `stickslip.map_lanes`. One program serves all steps and all
      numbers of starts up to 8, or 32, 128 and so on, or any number with a `chunk_size`: where fewer
      are on their way it is filled up with copies. Some 10 to 100 starts are usual.
    - `progress`: a line on stderr with how many have ended, the step and the lowest cost; by default
      from the third second on, True at once, False never.

    **Returns** a `Fit` with the starts in front. **Raises** as `least_squares`, and `ValueError` for
    starts of different lengths, and `shared` with numbers that are not finite. It is a loop
    of Python and does not work under `jit`. Interrupted (`KeyboardInterrupt`) it keeps no fit, but says
    where the best of them had come to.
    """
    check_callable("residual", residual, "f(values, *shared)", {}, *shared)
    space, found = rows_of("starts", starts)
    check_shared(shared)
    found = {name: np.asarray(row) for name, row in found.items()}
    method = LevenbergMarquardt() if method is None else method
    return many_fits(method, residual, space, found, shared, chunk_size, executor, progress)


def many_fits(
    method: AbstractIterativeMethod,
    residual: Callable[..., Any],
    space: Space,
    found: NamedValues,
    shared: tuple[PyTree, ...],
    chunk_size: int | None,
    executor: str = "auto",
    progress: bool | None = None,
) -> Fit:
    """`many_starts` of what has been checked: from rows of values of the unknowns of a space."""
    count = next(iter(found.values())).shape[0]
    program, _ = evaluator(residual, space, chunk_size, executor, 0, (), method.loss)
    width = _width(program, count, chunk_size)
    room = -(-count // width) * width
    shared = jax.tree.map(lambda a: np.broadcast_to(a, (room, *np.shape(a))), shared)
    program, shared = evaluator(residual, space, chunk_size, executor, room, shared, method.loss)
    now = None
    filled = {name: np.pad(a, (0, room - count), mode="edge") for name, a in found.items()}
    todo, z = np.arange(count), np.asarray(space.coordinates(filled))
    meter, best = Progress("many_starts", count, things="starts", shown=progress), _Best()
    try:
        with meter:
            while todo.size:
                out, matrix = evaluate_rows(program, z, shared, todo, width)
                best = best.or_lower(z[todo], out[todo])
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
            f"ended. {best.in_words(space)}"
        ) from None
    # Cut off by NumPy: a slice of each length would be a program of its own.
    return jax.tree.map(lambda a: jax.device_put(np.asarray(a)[:count]), _finish(method, space, now))


class _Best(NamedTuple):
    """The lowest cost of all evaluations, and where it was."""

    steps: int = 0
    cost: float = math.inf
    z: np.ndarray | None = None

    def or_lower(self, z: np.ndarray, residuals: np.ndarray) -> "_Best":
        costs = 0.5 * np.sum(residuals**2, axis=1)
        costs[~np.isfinite(costs)] = math.inf
        i = int(np.argmin(costs))
        if costs[i] < self.cost:
            return _Best(self.steps + 1, float(costs[i]), z[i])
        return self._replace(steps=self.steps + 1)

    def in_words(self, space: Space) -> str:
        if self.z is None:
            return "None was finite."
        values = space.values(jnp.asarray(self.z))
        where = ", ".join(f"{name} = {float(value):.6g}" for name, value in values.items())
        return f"The lowest cost was {self.cost:.6g}, at {where}."


@check_arguments(**LANES)
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
    space, found = rows_of("values", values)
    count = next(iter(found.values())).shape[0]
    for i, tree in enumerate(each):
        for name, leaf in leaves_of(f"each[{i}]", tree):
            check_finite(name, leaf)
            if np.shape(leaf)[:1] != (count,):
                raise shape_refusal(name, leaf, f"an array of {count} rows, as values")
    each = jax.tree.map(np.asarray, each)
    program, each = evaluator(residual, space, chunk_size, executor, count, each)
    rows, z = np.arange(count), space.coordinates(found)
    matrix = evaluate_rows(program, z, each, rows, asked_width(program, chunk_size))[1]
    return Sensitivity(space.names, jnp.asarray(matrix))


def rows_of(name: str, values: Any) -> tuple[Space, NamedValues]:
    """Unknowns, and rows of one length of their values, by name."""
    space, found = space_of(name, values)
    shapes = {key: a.shape for key, a in found.items()}
    if len(set(shapes.values())) != 1 or len(next(iter(shapes.values()))) != 1:
        raise refusal(name, values, "rows of one length by name", but=f"of shapes {shapes}")
    if not is_concrete(found):
        raise refusal(name, values, "known: this is a loop of Python, call it outside of jit and vmap")
    return space, found


def check_shared(shared: tuple[PyTree, ...]) -> None:
    """Arrays of finite numbers, which are handed to the residual."""
    for i, tree in enumerate(shared):
        for name, leaf in leaves_of(f"shared[{i}]", tree):
            check_finite(name, numbers(name, leaf))


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
    asked, width = asked_width(program, chunk_size), VECTOR
    while width < count:
        width *= ACCURACY.more_starts
    return min(width, _most(program)) if asked is None else asked


def asked_width(program: map_lanes, chunk_size: int | None) -> int | None:
    """Rows of every call where chunks of one size are asked for: one program, however few the rows."""
    return None if chunk_size is None else _most(program)


def evaluate_rows(
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
