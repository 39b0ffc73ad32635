"""`simulate`: the one way to run a hybrid system."""

from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import PyTree

from .._argument_checks import check_arguments, checked_by, instance, or_none
from .._types import Given, Mode, Numeric, Row
from .._validation import (
    check_at_least,
    check_count,
    check_flag,
    check_type,
    is_concrete,
    leaves_of,
    refusal,
)
from . import _solution as out
from ._autodiff import core
from ._component_kinds import component_kinds, sizes_driven
from ._failure import raise_failures
from ._loop_state import Plan
from ._progress import ProgressMeter
from ._record import Capacities
from ._section import Section
from ._sided import of_sided, system_with_sides, without_sides
from ._solution import Solution
from ._step_size import AbstractStepSize, AdaptiveStep
from ._still import too_still
from ._tolerance import Noise, cancelling, component_tolerances
from .accuracy import ACCURACY
from .arguments import (
    a_time,
    check_field,
    check_sections,
    check_times,
    first_mode,
    output_times,
    sections_of,
    the_start,
    the_system,
)
from .compile_options import jit_plainly
from .dependence import may_change_suddenly, may_jump
from .event_functions import event_functions
from .executor import current_executor
from .longest_step import step_bound
from .status import BENT, CODE, CODES, RESULTS, STILL, flag, item_of
from .stepper import ExplicitRungeKutta, as_stepper
from .system import AbstractHybridSystem
from .tree import frozen, select, shift, with_float_arrays

if TYPE_CHECKING:
    from typing import Literal

    import diffrax


@check_arguments(
    ts=or_none(checked_by(check_times)), max_rows=checked_by(check_count, 1),
    max_events=or_none(checked_by(check_count, 0)), max_crossings=checked_by(check_count, 1),
    **dict.fromkeys(("steps", "events"), checked_by(check_flag)),
)  # fmt: skip
class SaveAt(eqx.Module):
    """Which parts of the motion are kept besides its end.

    - `ts`: output times [s], increasing, within `[t0, t1]`; the integrator lands on each. They are
      `outputs` of the `Solution`.
    - `steps`: every accepted step and both sides of every event; at most `max_rows` rows. They have
      no derivatives: the integrator chose their times.
    - `events`: the log of transitions.
    - `sections`: one or several `Section`s, whose `crossings` are recorded; a terminal one ends the
      motion.
    - `max_events`: room in the log of events; a lane with more ends with
      `RESULTS.max_events_reached`. `None` keeps no log and sets no limit.
    - `max_crossings`: room for the crossings of each section; a lane with more ends with
      `RESULTS.max_crossings_reached`.
    """

    ts: Row | None = None
    steps: bool = eqx.field(static=True, default=False)
    events: bool = eqx.field(static=True, default=True)
    sections: Given[tuple[Section, ...] | Section] = eqx.field(converter=sections_of, default=())
    max_rows: int = eqx.field(static=True, default=4096)
    max_events: int | None = eqx.field(static=True, default=256)
    max_crossings: int = eqx.field(static=True, default=256)


@check_arguments(
    max_steps=checked_by(check_count, 1), detect_dips=checked_by(check_flag),
    progress=or_none(instance(ProgressMeter, "a ProgressMeter or None")),
)  # fmt: skip
class Integrator(eqx.Module):
    """Method, step-size rule and limits.

    - `method`: `"dop853"` (default; order 8), `"tsit5"`, `"rk4"`, or any diffrax solver; implicit
      ones such as `diffrax.Kvaerno5()` for stiff smoothed friction. They solve their stages by Newton's
      method, to a tenth of what the step may err, unless `root_finder` says otherwise. A method of your
      own is a `Tableau` or an `AbstractStepper`.
    - `step`: `AdaptiveStep(rtol, atol)` (default `rtol` 1e-10 of the motion's size), `FixedStep(h)`, or
      an `AbstractAdaptiveStep` of your own.
    - `max_steps`: attempts per lane before it ends with `RESULTS.max_steps_reached`.
    - `detect_dips`: look inside steps. One over which an event function may have gone through zero and
      back is divided there; with adaptive steps, one over which an event function is not the cubic
      through its ends is made shorter. Missed are: with fixed steps, excursions that are not convex
      over a step; with adaptive ones those shorter than 0.4 of the longest step, which `AdaptiveStep`
      states for loads of the time and of the state.
    - `progress`: a `ProgressMeter` for long runs; off by default.
    """

    method: Given["Literal['dop853', 'tsit5', 'rk4'] | diffrax.AbstractSolver"] = "dop853"
    step: AbstractStepSize = eqx.field(default_factory=lambda: AdaptiveStep(1e-10))
    max_steps: int = eqx.field(static=True, default=100_000)
    detect_dips: bool = eqx.field(static=True, default=True)
    progress: ProgressMeter | None = None

    def __check_init__(self):
        try:
            stepper = as_stepper(self.method)
        except ValueError:
            named = "'dop853', 'tsit5', 'rk4', a Tableau, or a solver such as diffrax.Kvaerno5()"
            raise refusal("method", self.method, named) from None
        check_type("step", self.step, AbstractStepSize, "an AdaptiveStep or a FixedStep")
        if self.step.adaptive and not stepper.has_error_estimate():
            raise refusal("step", self.step, f"FixedStep(h): {self.method!r} has no error estimate")


# For all calls that do not give their own: they were checked when they were made.
USUAL, USUALLY_KEPT = Integrator(), SaveAt()


def simulate(
    system: AbstractHybridSystem,
    t0: Numeric,
    t1: Numeric,
    y0: PyTree,
    mode0: Mode | None = None,
    args: PyTree = None,
    *,
    integrator: Given[Integrator | None] = None,
    saveat: Given[SaveAt | None] = None,
    throw: Given[bool] = True,
) -> Solution:
    r"""Simulate a hybrid system from `t0` to `t1`, every event located to rounding.

    Solves $\dot y = f_m(t, y)$ with transitions of the mode $m$ where a guard crosses zero. Event
    location is part of the step-size control: an attempt in which a guard changed sign is repeated
    shorter until the guard is at rounding level.

    **Arguments**

    - `system`: the hybrid system; its fields are its parameters.
    - `t0`, `t1`: start and end [s], `t1 >= t0`.
    - `y0`: initial state, a pytree of floats.
    - `mode0`: mode at `t0`, name or number; by default `system.initial_mode(t0, y0, args)`. A
      state that cannot be in the mode given is noticed where a guard is violated (a flag), or in an
      `AbstractMechanism`, a contact would stick that slides or a stop be closed that is not met (an
      error, for concrete numbers).
    - `args`: passed through to the system's functions, e.g. inputs; a pytree.
    - `integrator`: an `Integrator`: method, step-size rule, limits.
    - `saveat`: a `SaveAt`: output times, every step, crossings of sections, room for events.
    - `throw`: raise if a lane fails. With `False` the failure is in `solution.result`, lane by lane,
      and everything computed until then is returned.

    **Returns** a `Solution`.

    **Events.** A guard already violated at `t0` (below zero) fires at `t0`. A crossing of a section
    belongs to `(t0, t1]`. An event at an output time is taken before the output. Two guards at one
    instant fire in the order of their values, each with its own transition; the lane is flagged. An
    event at `t1` is taken if it is located at or before `t1`.

    **Bends.** Where a comparison of numbers that depend on the state changes its outcome in the field
    (`jnp.maximum`, `jnp.where`, `jnp.clip`, `jnp.interp`, ...), or a declared switch its sign, a step
    ends as it does at an event, with neither a transition nor a row in the log of events.

    **Derivatives.** `jax.jvp`, `jax.jacfwd` (few parameters) and `jax.grad`, `jax.jacrev` (many) are
    exact with respect to the system's float fields, `args`, `y0`, `t0`, `t1` and output times, for
    the end state, outputs, steps, events (their times too) and crossings. They hold as long as the
    sequence of modes does not change; `solution.flags` marks runs where they do not exist or are not
    to be trusted: grazing or nearly so, coincident events, jumps that were not declared. Step lengths
    and the number of steps are not differentiated. Second derivatives raise an error.

    **Errors** `ValueError`/`TypeError` naming the argument for wrong shapes, non-finite or float32
    values, `t1 < t0`, an unknown mode, unordered output times, guards that are not scalars; all
    before compilation. `SimulationError` for a run that fails, which has the solution until then.
    """
    if integrator is not None:
        check_type("integrator", integrator, Integrator, "an Integrator")
    if saveat is not None:
        check_type("saveat", saveat, SaveAt, "a SaveAt, such as SaveAt(ts=times)")
    check_flag("throw", throw)
    leaves_of("args", args)
    system, args = with_float_arrays((the_system(system), args))
    t0, t1 = a_time("t0", t0), a_time("t1", t1)
    if not (type(t0) is type(t1) is np.ndarray and t0 <= t1):
        check_at_least("t1", t1, "t0", t0)
    ts = None if saveat is None else output_times(saveat.ts, t0, t1)
    y0, mode0 = the_start(system, y0, mode0, args)
    mode: Any = mode0  # a number by now
    # A bound method of Equinox takes 30 us to make.
    type(system).check_start(system, t0, y0, mode, args)

    def run(mode0):
        return _run(system, args, t0, t1, y0, mode0, ts, integrator, saveat, current_executor())

    try:
        solution, fine = run(mode0)
    except jax.errors.ConcretizationTypeError:
        if mode0 is not None:
            raise
        # Perhaps `initial_mode` asks in Python which number it has.
        solution, fine = run(first_mode(system, t0, y0, args))
    if not throw or (is_concrete(fine) and bool(fine)):
        return solution
    return raise_failures(solution, fine)


@jit_plainly
def _run(system, args, t0, t1, y0, mode0, ts, integrator, saveat, execute) -> tuple[Solution, Any]:
    # None until here: to take the usual objects apart in every call would cost a tenth of it.
    integrator = USUAL if integrator is None else integrator
    saveat = USUALLY_KEPT if saveat is None else saveat
    sections: Any = saveat.sections
    max_events, max_crossings = saveat.max_events, saveat.max_crossings
    if mode0 is None:
        mode0 = first_mode(*frozen((system, t0, y0, args)))
    problem = (system, args)
    check_field(system, t0, y0, mode0, args)
    check_sections(system, sections, t0, y0, mode0, args)
    log_events = saveat.events and max_events is not None
    rule, watched, longest = step_bound(integrator.step, system, sections, t0, t1 - t0, y0, mode0, args)
    bent, unlocated = system_with_sides(system, t0, y0, mode0, args)
    # Located jumps surprise nobody; in a field with sides only jumps in time are left.
    of_time = (t0, y0) if bent is None or bent.jumps else (t0,)
    jumps = may_jump(lambda t, y=y0: system.vector_field(t, y, mode0, args), of_time)
    jumps |= may_change_suddenly(lambda t, y: system.vector_field(t, y, mode0, args), (t0, y0))
    if bent is not None:
        mode0 = bent.with_sides(t0, y0, mode0, args)
        system, problem, sections = bent, (bent, args), tuple(map(of_sided, sections))
    functions = event_functions(system, sections, t0, y0, y0, mode0, args)
    stepper = as_stepper(integrator.method, _rtol(rule))
    atols, kinds, terms, sizes = (), (), y0, {}  # no tolerances with fixed steps that solve nothing
    if rule.adaptive or stepper.solves:
        atols = component_tolerances(rule.atol if rule.adaptive else None, y0, system.units)
        kinds = component_kinds(system, y0)
    if rule.adaptive:
        rule = eqx.tree_at(lambda r: r.atol, rule, None, is_leaf=lambda a: a is None)
        if any(atol is None for atol in atols):

            def field(t, y):
                return system.vector_field(t, y, mode0, args)

            terms = cancelling(field, t0, y0)
            sizes = sizes_driven(field, t0, y0, kinds, jnp.abs(t1 - t0))
    plan = Plan(
        stepper=stepper,
        step_size=jax.tree.map(lambda a: stop_gradient(jnp.asarray(a, jnp.float64)), rule),
        functions=functions,
        execute=execute,
        max_events=max_events,
        max_crossings=max_crossings,
        max_steps=integrator.max_steps,
        has_outputs=ts is not None,
        atols=atols,
        kinds=kinds,
        noise=stop_gradient(Noise(jnp.maximum(jnp.abs(t0), jnp.abs(t1)), terms, sizes)),
        watched=watched,
        longest=stop_gradient(longest),
        resolution=stop_gradient(ACCURACY.resolution * (t1 - t0)),
        detect_dips=integrator.detect_dips,
        switches=jumps,
        progress=integrator.progress,
    )
    capacities = Capacities(
        events=max_events if log_events else None,
        crossings=tuple(1 if s.terminal else max_crossings for s in sections),
        outputs=0 if ts is None else ts.shape[0],
        steps=saveat.max_rows if saveat.steps else None,
    )
    fixed = (mode0, stop_gradient(t1), None if ts is None else stop_gradient(ts))
    smooth, counts = core((problem, t0, y0), fixed=fixed, plan=plan, capacities=capacities)
    solution = _assemble(plan, problem, t0, t1, (y0, mode0), ts, smooth, counts, capacities)
    solution = without_sides(solution, system)
    if unlocated:
        solution = eqx.tree_at(lambda s: s.flags, solution, solution.flags | BENT)
    return solution, solution.successful


def _rtol(rule: Any) -> Any:
    """Relative tolerance of adaptive steps, None of others."""
    rtol = getattr(rule, "rtol", None) if rule.adaptive else None
    return None if rtol is None else stop_gradient(jnp.asarray(rtol, jnp.float64))


def _assemble(plan: Plan, problem, t0, t1, start, ts, smooth, counts, capacities) -> Solution:
    """Logs as the user sees them. Times that were landed on to rounding are made exact here, which
    also carries the derivative with respect to them."""
    logs = eqx.combine(smooth.logs, counts.logs)
    finished = counts.status == CODE["successful"]
    t_end, y_end = smooth.t, smooth.y
    system, args = problem

    def slope(t, y, mode):
        return system.vector_field(t, y, mode, args)

    def settle(t, y, mode, valid):
        moved = system.held_state(t, y, jnp.maximum(mode, 0), args)
        return y if moved is y else select(valid & (mode >= 0), moved, y)

    def land(t, target, y, mode, lands, valid):
        y = shift(y, stop_gradient(slope(t, y, mode)), jnp.where(lands, target - t, 0.0))
        t = jnp.where(lands, target, t)
        y = settle(t, y, mode, valid)
        return y, slope(t, y, mode)

    # The end of a run that fails, too, may be what another goes on from.
    y1, dy1 = land(t_end, t1, y_end, counts.mode, finished, True)
    flags = counts.flags
    # Implicit methods are right with steps that are long against the rates of the field.
    if plan.step_size.adaptive and isinstance(plan.stepper, ExplicitRungeKutta):
        y0, mode0 = start
        lasts, field = t_end - t0, lambda t, y: slope(t, y, mode0)
        still = too_still(plan, field, t0, lasts, counts.accepted, y0, y_end, dy1)
        flags = flags | flag(still & finished & (counts.events == 0), STILL)
    t_stop = jnp.where(finished, t1, t_end)
    outputs = None
    if ts is not None:
        rows = logs.outputs
        reached = jnp.arange(capacities.outputs, dtype=jnp.int32) < counts.outputs
        y, dy = jax.vmap(land)(rows.t, ts, rows.y, rows.mode, reached, reached)
        outputs = _state_log(counts.outputs, ts, y, dy, rows.mode, capacities.outputs)
    crossings = ()
    for i, (section, count, rows) in enumerate(
        zip(plan.functions.sections, counts.crossings, logs.crossings, strict=True)
    ):
        size = capacities.crossings[i]
        count = jnp.minimum(count, size)
        t, y, dy, mode = rows
        y = jax.vmap(settle)(t, y, mode, jnp.arange(size, dtype=jnp.int32) < count)
        crossings = (*crossings, _state_log(count, t, y, dy, mode, size))
        if section.terminal:
            stopped = (
                (counts.status == CODE["event_occurred"])
                & (t[0] >= t_end - 1e-6 * jnp.abs(t_end))
                & (count > 0)
            )
            t_first, *end = jax.tree.map(lambda a: a[0], (t, y, dy))
            t_stop = jnp.where(stopped, t_first, t_stop)
            y1, dy1 = select(stopped, tuple(end), (y1, dy1))
    steps = None
    if capacities.steps is not None:
        rows, count = logs.steps, jnp.minimum(counts.steps, capacities.steps)
        kept = jnp.arange(capacities.steps, dtype=jnp.int32) < count
        y = jax.vmap(settle)(rows.t, rows.y, rows.mode, kept)
        dy = jax.vmap(slope)(rows.t, y, rows.mode)
        steps = _state_log(count, rows.t, y, dy, rows.mode, capacities.steps)
    events = None
    if capacities.events is not None:
        count = jnp.minimum(counts.events, capacities.events)
        events = out.EventLog(count, *out.mask_rows(tuple(logs.events), count, capacities.events))
    return Solution(
        t0=t0,
        t1=t_stop,
        y1=y1,
        dy1=dy1,
        mode1=counts.mode,
        outputs=outputs,
        steps=steps,
        events=events,
        crossings=crossings,
        result=item_of(RESULTS, CODES, counts.status),
        flags=flags,
        flagged_at=counts.flagged_at,
        flagged_guard=counts.flagged_guard,
        guard_names=tuple(system.guard_names),
        sequence=counts.sequence,
        stats=out.Stats(counts.attempts, counts.accepted, counts.events),
    )


def _state_log(count, t, y, dy, mode, size) -> out.StateLog:
    return out.StateLog(count, *out.mask_rows((t, y, dy, mode), count, size))
