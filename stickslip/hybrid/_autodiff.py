"""The differentiable core: logs and end state as a function of parameters, start time and state.

Forward mode differentiates the time loop itself (one pass carries the tangents). Reverse mode cannot
go through a loop of unknown length; its sweep is written out in `_adjoint.py`. Both are offered by
one function: its tangent map is a primitive of its own whose transpose is that sweep.

So a derivative is computed by a program of its own, in which the motion is run once more. Its steps end
elsewhere, because their lengths follow from the last digits of an error. A result of the steps, and
not of the motion alone, has no derivative; rows of logs belong to each other where their numbers agree.

Not public in JAX and equinox: `equinox.internal` makes the primitive (`create_vprim`, its
rules, `nondifferentiable`), `jax.interpreters.ad.UndefinedPrimal` says which tangents are transposed.
If one of them moves, it is missed at import or as a derivative is traced, before any number.
"""

from typing import Any, NamedTuple

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.core
import jax.interpreters.ad
import jax.numpy as jnp
from jaxtyping import PyTree

from ._adjoint import adjoint
from ._crossing import crossings, crossings_near
from ._loop_state import Known, Lane, Plan, start_lane
from ._record import Capacities, Logs, record
from ._tolerance import largest_magnitude, sizes, too_loose
from .status import COARSE, flag, told

_NO_SECOND = (
    "second derivatives of a simulation (the event times are corrected to first order only); use "
    "Gauss-Newton, or finite differences of the gradient"
)


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
    inputs, fixed, plan: Plan, capacities: Capacities, known: Known | None = None
) -> tuple[Smooth, Counts]:
    """`known`: what the run has met where it is run for a derivative."""
    problem, t0, y0 = inputs
    mode0, t1, outputs = fixed
    lane = start_lane(plan, t0, y0, mode0)
    lane, logs, steps = record(plan, capacities, problem, lane, t1, outputs)

    def count(value):
        return value.astype(jnp.int32)

    def found_from(section, starts, number, near=None):
        if near is None:
            return crossings(plan, problem, section, starts, count(number))
        return crossings_near(plan, problem, section, starts, near)

    near = () if known is None else (known.near,)
    rows = zip(plan.functions.sections, logs.crossings, lane.crossings, *near, strict=True)
    logs = logs._replace(crossings=tuple(found_from(*row) for row in rows))
    flags, flagged_at, flagged_guard = told(lane.flags)
    if known is not None:
        logs = _where_met(known, lane, logs)
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
    out = core(inputs, fixed=fixed, plan=plan, capacities=capacities)
    # Derivatives exist of `Smooth` alone; what counts is integers, whose tangent is None.
    # The form of the tangents is that of the results; to find it otherwise means tracing all again.
    like = _struct(out[0])
    known = Known(tuple(log.t for log in out[0].logs.crossings), out[1].crossings, out[1].sequence)
    t_inputs = _alongside(t_inputs, (inputs, fixed, known, plan))
    t_smooth = eqxi.filter_primitive_bind(
        _tangent_p, t_inputs, inputs, fixed, known, plan, capacities, like
    )
    return out, (t_smooth, jax.tree.map(lambda _: None, out[1]))


def _alongside(tangents, others):
    """The tangents, with lanes where any of the others has them.

    The transpose is one lane's, and its cotangents have lanes where the tangents do: those of a
    parameter that all lanes share are summed behind it.
    """
    one = jnp.ones(())
    for leaf in jax.tree.leaves(eqx.filter(others, eqx.is_array)):
        if leaf.size:
            same = jnp.ravel(leaf)[0] == jnp.ravel(leaf)[0]
            one = jnp.where(same, one, one)
    return jax.tree.map(lambda t: t * one.astype(t.dtype), tangents)


def _tangent(t_inputs, inputs, fixed, known, plan, capacities, like) -> Smooth:
    # Only what has a tangent is pushed forward: what is held costs no pass through the loop.
    moving = jax.tree.map(lambda t: t is not None, t_inputs, is_leaf=lambda t: t is None)
    inexact, rest = eqx.partition(inputs, eqx.is_inexact_array)
    varied, held = eqx.partition(inexact, moving)

    def run(varied):
        return _raw(eqx.combine(varied, held, rest), fixed, plan, capacities, known)[0]

    return jax.jvp(run, (varied,), (eqx.filter(t_inputs, moving),))[1]


def _struct(tree):
    return jax.tree.map(
        lambda a: jax.ShapeDtypeStruct(a.shape, a.dtype) if hasattr(a, "shape") else a, tree
    )


@eqxi.filter_primitive_def
def _tangent_abstract(t_inputs, inputs, fixed, known, plan, capacities, like):
    return jax.tree.map(lambda s: jax.core.ShapedArray(s.shape, s.dtype), like)


@eqxi.filter_primitive_jvp
def _tangent_jvp(primals, tangents):
    # The map is linear in `t_inputs`, whose tangent it takes to its own. A tangent of anything else is
    # that of a second derivative.
    t_t_inputs, *others = tangents
    if any(leaf is not None for leaf in jax.tree.leaves(others)):
        raise NotImplementedError(f"stickslip.simulate does not offer {_NO_SECOND}.")
    out = eqxi.filter_primitive_bind(_tangent_p, *primals)
    return out, eqxi.filter_primitive_bind(_tangent_p, t_t_inputs, *primals[1:])


@eqxi.filter_primitive_transpose
def _tangent_transpose(operands, cotangents):
    t_inputs, inputs, fixed, known, plan, capacities, like = operands
    if jax.tree.leaves(cotangents.logs.steps):
        raise NotImplementedError(f"stickslip.simulate does not offer {_NO_STEPS}.")

    def is_linear(x):
        return isinstance(x, jax.interpreters.ad.UndefinedPrimal)

    wanted = jax.tree.map(is_linear, t_inputs, is_leaf=lambda x: x is None or is_linear(x))
    inputs, fixed = eqxi.nondifferentiable((inputs, fixed), msg=f"stickslip: no {_NO_SECOND}")
    bars = adjoint(inputs, fixed, known, wanted, plan, _with_zeros(cotangents, like))
    bars = jax.tree.map(lambda w, b: b if w else None, wanted, bars)
    # A transpose returns a cotangent for every operand, None for those it is not linear in.
    nones = [jax.tree.map(lambda _: None, x) for x in (inputs, fixed, known, plan, capacities, like)]
    return (bars, *nones)


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


_tangent_p: Any = eqxi.create_vprim(
    "stickslip_tangent",
    eqxi.filter_primitive_def(_tangent),
    _tangent_abstract,
    _tangent_jvp,
    _tangent_transpose,
)
eqxi.register_impl_finalisation(_tangent_p)
