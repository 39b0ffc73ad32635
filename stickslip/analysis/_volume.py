"""Mean growth of volume in the space of states: what the exponents add up to."""

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._types import Given, Mode, Numeric, Whole
from .._validation import as_float64, as_parameter, check_count, check_handed_on, check_type
from ..derived import WithIntegrals
from ..hybrid import AbstractHybridSystem, Integrator, SaveAt, saltation_matrix, simulate
from ..hybrid.arguments import a_time, check_field, mode_index, the_system
from ._arguments import an_integrator, start_of
from ._recording import Segments


def divergence(
    system: AbstractHybridSystem, t: Numeric, y: PyTree, mode: Whole, args: PyTree = None
) -> Float[Array, ""]:
    r"""Divergence $\mathrm{div}\,f_m = \mathrm{tr}\,\partial f_m/\partial y$ of the field [1/s].

    **Errors** `ValueError`/`TypeError` naming the argument.
    """
    the_system(system)
    check_handed_on("args", args)
    t, y, mode = a_time("t", t), as_float64("y", y), mode_index("mode", system, mode)
    check_field(system, t, y, mode, args, name="y")
    flat, unravel = ravel_pytree(y)

    def field(flat):
        return ravel_pytree(system.vector_field(t, unravel(flat), mode, args))[0]

    return jnp.trace(jax.jacfwd(field)(flat))


def volume_growth(
    system: Given[AbstractHybridSystem],
    y0: PyTree,
    record: Given[Segments],
    *,
    mode0: Mode | None = None,
    args: PyTree = None,
    integrator: Given[Integrator | None] = None,
    max_events: Given[int] = 4096,
) -> Float[Array, ""]:
    r"""Mean growth rate of an infinitesimal volume along the motion from `y0` [1/s],

    $$\frac1T\Bigl[\int_{t_1}^{t_1 + T} \mathrm{div}\,f\,dt + \sum_{\text{events}} \ln|\det S|\Bigr],$$

    with the saltation matrix $S$ of each event, over the segments of `record` without what it drops
    and its warm-up. It equals the sum of all Lyapunov exponents, and is
    computed without tangents: an independent check of `lyapunov_spectrum`. `-inf` where an event
    loses rank (slip to stick).

    **Arguments**: as for `lyapunov_spectrum`; `max_events`, room for the events of a motion whose
    system has guards.
    **Errors** as `simulate`, `RESULTS.max_events_reached` among them.
    """
    the_system(system)
    check_type("record", record, Segments, "a Segments(length, count)")
    duration = as_parameter(record.length) * record.count
    dropped = record.transient + record.length * record.warm_up_count
    t0 = a_time("t0", record.t0)
    check_count("max_events", max_events, 1)
    integrator = an_integrator(integrator)
    y0, mode = start_of(system, t0, y0, mode0, args)
    if not (isinstance(dropped, int | float) and dropped == 0):
        early = simulate(
            system,
            t0,
            t0 + dropped,
            y0,
            mode,
            args,
            integrator=integrator,
            saveat=SaveAt(max_events=None),
        )
        t0, y0, mode = t0 + dropped, early.y1, early.mode1
    ledger = WithIntegrals(system, _rates)
    solution = simulate(
        ledger, t0, t0 + duration, ledger.start(y0, t0, args), mode, args, integrator=integrator,
        saveat=SaveAt(events=True, max_events=max_events),
    )  # fmt: skip
    grown = solution.y1.integrals["divergence"]
    if not system.guard_names:
        return grown / duration
    events = solution.events
    assert events is not None
    size = ravel_pytree(y0)[0].size

    def jump(t, y, mode, guard, valid):
        matrix = saltation_matrix(system, t, y, jnp.maximum(mode, 0), jnp.maximum(guard, 0), args)
        matrix = jnp.where(valid, matrix, jnp.eye(size))
        return jnp.linalg.slogdet(matrix)[1]

    valid = jnp.arange(max_events, dtype=jnp.int32) < events.count
    filled = jax.tree.map(
        lambda a, b: jnp.where(valid.reshape(-1, *(1,) * (a.ndim - 1)), a, b),
        events.y_before.y,
        jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y0),
    )
    times = jnp.where(valid, events.t, t0)
    jumps = jax.vmap(jump)(times, filled, events.mode_before, events.guard, valid)
    return (grown + jnp.sum(jumps)) / duration


def _rates(system, t, y, mode, args):
    return {"divergence": divergence(system, t, y, mode, args)}
