"""Reverse sweep through a simulation, with memory bounded by checkpoints.

The motion is run once more, in segments whose attempts are put on a tape. Where it ends within its
first segment, the tape is walked backwards at once, and nothing is computed twice. Of a longer run the
lane is kept at the start of every segment of the present chapter, and of every chapter; segment by
segment from the end the tape is then written again, after a chapter that is not the last has been run
through again. So one segment costs one forward sweep, a chapter two, and any longer run three, besides
the walk back. The memory is a tape, and a lane for twice the root of the number of segments.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._loop import run_block, running
from ._loop_state import Known, Lane, Plan, start_lane
from ._pullback import Tape, pull, tape_row
from .accuracy import ACCURACY
from .executor import time_loop
from .tree import select, write_row


class Layout(NamedTuple):
    """How a run is divided: rows of a segment, segments of a chapter, chapters."""

    block: int  # rows that are written and walked through together
    rows: int
    segments: int
    chapters: int

    def place(self, number: Any) -> Any:
        """Where the start of a segment is kept: with the chapters or, within one, by its number."""
        # The start of a chapter is that of its first segment too: it is kept with the chapters alone,
        # because the places of the segments are written over by the next chapter.
        page = number % self.segments
        return jnp.where(page == 0, self.segments + number // self.segments, page)

    @property
    def places(self) -> int:
        """One more than are needed, for what comes after the last segment."""
        return self.segments + self.chapters + 1


def layout(max_steps: int, fused: bool) -> Layout:
    """A tape for the whole run; as many segments in a chapter as chapters."""
    block = ACCURACY.block_fused if fused else ACCURACY.block
    rows = -(-min(max_steps, ACCURACY.tape_rows) // block) * block
    number = -(-max_steps // rows)
    segments = math.isqrt(number - 1) + 1
    return Layout(block, rows, segments, -(-number // segments))


class _Sweep(NamedTuple):
    number: Any  # segment to run next
    goal: Any  # segment to walk back through next; beyond all of them until the last one is known
    kept: PyTree  # starts of segments
    bars: PyTree  # cotangents, called bars as in the literature, before what has been walked through
    met: Any  # whether the whole motion has met what is known of it


def adjoint(inputs, fixed, known: Known, wanted, plan: Plan, cotangents) -> PyTree:
    """Cotangents of `inputs = (problem, t0, y0)` for the cotangents of the smooth results.

    `wanted`: a tree of flags like `inputs`; the others get None. A log without cotangents is None. All
    are NaN where a log has some and the motion does not meet what is `known` of it.
    """
    # `custom_vmap` takes arrays alone, so the trees are flattened and what is static is closed over.
    leaves, form = jax.tree.flatten((inputs, fixed, known, plan, cotangents))
    dynamic = [eqx.is_array(leaf) for leaf in leaves]
    out_form: Any = None

    def swept(axes, values):
        nonlocal out_form
        values = iter(values)
        filled = [next(values) if moves else leaf for leaf, moves in zip(leaves, dynamic, strict=True)]
        given = _Given(*jax.tree.unflatten(form, filled))
        if axes is not None:
            axes = iter(axes)
            places = [next(axes) if moves else None for moves in dynamic]
            axes = _Given(*jax.tree.unflatten(form, places))
        bars, out_form = jax.tree.flatten(_swept(given, axes, wanted))
        return bars

    # Batched by hand: the tape then lies with the lanes of an attempt side by side, and a row is
    # written by one contiguous store.
    @jax.custom_batching.custom_vmap
    def run(*values):
        return swept(None, values)

    @run.def_vmap
    def run_batch(size, batched, *values):
        bars = swept([0 if moves else None for moves in batched], values)
        return bars, [True] * len(bars)

    bars = run(*(leaf for leaf, moves in zip(leaves, dynamic, strict=True) if moves))
    return jax.tree.unflatten(out_form, bars)


class _Given(NamedTuple):
    inputs: Any
    fixed: Any
    known: Any
    plan: Any
    cotangents: Any


def _swept(given: _Given, axes: _Given | None, wanted) -> PyTree:
    """The sweep, of one lane or, where the operands have `axes`, of a batch."""

    def map_lanes_with(function, *others: int, out: Any = 0):
        """`function(given, *operands)` of the lanes; `others`: the axes of the operands."""
        if axes is None:
            return lambda *operands: function(given, *operands)
        batched = jax.vmap(function, in_axes=(axes, *others), out_axes=out)
        return lambda *operands: batched(given, *operands)

    plan, logs = given.plan, given.cotangents.logs
    parts = layout(plan.max_steps, plan.execute.fused)
    number = jnp.zeros((), jnp.int32)
    attempted = map_lanes_with(
        lambda given, lane: _attempt_block(given, parts.block, lane), 0, out=(0, 1)
    )
    pulled = map_lanes_with(lambda given, rows, bars: _pull_block_back(given, wanted, rows, bars), 1, 0)

    is_met = map_lanes_with(lambda given, lane: given.known.is_met(lane), 0)

    def begin(given: _Given):
        (_, t0, y0), mode0 = given.inputs, given.fixed[0]
        return start_lane(given.plan, t0, y0, mode0)

    # Cotangents behind the last attempt: those of the end itself, and zero of parameters and of the
    # slope, which no result holds.
    def ends(given: _Given):
        (problem, t0, y0), results = given.inputs, given.cotangents
        zero = jax.tree.map(jnp.zeros_like, (eqx.filter(problem, wanted[0]), t0, y0))
        return zero[0], zero[1] + results.t, jax.tree.map(jnp.add, zero[2], results.y), zero[2]

    def ahead(begun):
        """One segment, put on a tape: where it ends, the tape, number of its rows."""

        def body(carry):
            count, lane, tape = carry
            lane, rows = attempted(lane)
            return count + parts.block, lane, _write_rows(tape, rows, count)

        def goes_on(carry):
            return (carry[0] < parts.rows) & running(carry[1])

        count, begun, tape = jax.lax.while_loop(goes_on, body, (number, begun, empty))
        return begun, tape, count

    def back(count, tape, bars):
        """Cotangents before the first `count` rows of the tape from those after them."""

        def body(carry):
            count, bars = carry
            return count - parts.block, pulled(_read_rows(tape, count - parts.block, parts.block), bars)

        return jax.lax.while_loop(lambda carry: carry[0] > 0, body, (count, bars))[1]

    def body(now: _Sweep):
        # One pass through this body runs one segment forwards. If that was the one to walk back next,
        # it is walked back on the tape that is still there; else (`meets` is false) no row is.
        begun = _read_row(now.kept, parts.place(now.number))
        begun, tape, count = ahead(begun)
        kept = write_row(now.kept, begun, parts.place(now.number + 1))
        # The last segment is known when it has been run for the first time.
        found = (now.goal == total) & ~(running(begun) & (now.number < total - 1))
        met = jnp.where(found, is_met(begun), now.met)
        meets = found | (now.number == now.goal)
        bars = back(jnp.where(meets, count, 0), tape, now.bars)
        goal = jnp.where(meets, now.number - 1, now.goal)
        # Before the start of this chapter, the segments of another have to be found again.
        turned = jnp.where(
            now.number % parts.segments == 0, goal // parts.segments * parts.segments, goal
        )
        return _Sweep(jnp.where(meets, turned, now.number + 1), goal, kept, bars, met)

    total = parts.segments * parts.chapters
    begun = map_lanes_with(begin)()
    kept = write_row(_room(begun, parts.places), begun, parts.place(number))
    # The form of a row is known by tracing an attempt only; the loop needs it before the first.
    rows = jax.eval_shape(attempted, begun)[1]
    empty = jax.tree.map(lambda a: jnp.zeros((parts.rows, *a.shape[1:]), a.dtype), rows)
    # A goal of `total`, a segment that does not exist, says that the last one is not known yet.
    start = _Sweep(number, number + total, kept, map_lanes_with(ends)(), is_met(begun))
    end = jax.lax.while_loop(lambda now: now.goal >= 0, body, start)
    if logs.events is None and all(log is None for log in logs.crossings):
        return end.bars[:3]
    where_met = map_lanes_with(lambda given, met, bars: select(met, bars, _nans(bars)), 0, 0)
    return where_met(end.met, end.bars[:3])


def _attempt_block(given: _Given, block: int, lane: Lane):
    """A block of attempts: the lane after them, and their rows."""
    plan, (problem, _, _), (_, t1, outputs) = given.plan, given.inputs, given.fixed

    def row_of(before, after, outcome):
        return tape_row(plan, given.cotangents.logs, before, outcome)

    return run_block(plan, problem, lane, t1, outputs, block, row_of)


def _pull_block_back(given: _Given, wanted, rows: Tape, bars):
    """Cotangents before a block of attempts from those after it."""
    plan, mode0, logs = given.plan, given.fixed[0], given.cotangents.logs
    varied, held = eqx.partition(given.inputs[0], wanted[0])

    @time_loop
    def sweep(plan, varied, rows, bars, logs, near, mode0):
        def body(bars, row):
            # Systems without guards never leave their mode, and write none on the tape.
            row = row if row.mode is not None else row._replace(mode=mode0)
            return pull(plan, varied, held, row, bars, logs, near), None

        return jax.lax.scan(body, bars, rows, reverse=True)[0]

    return sweep(plan, varied, rows, bars, logs, given.known.near, mode0)


def _nans(tree):
    return jax.tree.map(lambda a: jnp.full_like(a, jnp.nan), tree)


def _room(tree, count: int):
    return jax.tree.map(lambda a: jnp.zeros((count, *a.shape), a.dtype), tree)


def _write_rows(buffers, rows, start):
    def write(buffer, rows):
        places = (start, *(jnp.zeros((), jnp.int32),) * (buffer.ndim - 1))
        return jax.lax.dynamic_update_slice(buffer, rows, places)

    return jax.tree.map(write, buffers, rows)


def _read_rows(buffers, start, count: int):
    return jax.tree.map(lambda a: jax.lax.dynamic_slice_in_dim(a, start, count), buffers)


def _read_row(rows, index):
    def read(buffer):
        return jax.lax.dynamic_index_in_dim(buffer, index, 0, keepdims=False)

    return jax.tree.map(read, rows)
