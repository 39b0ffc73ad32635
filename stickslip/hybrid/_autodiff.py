"""The differentiable core: logs and end state as a function of parameters, start time and state.

Forward mode differentiates the time loop itself: one pass carries the run and its tangents. Reverse
mode cannot go through a loop of unknown length; its sweep is written out in `_adjoint.py`. Both are
readings of one primitive, that of `_along.py`.

So reverse mode, and a linear map of the tangents that is kept, run the motion once more, in a program
of their own. Its steps end elsewhere, because their lengths follow from the last digits of an error.
A result of the steps, and not of the motion alone, has no derivative; rows of logs belong to each other
where their numbers agree.

Not public in equinox: `equinox.internal.nondifferentiable`.
"""

from typing import Any, NamedTuple

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._adjoint import adjoint
from ._along import NO_SECOND, along
from ._crossing import crossings, crossings_near
from ._loop_state import Known, Lane, Plan, start_lane
from ._record import Capacities, Crossed, Logs, no_rows, record
from ._tolerance import largest_magnitude, sizes, too_loose
from .status import COARSE, flag, told
from .tree import frozen

_NO_STEPS = "derivatives of SaveAt(steps=True): the integrator chose the times; state them as `ts`"


class Smooth(NamedTuple):
    """Floating-point results: what derivatives exist of."""

    t: Any
    y: PyTree
    logs: Logs  # with None for every integer


class Counts(NamedTuple):
    """Integer results."""

    mode: Any
    status: Any
    flags: Any
    flagged_at: Any
    flagged_guard: Any
    sequence: Any
    attempts: Any
    accepted: Any
    events: Any
    crossings: tuple
    outputs: Any
    steps: Any
    logs: Logs  # with None for every float


def _raw(
    inputs, fixed, plan: Plan, capacities: Capacities, known: Known | None = None, pushes: bool = False
) -> tuple[Smooth, Counts]:
    """`known`: what a run before has met, where it is run again for a derivative; `pushes`: whether it
    pushes a direction forward."""
    (problem, t0, y0), (mode0, t1, outputs) = inputs, fixed
    lane = start_lane(plan, t0, y0, mode0)
    lane, logs, steps = record(plan, capacities, problem, lane, t1, outputs)

    def found_from(section, starts, number, near=None):
        if near is None:
            held = frozen((problem, starts)) if pushes else (problem, starts)
            found = crossings(plan, held[0], section, held[1], number.astype(jnp.int32))
            if not pushes:
                return found
            near = found.t  # the search has no derivatives: they are those of its last step
        return crossings_near(plan, problem, section, starts, near)

    near = () if known is None else (known.near,)
    rows = zip(plan.functions.sections, logs.crossings, lane.crossings, *near, strict=True)
    logs = logs._replace(crossings=tuple(found_from(*row) for row in rows))
    if known is not None:
        logs = _where_met(known, lane, logs)
    return _as_results(plan, y0, lane, logs, steps)


def _shapes(inputs, fixed, plan: Plan, capacities: Capacities) -> tuple[Smooth, Counts]:
    """Shapes and types of `_raw`, which need no run."""

    def begun(inputs, fixed):
        (_, t0, y0), (mode0, *_) = inputs, fixed
        lane = start_lane(plan, t0, y0, mode0)
        logs = no_rows(capacities, lane)
        rows = tuple(Crossed(rows.t, rows.y, rows.y, rows.mode) for rows in logs.crossings)
        return _as_results(plan, y0, lane, logs._replace(crossings=rows), jnp.zeros((), jnp.int32))

    return eqx.filter_eval_shape(begun, inputs, fixed)


def _as_results(plan: Plan, y0: PyTree, lane: Lane, logs: Logs, steps: Any) -> tuple[Smooth, Counts]:
    """The results of a run: floats apart from integers."""

    def count(value):
        return value.astype(jnp.int32)

    flags, flagged_at, flagged_guard = told(lane.flags)
    smooth_logs, integer_logs = eqx.partition(logs, eqx.is_inexact_array)
    return (
        Smooth(lane.t, lane.y, smooth_logs),
        Counts(
            mode=lane.mode,
            status=count(lane.status),
            flags=flags | flag(too_loose(plan.atols, plan.kinds, plan.noise, _size(lane, y0)), COARSE),
            flagged_at=flagged_at,
            flagged_guard=flagged_guard,
            sequence=lane.sequence,
            attempts=count(lane.attempts),
            accepted=count(lane.accepted),
            events=count(lane.events),
            crossings=tuple(map(count, lane.crossings)),
            outputs=lane.next_output,
            steps=steps,
            logs=integer_logs,
        ),
    )


def _where_met(known: Known, lane: Lane, logs: Logs) -> Logs:
    """Logs whose slopes are not numbers where they belong to no row: of steps, and of other events."""
    met = jnp.where(known.is_met(lane), 1.0, jnp.nan)

    def times(factor, log):
        return jax.tree.map(lambda a: factor * a if eqx.is_inexact_array(a) else a, log)

    return logs._replace(
        events=times(met, logs.events), crossings=times(met, logs.crossings),
        steps=times(jnp.nan, logs.steps),
    )  # fmt: skip


def _size(lane, y0):
    """Largest magnitudes: those followed, those at the ends, and what the last free step changed."""
    moved = jax.tree.map(lambda slope: lane.h_free * slope, lane.dy)
    followed = sizes(y0) if lane.size is None else lane.size
    return largest_magnitude(largest_magnitude(followed, lane.y), moved)


@eqx.filter_custom_jvp
def core(inputs, *, fixed, plan: Plan, capacities: Capacities) -> tuple[Smooth, Counts]:
    """Run one lane; derivatives exist by `inputs = (problem, t0, y0)`, not by `fixed`.

    `fixed = (mode0, t1, outputs)`: the end and the output times enter after the run.
    """
    return _raw(inputs, fixed, plan, capacities)


@core.def_jvp
def _core_jvp(primals, tangents, *, fixed, plan, capacities):
    (inputs,), (t_inputs,) = primals, tangents
    operands, rest = eqx.partition((inputs, fixed, plan, capacities), eqx.is_array)

    def both(t_inputs, operands):
        inputs, *others = eqx.combine(operands, rest)
        return _pushed_forward(t_inputs, inputs, *others)

    def results(operands):
        inputs, fixed, plan, capacities = eqx.combine(operands, rest)
        return core(inputs, fixed=fixed, plan=plan, capacities=capacities)

    def slopes(t_inputs, operands, found):
        inputs, *others = eqx.combine(operands, rest)
        return _pushed_forward(t_inputs, inputs, *others, known=_as_known(found))[1]

    def pull(wanted, bars, operands, found):
        inputs, fixed, plan, _ = eqx.combine(operands, rest)
        return _pulled_back(wanted, bars, inputs, fixed, plan, found)

    like = _shapes(inputs, fixed, plan, capacities)
    out, t_smooth = along(t_inputs, operands, (like, like[0]), both, results, slopes, pull)
    # Derivatives exist of `Smooth` alone; what counts is integers, whose tangent is None.
    return out, (t_smooth, jax.tree.map(lambda _: None, out[1]))


def _as_known(found: tuple[Smooth, Counts]) -> Known:
    smooth, counts = found
    return Known(tuple(log.t for log in smooth.logs.crossings), counts.crossings, counts.sequence)


def _pushed_forward(t_inputs, inputs, fixed, plan, capacities, known=None) -> tuple[Any, Smooth]:
    """Results of a run, and their slopes along the direction `t_inputs`."""
    # Only what has a tangent is pushed forward: what is held costs no pass through the loop.
    moving = jax.tree.map(lambda t: t is not None, t_inputs, is_leaf=lambda t: t is None)
    inexact, others = eqx.partition(inputs, eqx.is_inexact_array)
    varied, held = eqx.partition(inexact, moving)

    def run(varied):
        out = _raw(eqx.combine(varied, held, others), fixed, plan, capacities, known, pushes=True)
        return out[0], out

    _, slopes, out = jax.jvp(run, (varied,), (eqx.filter(t_inputs, moving),), has_aux=True)
    # The integrator chose the times of its steps.
    steps = jax.tree.map(lambda a: jnp.full_like(a, jnp.nan), slopes.logs.steps)
    return out, slopes._replace(logs=slopes.logs._replace(steps=steps))


def _pulled_back(wanted, bars, inputs, fixed, plan, found):
    if jax.tree.leaves(bars.logs.steps):
        raise NotImplementedError(f"stickslip.simulate does not offer {_NO_STEPS}.")
    wanted = jax.tree.map(bool, wanted, is_leaf=lambda w: w is None)
    inputs, fixed = eqxi.nondifferentiable((inputs, fixed), msg=f"stickslip: no {NO_SECOND}")
    cotangents = adjoint(inputs, fixed, _as_known(found), wanted, plan, _with_zeros(bars, found[0]))
    return jax.tree.map(lambda w, b: b if w else None, wanted, cotangents)


def _with_zeros(cotangents: Smooth, like: Smooth) -> Smooth:
    """The cotangents with their zeros written out, but None for a log that has none else."""

    def fill_missing(given, like):
        def fill(s, bar):
            return jnp.zeros(s.shape, s.dtype) if bar is None else bar

        return jax.tree.map(fill, like, given)

    def log(given, like) -> Any:
        return fill_missing(given, like) if jax.tree.leaves(given) else None

    logs, forms = cotangents.logs, like.logs
    return Smooth(
        fill_missing(cotangents.t, like.t),
        fill_missing(cotangents.y, like.y),
        Logs(
            events=log(logs.events, forms.events),
            crossings=tuple(map(log, logs.crossings, forms.crossings)),
            outputs=log(logs.outputs, forms.outputs),
            steps=None,
        ),
    )
