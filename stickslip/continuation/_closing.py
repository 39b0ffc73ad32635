"""The equations of a periodic orbit: pieces of motion that join, and the last one the first."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._validation import refusal
from ..hybrid import AbstractHybridSystem, AdaptiveStep, Integrator, SaveAt, simulate
from ..hybrid._bound import depends_on_time
from ..hybrid._components import components_of, period_of
from ._holding import on_constraints

# Points of a period at which the size of each component is read off.
SAMPLES = 64
ROUNDING = 256 * 2.0**-52
TURNS = 0.1  # of its mean speed: an angle that turns so fast shows the place on the orbit


def tight() -> Integrator:
    """The integrator of orbits where none is given."""
    return Integrator(step=AdaptiveStep(1e-12))


def check_autonomous(
    argument: str,
    system: AbstractHybridSystem,
    t0: Any,
    y0: PyTree,
    mode0: Any,
    args: PyTree,
    right: str,
) -> None:
    """Raise for a free period where the time enters: a motion that returns to its state at another
    phase is not periodic."""
    if depends_on_time(system, (), t0, y0, mode0, args):
        raise refusal(argument, None, f"{right}: the system depends on the time", but="left out")


class Motion(NamedTuple):
    """What moves: a system, its arguments, and how it is integrated."""

    system: AbstractHybridSystem
    args: PyTree
    integrator: Integrator


class Frame(NamedTuple):
    """What stays the same while Newton's method runs.

    - `t0`: time of the first point [s]; `period` [s]: that of the forcing times its multiple, or of the
      guess where it is `free`, an unknown too.
    - `anchor`, `normal`: the plane in which the first point is looked for where the period is unknown.
    - `size`: extent of the motion in each component, at least its rounding; residuals are parts of it.
    - `turn`: period of each component that is an angle, infinite for the others.
    """

    t0: Any
    period: Any
    free: bool
    anchor: Any
    normal: Any
    size: Any
    turn: Any


class Closure(NamedTuple):
    """How well a motion closes: scaled residual, and what its pieces were.

    `ends` are the ends of the pieces as flat states; `modes`, those at their ends. `sequence`: hash of
    the guards and modes of each piece, `num_events` how many there are.
    """

    residual: Float[Array, " unknown"]
    ends: Float[Array, "segment size"]
    modes: Array
    good: Array
    result: Any
    flags: Array
    sequence: Array
    num_events: Array


def unknowns(y: Float[Array, "segment size"], frame: Frame) -> Float[Array, " unknown"]:
    """States at the knots, one after the other, and the period if it is free; in parts of the size."""
    flat = jnp.ravel(y / frame.size[None, :])
    return jnp.append(flat, 1.0) if frame.free else flat


def known(u: Float[Array, " unknown"], frame: Frame, segments: int) -> tuple[Any, Any]:
    """States at the knots `[segment, size]` and the period, of a vector of unknowns."""
    period = frame.period * u[-1] if frame.free else frame.period
    return u[: segments * frame.size.shape[0]].reshape(segments, -1) * frame.size[None, :], period


def wrapped(away: Float[Array, "..."], turn: Float[Array, " size"]) -> Float[Array, "..."]:
    """Differences of states without whole turns of angles."""
    turn = turn.reshape((1,) * (away.ndim - 1) + turn.shape)
    period = jnp.where(jnp.isfinite(turn), turn, 1.0)
    return away - jnp.where(jnp.isfinite(turn), period * jnp.round(away / period), 0.0)


def closure(
    u: Float[Array, " unknown"], modes: Array, motion: Motion, frame: Frame, unravel: Any
) -> Closure:
    r"""Residual of $\varphi_{T/m}(y_k) = y_{k+1}$, $k = 0 \dots m-1$, $y_m = y_0$, by the size.

    Where the period is free the last number is the distance of $y_0$ from the plane of the frame.
    Pieces begin on what their modes hold, from where a stick would go on at any speed.
    """
    segments = modes.shape[0]
    y, period = known(u, frame, segments)
    times = frame.t0 + period * jnp.arange(segments + 1, dtype=jnp.float64) / segments

    def piece(begin, end, state, mode):
        state = on_constraints(motion.system, begin, state, unravel, mode, motion.args)
        solution = simulate(
            motion.system, begin, end, unravel(state), mode, motion.args,
            integrator=motion.integrator, saveat=SaveAt(events=False), max_events=None, throw=False,
        )  # fmt: skip
        return (
            ravel_pytree(solution.y1)[0], solution.mode1, solution.successful, solution.result,
            solution.flags, solution.sequence, solution.num_events,
        )  # fmt: skip

    ends, after, *told = _each(piece, times[:-1], times[1:], y, modes)
    away = ends - jnp.roll(y, -1, axis=0)
    # Of the last piece alone: the knots go on turning.
    away = away.at[-1].set(wrapped(away[-1], frame.turn))
    residual = jnp.ravel(away / frame.size[None, :])
    if frame.free:
        plane = jnp.sum(frame.normal * (y[0] - frame.anchor) / frame.size)
        residual = jnp.append(residual, plane)
    return Closure(residual, ends, after, *told)


def _each(piece: Any, *rows: Any) -> Any:
    """A function of each row; of the only one by itself, whose program is half as large."""
    if rows[0].shape[0] > 1:
        return jax.vmap(piece)(*rows)
    alone = piece(*(row[0] for row in rows))
    return jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], alone)


class Extent(NamedTuple):
    """What a motion reaches in a time: see `extent`."""

    moves: Float[Array, " size"]
    least: Float[Array, " size"]
    winding: Float[Array, " size"]
    knots: Float[Array, "segment size"]
    modes: Array


def extent(
    motion: Motion, y: PyTree, mode: Any, t0: Any, period: Any, segments: int, turn: Any
) -> Extent:
    """How far each component moves along one period, and the states and modes at the knots.

    `moves`: the difference between the largest and the smallest value; where a component does not
    move, its value, or 1. `least`: the least absolute value, 0 where the component passes through zero.
    `winding`: of an angle, how often it goes round.
    """
    # Knots first, so that none is missed by rounding.
    parts = segments * -(-SAMPLES // segments)
    ts = t0 + period * jnp.arange(parts, dtype=jnp.float64) / parts
    solution = simulate(
        motion.system, t0, t0 + period, y, mode, motion.args, integrator=motion.integrator,
        saveat=SaveAt(ts=ts, events=False), max_events=None, throw=False,
    )  # fmt: skip
    outputs = solution.outputs
    assert outputs is not None
    flat = jax.vmap(lambda state: ravel_pytree(state)[0])(outputs.y)
    finite = jnp.isfinite(flat)
    high = jnp.max(jnp.where(finite, flat, -jnp.inf), axis=0)
    low = jnp.min(jnp.where(finite, flat, jnp.inf), axis=0)
    largest = jnp.maximum(jnp.abs(high), jnp.abs(low))
    span = high - low
    moves = jnp.where(span > ROUNDING * largest, span, jnp.where(largest > 0, largest, 1.0))
    each = parts // segments
    knots, found = flat[::each], outputs.mode[::each]
    first = ravel_pytree(y)[0]
    knots = jnp.where(jnp.all(jnp.isfinite(knots)), knots, first[None, :])
    modes = jnp.where(found < 0, mode, found).astype(jnp.asarray(mode).dtype)
    turns = jnp.round((ravel_pytree(solution.y1)[0] - first) / turn)
    least = jnp.maximum(jnp.maximum(low, -high), 0.0)
    return Extent(moves, least, jnp.where(jnp.isfinite(turns), turns, 0.0), knots, modes)


def plane_across(slope: Any, size: Any, winding: Any, turn: Any, period: Any) -> Array:
    """Unit normal, in parts of the size, of the plane in which the first point is looked for.

    Across the motion there. Where angles go round, across their turning alone: speeds may have to
    change by much more than their ripple, which says nothing about the place on the orbit.
    """
    mean = jnp.where(winding != 0.0, winding * jnp.where(winding != 0.0, turn, 1.0) / period, jnp.inf)
    turning = jnp.where(winding != 0.0, slope / size, 0.0)
    slope = jnp.where(jnp.any(slope / mean > TURNS), turning, slope / size)
    length = jnp.linalg.norm(slope)
    return slope / jnp.where(length > 0, length, 1.0)


def turns_of(system: AbstractHybridSystem, y: PyTree) -> np.ndarray:
    """Period of each number of the flat state that is an angle, infinite for the others."""
    parts = []
    for name, leaf in components_of(y).items():
        turn = period_of(system, name)
        parts.append(np.full(int(np.size(leaf)), np.inf if turn is None else turn))
    return np.concatenate(parts)
