"""State of one lane between attempts, and the outcome of an attempt."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from . import _locate
from ._locate import Bracket
from ._progress import ProgressMeter
from ._step_size import AbstractStepSize
from ._tolerance import Noise, sizes
from ._unseen import Watched
from .event_functions import EventFunctions
from .executor import Executor
from .status import CODE, RUNNING
from .stepper import AbstractStepper

# Codes of the outcome of an attempt. The decision is one number, computed once; everything else selects
# on it. Codes, counters and marks are floating-point numbers: masks that come from and go to vectors of
# the width of the state need no packing. The order makes each question about a code one comparison.
HOLD = 0.0  # the lane had ended
SHRINK = 1.0  # an event function changed sign: try shorter
DIP = 2.0  # an event function may have gone through zero and back: look there
REJECT = 3.0  # error estimate too large
PLAIN = 4.0  # accepted, no event
REFRESH = 5.0  # accepted, of length zero: slope and event functions in the new mode
SECTION = 6.0  # accepted, ends on a section
EVENT = 7.0  # accepted, ends on a guard
COLLAPSED = 8.0  # accepted, ends on a guard that has no slope there
VIOLATED = 9.0  # a guard was violated before the first step of the mode


class Lane(NamedTuple):
    """Everything one lane carries from attempt to attempt; scalars but for arrays in the state."""

    t: Any
    y: PyTree
    dy: PyTree  # slope at (t, y, mode); stale right after an event, until an attempt of length zero
    mode: Any
    fresh: Any  # with guards, whether `dy` and `values` belong to the present mode
    values: tuple  # event functions at (t, y); 0 for what has just fired and fires both ways
    rates: tuple
    scales: tuple  # magnitudes of the guards behind `values`, where they are learned
    size: PyTree  # largest magnitude of each component so far; None if nothing follows it
    h: Any  # length of the next attempt
    h_free: Any  # what the step-size rule alone would take
    error: Any  # last accepted scaled error
    peak: Any  # longest of the last steps, forgotten slowly; None if the field cannot jump
    bracket: Bracket
    full: Any  # length of the attempt that opened the bracket
    next_output: Any
    zero_events: Any
    status: Any
    flags: Any  # with the time and the guard of the first, as `flags_with` has it
    sequence: Any  # hash of the events so far: equal hashes mean equal mode sequences
    attempts: Any
    accepted: Any
    events: Any
    crossings: tuple  # per section


class Outcome(NamedTuple):
    """Outcome of one attempt, for the recorder and for the reverse sweep."""

    code: Any
    guard: Any
    landed: Any  # on an output time
    fired: tuple  # per section
    y_before: PyTree  # at the event, before the transition; else the end of the attempt
    dy: PyTree


class Known(NamedTuple):
    """Events and crossings of a run, for the runs that its derivatives are computed in."""

    near: tuple  # times of the crossings of each section
    crossings: tuple  # how many of each
    sequence: Any  # hash of the events

    def is_met(self, lane: Lane) -> Any:
        """Whether a lane at its end has met the same, so that rows of both belong to each other."""
        same = lane.sequence == self.sequence
        for count, known in zip(lane.crossings, self.crossings, strict=True):
            same = same & (count.astype(known.dtype) == known)
        return same


class Plan(eqx.Module):
    """Static choices of a run, and its numbers that are not differentiated."""

    stepper: AbstractStepper
    step_size: AbstractStepSize
    functions: EventFunctions
    execute: Executor
    max_events: int | None = eqx.field(static=True)
    max_crossings: int = eqx.field(static=True)
    max_steps: int = eqx.field(static=True)
    has_outputs: bool = eqx.field(static=True)
    atols: tuple  # absolute tolerance of each leaf of the state; None: by the size of the motion
    kinds: tuple[str, ...] = eqx.field(static=True)  # of leaves, each measured by its largest
    noise: Noise  # whose rounding no step can undercut
    watched: tuple[Watched, ...] = eqx.field(static=True)  # motions that an error may not see
    longest: Any  # while one of these moves evenly [s]
    resolution: Any  # steps below it are not cut for the sake of an event function [s]
    detect_dips: bool = eqx.field(static=True)
    switches: bool = eqx.field(static=True)  # whether the field may jump inside a mode
    progress: ProgressMeter | None = None

    @property
    def watches_jumps(self) -> bool:
        """Whether steps are watched for jumps of the field inside them."""
        return self.switches and self.step_size.adaptive

    @property
    def follows_size(self) -> bool:
        """Whether tolerances or magnitudes of guards follow the size of the motion."""
        return self.functions.learned or any(atol is None for atol in self.atols)

    @property
    def looked_at_inside(self) -> tuple[bool, ...]:
        """Which event functions are compared with their cubics inside each step.

        One that is affine in time and state is so along the motion only as far as the motion is a
        cubic: with steps of its own choice the engine makes them short enough for that.
        """
        functions = self.functions
        rows = zip(functions.bent, functions.straight, strict=True)
        adaptive = self.step_size.adaptive
        return tuple(self.detect_dips and (bent or (adaptive and line)) for bent, line in rows)

    @property
    def touching(self) -> Any:
        """Scaled value of a guard that is zero to tolerance and rounding, for derivatives.

        A value uncertain by `d` makes the slope of a crossing `sqrt(2 c D)` deep below a bend `c`
        uncertain by `d / (2 D)` of itself, and with it the derivative: 1e-4 at `D = 5000 d`.
        """
        rule: Any = self.step_size
        return 5e3 * rule.rtol if rule.adaptive else 5e-7

    @property
    def locates(self) -> bool:
        """Whether the zero of an event function can end a step: not if all are recorded sections."""
        return any(self.functions.acts(i) for i in range(self.functions.count))

    @property
    def interrupts(self) -> bool:
        """Whether an event function can shorten a step: not if all are sections known at its end."""
        return self.locates or (self.detect_dips and self.functions.count > 0)


def is_event(code: Any) -> Any:
    """Whether the attempt ended in a transition."""
    return code >= EVENT


def is_accepted(code: Any) -> Any:
    """Whether the attempt was accepted, with or without a transition."""
    return code >= PLAIN


def moved_on(code: Any) -> Any:
    """Whether the attempt was accepted without a transition."""
    return (code >= PLAIN) & (code < EVENT)


def start_lane(plan: Plan, t0, y0, mode0) -> Lane:
    """Lane at `t0`, before its first attempt, which has length zero and computes the slope."""
    zero = jnp.zeros_like(t0)
    izero = jnp.zeros(jnp.shape(t0), jnp.int32)
    n = plan.functions.count
    status = jnp.where(mode0 < 0, float(CODE["no_admissible_mode"]), float(RUNNING))
    return Lane(
        t=t0,
        y=y0,
        dy=jax.tree.map(jnp.zeros_like, y0),
        mode=mode0,
        fresh=zero,
        values=(zero,) * n,
        rates=(zero,) * n,
        scales=(zero,) * (plan.functions.num_guards if plan.functions.learned else 0),
        # Left out where it never changes: the fused loop could not be compiled.
        size=jax.lax.stop_gradient(sizes(y0)) if plan.follows_size else None,
        h=zero,
        h_free=zero,
        error=zero + 1.0,
        peak=zero if plan.watches_jumps else None,
        bracket=_locate.empty(
            zero, jnp.full_like(mode0, -1) if plan.functions.num_guards and n > 1 else None
        ),
        full=zero,
        next_output=izero,
        zero_events=zero,
        status=status,
        flags=izero.astype(jnp.int64),
        sequence=izero.astype(jnp.uint32),
        attempts=zero,
        accepted=zero,
        events=zero,
        crossings=(zero,) * len(plan.functions.sections),
    )


def knows_slope(plan: Plan, lane: Lane) -> Any:
    """Whether `dy` and `values` belong to the present mode, of which there is one without guards."""
    return lane.fresh == 1.0 if plan.functions.num_guards else lane.attempts > 0


def without_state(lane: Lane) -> Lane:
    """The lane's bookkeeping alone, free of derivatives."""
    bare = lane._replace(y=None, dy=None, size=None)
    return jax.tree.map(jax.lax.stop_gradient, bare)
