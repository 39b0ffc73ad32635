"""The equations of a periodic orbit: pieces of motion that join, and the last one the first."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._validation import refusal
from ..analysis.neutral_directions import neutral_shifts, projection_on
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, simulate
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..hybrid.components import components_of
from ..hybrid.longest_step import depends_on_time
from ._accuracy import ACCURACY
from ._holding import on_constraints
from ._monodromy import pieces_of
from ._turns import turns_of, whole_turns, without


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
    """A system that moves, its arguments, and how it is integrated."""

    system: AbstractHybridSystem
    args: PyTree
    integrator: Integrator

    @property
    def closes(self) -> Any:
        """Part of the motion's size to which an orbit returns that is simulated once more.

        With other steps it does so to some hundred tolerances of them.
        """
        step: Any = self.integrator.step
        return (
            jnp.maximum(ACCURACY.closes, step.rtol / ACCURACY.near)
            if step.adaptive
            else ACCURACY.closes
        )


class Frame(NamedTuple):
    """Everything that stays the same while Newton's method runs.

    - `t0`: time of the first point [s]; `period` [s]: that of the forcing times its multiple, or of the
      guess where it is `free`, an unknown too.
    - `anchor`, `normal`: the plane in which the first point is looked for where the period is unknown.
    - `size`: extent of the motion in each component, at least its rounding; residuals are parts of it.
    - `shifts`: columns, of the state, that change neither field nor guards (`neutral_shifts`).
    - `turn`: period of each component that is an angle, infinite for the others; `turns`: how often
      each goes round until the motion closes.
    """

    t0: Any
    period: Any
    free: bool
    anchor: Any
    normal: Any
    size: Any
    shifts: Any
    turn: np.ndarray
    turns: Any


class Closure(NamedTuple):
    """How well a motion closes: scaled residual, and what its pieces were.

    `ends` are the ends of the pieces as flat states; `modes`, those at their ends. `sequence`: hash of
    the guards and modes of each piece, `num_events` how many there are. `pieces`: monodromy of each, in
    parts of the size; `neutral`: projection on the shifts that they leave alone, likewise; `conserved`:
    `conservation_rows`, where the period is known.
    """

    residual: Float[Array, " unknown"]
    ends: Float[Array, "segment size"]
    modes: Array
    good: Array
    result: Any
    flags: Array
    sequence: Array
    num_events: Array
    pieces: Array | None = None
    neutral: Array | None = None
    conserved: Array | None = None


def unknowns(y: Float[Array, "segment size"], frame: Frame) -> Float[Array, " unknown"]:
    """States at the knots, one after the other, and the period if it is free; in parts of the size."""
    flat = jnp.ravel(y / frame.size[None, :])
    return jnp.append(flat, 1.0) if frame.free else flat


def states_and_period(u: Float[Array, " unknown"], frame: Frame, segments: int) -> tuple[Any, Any]:
    """States at the knots `[segment, size]` and the period, of a vector of unknowns."""
    period = frame.period * u[-1] if frame.free else frame.period
    return u[: segments * frame.size.shape[0]].reshape(segments, -1) * frame.size[None, :], period


def closure(
    u: Float[Array, " unknown"], modes: Array, motion: Motion, frame: Frame, unravel: Any
) -> Closure:
    r"""Residual of $\varphi_{T/m}(y_k) = y_{k+1}$, $k = 0 \dots m-1$, $y_m = y_0$, by the size.

    Where the period is free the last number is the distance of $y_0$ from the plane of the frame. The
    last piece has its whole turns here: `equations` takes them away.
    Pieces begin on what their modes hold, from where a stick would go on at any speed.
    """
    segments = modes.shape[0]
    y, period = states_and_period(u, frame, segments)
    times = frame.t0 + period * jnp.arange(segments + 1, dtype=jnp.float64) / segments

    def piece(begin, end, state, mode):
        state = on_constraints(motion.system, begin, state, unravel, mode, motion.args)
        solution = simulate(
            motion.system, begin, end, unravel(state), mode, motion.args,
            integrator=motion.integrator, saveat=SaveAt(max_events=None), throw=False,
        )  # fmt: skip
        return (
            ravel_pytree(solution.y1)[0], solution.mode1, solution.successful, solution.result,
            solution.flags, solution.sequence, solution.num_events,
        )  # fmt: skip

    ends, after, *told = _each(piece, times[:-1], times[1:], y, modes)
    away = ends - jnp.roll(y, -1, axis=0)
    residual = jnp.ravel(away / frame.size[None, :])
    if frame.free:
        plane = jnp.sum(frame.normal * (y[0] - frame.anchor) / frame.size)
        residual = jnp.append(residual, plane)
    return Closure(residual, ends, after, *told)


def equations(
    found_from: Callable[[Array], Closure], u: Float[Array, " unknown"], frame: Frame, segments: int
) -> tuple[Array, Array, Closure]:
    """Residual, its derivative by the unknowns, and the closure, with the place of the orbit fixed.

    Shifts of the state that change nothing make of each orbit a family, whose place is that of the
    anchor: instead of what the orbit closes to along these, which may be a drift, stands how far from
    the anchor it begins. Shifts that an event does not leave alone are none.
    """

    def residual(u):
        found = found_from(u)
        return found.residual, found

    jacobian, found = jax.jacfwd(residual, has_aux=True)(u)
    count = frame.size.shape[0]
    pieces = jnp.stack(pieces_of(jacobian, segments, count))
    changed = jnp.max(jnp.abs(pieces @ frame.shifts - frame.shifts[None]), axis=1)
    grows = jnp.maximum(jnp.max(jnp.abs(pieces), axis=(1, 2)), 1.0)
    kept = jnp.all(changed <= ENGINE.same * grows[:, None], axis=0)
    neutral = projection_on(jnp.where(kept[None, :], frame.shifts, 0.0))
    rows = slice((segments - 1) * count, segments * count)
    last = jacobian[rows] - neutral @ jacobian[rows] + neutral @ jnp.eye(count, u.shape[0])
    jacobian = jacobian.at[rows].set(last)
    conserved = None if frame.free else conservation_rows(jacobian, rows)
    jacobian = jacobian if conserved is None else jacobian + conserved
    found = found._replace(pieces=pieces, neutral=neutral, conserved=conserved)
    found = found._replace(residual=residual_at_place(found, u, frame, neutral))
    return found.residual, jacobian, found


def residual_at_place(
    found: Closure, u: Float[Array, " unknown"], frame: Frame, neutral: Array
) -> Array:
    """The residual with the place of the orbit fixed along `neutral`, in parts of the size."""
    count = frame.size.shape[0]
    rows = slice((found.modes.shape[0] - 1) * count, found.modes.shape[0] * count)
    # Whole turns are taken from the last piece alone: the knots go on turning.
    away = found.residual[rows] * frame.size
    closes = without(away, frame.turns, in_units(neutral, frame.size), frame.turn) / frame.size
    place = neutral @ (u[:count] - frame.anchor / frame.size)
    return found.residual.at[rows].set(closes + place)


def conservation_rows(
    jacobian: Float[Array, "row unknown"], rows: slice
) -> Float[Array, "row unknown"]:
    r"""Equations that quantities stay as they are which the motion conserves whatever the unknowns are.

    Such a quantity, $l \cdot y$ with $l^T(M - I) = 0$, as the place of a massless slider that sticks
    all the time, makes of each forced orbit a family, and says nothing in the residual. There its value
    is that of the first orbit. `rows`: of the last piece.
    """
    jacobian = jnp.where(jnp.isfinite(jacobian), jacobian, 0.0)
    left, strength, _ = jnp.linalg.svd(jacobian, full_matrices=False)
    silent = jnp.where(strength <= ENGINE.slack * strength[0], left, 0.0)
    return jnp.pad(silent @ silent[rows].T, ((0, 0), (0, jacobian.shape[1] - (rows.stop - rows.start))))


def in_units(matrix: Float[Array, "size size"], size: Float[Array, " size"]) -> Array:
    """A matrix in parts of the size as one of states."""
    return matrix * size[:, None] / size[None, :]


def _each(piece: Any, *rows: Any) -> Any:
    """A function of each row; of the only one by itself, whose program is half as large."""
    if rows[0].shape[0] > 1:
        return jax.vmap(piece)(*rows)
    alone = piece(*(row[0] for row in rows))
    return jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], alone)


class Extent(NamedTuple):
    """How far a motion reaches in a time: see `extent`."""

    moves: Float[Array, " size"]
    least: Float[Array, " size"]
    turns: Float[Array, " size"]
    shifts: Float[Array, "size size"]
    knots: Float[Array, "segment size"]
    modes: Array


class Sampled(NamedTuple):
    """A motion from a state for some time: see `samples_of`."""

    y0: PyTree
    mode0: Any
    y1: PyTree
    mode1: Any
    ts: Float[Array, " sample"]
    y: Float[Array, "sample size"]
    mode: Array


def samples_of(motion: Motion, y: PyTree, mode: Any, t0: Any, span: Any, segments: int) -> Sampled:
    """The motion of a time from a state, with the states at the knots and between them."""
    # Knots first, so that none is missed by rounding.
    parts = segments * -(-ACCURACY.samples // segments)
    ts = t0 + span * jnp.arange(parts, dtype=jnp.float64) / parts
    run = simulate(
        motion.system, t0, t0 + span, y, mode, motion.args, integrator=motion.integrator,
        saveat=SaveAt(ts=ts, max_events=None), throw=False,
    )  # fmt: skip
    assert run.outputs is not None
    flat = jax.vmap(lambda state: ravel_pytree(state)[0])(run.outputs.y)
    return Sampled(y, mode, run.y1, run.mode1, ts, flat, run.outputs.mode)


def extent(
    motion: Motion, run: Sampled, t0: Any, period: Any, segments: int, free: bool,
    gained: Float[Array, " size"],
) -> Extent:  # fmt: skip
    """How far each component moves along one period, and the states and modes at the knots.

    `moves`: the difference between the largest and the smallest value; where a component does not
    move, its value; where this is 0, the largest of the others with its unit, or 1. `least`: the least
    absolute value, 0 where the component passes through zero. `turns`: how often each angle goes round:
    whole ones nearest to what it has `gained` in the period, or, where this is NaN, to what it gains in
    the simulation `run`. `shifts`: columns that change nothing, in parts of `moves`.
    """
    y, mode, ts, flat = run.y0, run.mode0, run.ts, run.y
    finite = jnp.isfinite(flat)
    high = jnp.max(jnp.where(finite, flat, -jnp.inf), axis=0)
    low = jnp.min(jnp.where(finite, flat, jnp.inf), axis=0)
    largest = jnp.maximum(jnp.abs(high), jnp.abs(low))
    span = high - low
    goes = span > ACCURACY.short * largest
    rests = jnp.where(largest > 0, largest, _alike(motion.system, y, jnp.where(goes, span, 0.0)))
    moves = jnp.where(goes, span, rests)
    each = ts.shape[0] // segments
    knots, found = flat[::each], run.mode[::each]
    first, unravel = ravel_pytree(y)
    knots = jnp.where(jnp.all(jnp.isfinite(knots)), knots, first[None, :])
    modes = jnp.where(found < 0, mode, found).astype(jnp.asarray(mode).dtype)
    end, turn = ravel_pytree(run.y1)[0], turns_of(motion.system, y)
    gained = jnp.where(jnp.isnan(gained), end - first, gained)
    shifts = neutral_shifts(motion.system, motion.args, ts, flat, run.mode, unravel, moves)
    if free:
        path = jnp.concatenate([flat, end[None]]) / moves[None, :]
        goes = jnp.round(gained / turn) != 0.0
        shifts = jnp.where(_closed_by(shifts, path, goes), 0.0, shifts)
    turns = whole_turns(gained, in_units(projection_on(shifts), moves), turn)
    least = jnp.maximum(jnp.maximum(low, -high), 0.0)
    return Extent(moves, least, turns, shifts, knots, modes)


def _alike(system: AbstractHybridSystem, y: PyTree, spans: Array) -> Array:
    """For each component the largest span of those with its unit; 1 where none of them moves."""
    named = components_of(y).items()
    units = [system.units.get(name) for name, leaf in named for _ in range(np.size(leaf))]
    same = np.array([[one is not None and one == other for other in units] for one in units])
    most = jnp.max(jnp.where(same, spans[None, :], 0.0), axis=1)
    return jnp.where(most > 0.0, most, 1.0)


def _closed_by(shifts: Array, path: Float[Array, "sample size"], goes: Array) -> Array:
    """Which shift a motion of unknown period has to come round by, as it does nothing but turn."""
    rest = path - path @ projection_on(shifts)
    span = jnp.max(rest, axis=0) - jnp.min(rest, axis=0)
    largest, rounding = (jnp.max(jnp.abs(a), axis=0) for a in (rest, ACCURACY.short * path))
    swings = (span > ENGINE.same * largest + rounding) & (
        jnp.abs(rest[-1] - rest[0]) < ACCURACY.shorter * span
    )
    turning = jnp.any(goes[:, None] & (shifts != 0.0), axis=0)
    first = jnp.arange(turning.size) == jnp.argmax(turning)
    return turning & first & ~jnp.any(swings)


def plane_across(
    slope: Any, size: Any, shifts: Any, turns: Any, turn: np.ndarray, period: Any
) -> Array:
    """Unit normal, in parts of the size, of the plane in which the first point is looked for.

    Across the motion there, but for shifts that change nothing. Where angles go round, across their
    turning alone: speeds may have to change by much more than their ripple, which says nothing about
    the place on the orbit.
    """
    slope = slope / size
    slope = slope - projection_on(shifts) @ slope
    goes = turns != 0.0
    mean = jnp.where(goes, turns * jnp.where(goes, turn, 1.0) / (period * size), jnp.inf)
    turning = jnp.where(goes, slope, 0.0)
    slope = jnp.where(jnp.any(slope / mean > ACCURACY.swerves), turning, slope)
    length = jnp.linalg.norm(slope)
    return slope / jnp.where(length > 0, length, 1.0)
